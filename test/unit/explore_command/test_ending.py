"""What a run's end says: what died, what to do, and an exit code that knows of no success where nobody judged."""

import errno
import json
import os
from pathlib import Path

import pytest

import exploration_evaluation.ending
from explore_command import ending
from explore_command.ending import cause_of_death

NODE_DIED = "\x1b[31m[move_base_node-12] process has died [pid 7, exit code -9, cmd /x/move_base_node __name:=move_base_node]."
REQUIRED = "===REQUIRED process [{}] has died!\nprocess has {}\nInitiating shutdown!\n==="


@pytest.mark.parametrize(
    ("code", "log", "cause"),
    [
        (137, "", "roslaunch was killed"),
        (-9, "", "the keeper of roslaunch was killed"),
        (0, REQUIRED.format("master", "died [pid 3, exit code -9, cmd rosmaster]."), "rosmaster died"),
        (0, REQUIRED.format("exploration_monitor_node-14", "died [pid 3, exit code -9, cmd x]."), "exploration_monitor_node died"),
        (0, f"{NODE_DIED}\n{NODE_DIED.replace('move_base', 'scan_filter')}", "move_base_node died"),
        (0, REQUIRED.format("exploration_monitor_node-14", "finished cleanly"), None),
        (1, "[rosout-1] killing on exit", None),
    ],
)
def test_what_died_first_is_named(code: int, log: str, cause: str | None) -> None:
    assert cause_of_death(code, log) == cause


def run_folder(folder: Path, log: str = "", **files: object) -> Path:
    (folder / "roslaunch.log").write_text(log)
    for name, content in files.items():
        (folder / f"{name}.json").write_text(json.dumps(content))
    return folder


def ended(out: Path, code: int, *, interrupted: bool) -> int:
    return ending.ended(out, code, interrupted, (out / "roslaunch.log").read_text())


def summary_of(folder: Path) -> dict[str, object]:
    return dict(json.loads((folder / "summary.json").read_text()))


def test_run_without_a_summary_gets_one_with_what_died(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = run_folder(tmp_path, run={"world": "rooms"}, counters={"stop_reason": "interrupted", "sweeps": 3})
    (out / "sweeps").mkdir()
    (out / "sweeps" / "000000.ply").touch()
    assert ended(out, 137, interrupted=False) == 1
    assert summary_of(out) == {"world": "rooms", "sweeps": 3, "stop_reason": "roslaunch was killed", "success": False}
    told = capsys.readouterr()
    assert told.err == f"./explore: roslaunch was killed; what was mapped is in {out}, and ./explore --resume {out} goes on with it\n"


def test_run_that_cannot_be_judged_is_no_success_and_says_how_it_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(exploration_evaluation.ending, "write_json", refuse)
    out = run_folder(tmp_path, run={"world": "rooms"})
    assert ended(out, 0, interrupted=False) == 1
    told = capsys.readouterr()
    assert "is full: make room there" in told.out and told.err.startswith("./explore: the run has no summary; nothing was mapped yet")


def test_folder_without_a_sweep_cannot_be_resumed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert ended(run_folder(tmp_path, run={}), 137, interrupted=False) == 1
    assert "nothing was mapped yet: start it again" in capsys.readouterr().err


def test_run_that_had_its_reason_keeps_it(tmp_path: Path) -> None:
    out = run_folder(tmp_path, run={}, counters={"stop_reason": "explored: all"})
    ended(out, 137, interrupted=False)
    assert summary_of(out)["stop_reason"] == "explored: all"


def test_user_who_interrupts_is_told_of_no_death(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = run_folder(tmp_path, NODE_DIED, run={}, counters={"stop_reason": "interrupted"})
    assert ended(out, 0, interrupted=True) == 1
    assert summary_of(out)["stop_reason"] == "interrupted" and capsys.readouterr().err == ""


def test_success_stays_one_when_roslaunch_dies_after_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert ended(run_folder(tmp_path, summary={"success": True}), 137, interrupted=False) == 0
    assert capsys.readouterr().err == ""


def test_wrong_parameter_is_exit_code_two_and_its_line_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = f"started\nmove_base_node: wrong parameter: max_speed\n{NODE_DIED}\n"
    assert ended(run_folder(tmp_path, log), 1, interrupted=False) == 2
    assert capsys.readouterr().err == "move_base_node: wrong parameter: max_speed\n"
