"""./explore says in one line where to look, when it starts and when it has ended."""

import subprocess
from pathlib import Path

import pytest

from explore_command import launching
from explore_command.arguments import parse
from robot_body import RobotBody


def said_by_a_run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], out: Path, *words: str) -> list[str]:
    """The lines of ./explore whose launch ends at once."""

    def launch(*_: object, **__: object) -> "subprocess.Popen[str]":
        return subprocess.Popen(["echo", "[explore] SUCCESS"], stdout=subprocess.PIPE, text=True)

    monkeypatch.setattr(launching, "start_launch", launch)
    monkeypatch.setattr(launching, "hand_on_signals", lambda _: [])
    arguments = parse(["--world", "rooms", "--out", str(out), "--port", "20202", *words])
    launching.run_launch(launching.as_robot_is_built(arguments, RobotBody()), RobotBody(), 0.0, lock=-1)
    return capsys.readouterr().out.splitlines()


def test_headless_run_says_how_rviz_is_opened(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    now = said_by_a_run(monkeypatch, capsys, tmp_path, "--headless")[1]
    assert now.startswith("to look: source ")
    assert "ROS_MASTER_URI=http://localhost:20202 rviz -d " in now
    config = Path(now.rpartition(" ")[2])
    assert config.is_file()


def test_run_with_rviz_says_that_it_opens(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert said_by_a_run(monkeypatch, capsys, tmp_path, "--rviz")[1] == "to look: rviz opens"


def test_end_names_the_picture_and_the_replay(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "map_angle.png").touch()
    end = said_by_a_run(monkeypatch, capsys, tmp_path)[-1]
    assert f"{tmp_path / 'map_angle.png'}" in end
    assert f"./replay {tmp_path}" in end


def test_run_without_a_picture_names_its_log(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert f"{tmp_path / 'roslaunch.log'}" in said_by_a_run(monkeypatch, capsys, tmp_path)[-1]
