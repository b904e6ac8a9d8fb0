"""./check_robot's arguments: what is wrong is one line that says which value, before a master is looked for."""

import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


def said(*words: str) -> str:
    """Of a check without a master, which ends with exit code 2."""
    environment = {**os.environ, "ROS_MASTER_URI": "http://localhost:9", "PYTHONPATH": f"{ROOT / 'src'}:{os.environ.get('PYTHONPATH', '')}"}
    command = [sys.executable, str(ROOT / "nodes" / "check_robot_node"), *words]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60.0)
    assert done.returncode == 2 and done.stdout == "" and done.stderr.count("\n") == 1, done.stderr
    return done.stderr


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--seconds", "nan"], "--seconds nan: expected 0.5 to 600 s"),
        (["--seconds", "0"], "--seconds 0: expected 0.5 to 600 s"),
        (["--seconds", "0", "--wait", "inf"], "--seconds 0: expected 0.5 to 600 s; --wait inf: expected 0 to 600 s"),
        (["--seconds", "ten"], "argument --seconds: invalid float value: 'ten'"),
        (["--sensor", "sonar"], "argument --sensor: invalid choice: 'sonar'"),
        (["--robt", "husky"], "unrecognized arguments: --robt husky"),
        (["--then"], "--then: expected a command after it"),
        (["--robot", "nosuch"], "--robot nosuch: no such robot or file; robots are "),
        ([], "no ROS master at http://localhost:9"),
        (["--robot", "husky"], "no ROS master at http://localhost:9"),
    ],
)
def test_wrong_argument_is_one_line_that_says_which_value(words: list[str], told: str) -> None:
    assert said(*words).startswith(f"check_robot: {told}")


def test_interrupt_is_one_line_and_no_verdict(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 1 would say that something is not right, and that a table says what."""
    monkeypatch.setattr(sys, "argv", ["check_robot"])
    node = runpy.run_path(str(ROOT / "nodes" / "check_robot_node"))

    def interrupted(_options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("rosgraph.is_master_online", lambda: True)
    monkeypatch.setattr("rospy.init_node", lambda *_, **__: None)
    monkeypatch.setitem(node["main"].__globals__, "found_rows", interrupted)
    assert node["main"]() == 130
    said = capsys.readouterr()
    assert said.out == "" and said.err == "check_robot: interrupted\n"
