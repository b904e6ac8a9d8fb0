"""./replay as a person starts it: a run is played and everything ends, Ctrl-C ends it in seconds, what cannot be shown takes one line."""

import sys
import time
from pathlib import Path

import pytest
from exploring import PACKAGE, ExploreRun
from slow_machine import slowness

sys.path.insert(0, str(PACKAGE / "test" / "unit" / "run_replay"))
from recorded_runs import write_run

LIMIT_S = 90.0
END_LIMIT_S = 15.0


def replay(*arguments: object) -> ExploreRun:
    return ExploreRun(*arguments, "--headless", command="replay")


def ended(*arguments: object) -> tuple[int, str]:
    """Exit code and output of a ./replay that ends by itself and leaves nothing running; what set-up says of its own is left out."""
    with replay(*arguments) as run:
        code = run.wait(LIMIT_S)
        assert not run.running()
        return code, "".join(line for line in run.output if "[setup]" not in line)


def test_run_is_played_and_stays_as_it_was(tmp_path: Path) -> None:
    before = sorted(path.name for path in write_run(tmp_path).rglob("*"))
    code, text = ended(tmp_path, "--speed", 0)
    assert code == 0, text
    assert "played to its end at 9.0 s: 5 sweeps, 4 m" in text and "Traceback" not in text
    assert sorted(path.name for path in tmp_path.rglob("*")) == before


def test_interrupt_ends_everything_in_seconds(tmp_path: Path) -> None:
    with replay(write_run(tmp_path), "--speed", 0.01) as run:
        run.wait_for_line(r"^t=", LIMIT_S)
        interrupted = time.monotonic()
        run.interrupt()
        code = run.wait(LIMIT_S)
        seconds, limit_s = time.monotonic() - interrupted, END_LIMIT_S * slowness()
        assert seconds < limit_s, f"{seconds:.1f} s from Ctrl-C to the end, {limit_s:.1f} s allowed"
        assert code == 0, run.text
        assert not run.running()


@pytest.mark.parametrize("words", [("/nowhere/at/all",), ("--compare", "a"), ()])
def test_wrong_arguments_are_told_in_one_line(words: tuple[str, ...]) -> None:
    code, text = ended(*words)
    assert code == 2 and len(text.splitlines()) == 1 and text.startswith("./replay: "), text


def test_damaged_run_is_told_with_exit_code_two(tmp_path: Path) -> None:
    (write_run(tmp_path) / "trajectory.txt").write_text("no pose\n")
    code, text = ended(tmp_path)
    assert code == 2 and "trajectory.txt" in text.splitlines()[-1], text
    assert "Traceback" not in text
