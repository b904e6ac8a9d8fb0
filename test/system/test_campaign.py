"""A campaign of two runs whose worker and whose ./evaluate are killed in mid run comes to the same report as an undisturbed one."""

import json
import os
import signal
import time
from pathlib import Path

from exploring import ExploreRun

RUN_LIMIT_S = 400.0
# the monitor is outside of lock-step: when it ends a run differs by a tick
_MEASURED_IN_WALL_TIME = ("wall_s", "compute_s", "runtime_s", "clairvoyant_ratio", "started", "attempts", "_time_s")


def evaluate(out: Path) -> ExploreRun:
    return ExploreRun("--worlds", "rooms", "--seeds", "1-2", "--jobs", 1, "--out", out, command="evaluate")


def wait_for_driving(folder: Path, run: ExploreRun) -> None:
    """Until the run in a folder drives."""
    deadline = time.monotonic() + 480.0
    while "driving" not in (folder / "events.csv").read_text() if (folder / "events.csv").exists() else True:
        assert time.monotonic() < deadline and run.process.poll() is None, f"{folder} does not drive: {run.text}"
        time.sleep(0.1)


def kill_worker(run: ExploreRun) -> None:
    """kill -9 of the cluster's worker."""
    pids = [pid for pid, command in run.running().items() if "multiprocessing" in command and "spawn_main" in command]
    assert len(pids) == 1, run.running()
    os.kill(pids[0], signal.SIGKILL)


def steady(value: object) -> object:
    """`value` without what depends on the machine."""
    if isinstance(value, dict):
        return {k: steady(v) for k, v in value.items() if not k.endswith(_MEASURED_IN_WALL_TIME)}
    return [steady(v) for v in value] if isinstance(value, list) else value


def test_killed_campaign_goes_on_to_the_report_of_an_undisturbed_one(tmp_path: Path) -> None:
    calm, disturbed = tmp_path / "calm", tmp_path / "disturbed"
    with evaluate(calm) as run:
        assert run.wait(RUN_LIMIT_S) == 0, run.text
        assert not run.running(), f"still running: {run.running()}"
    with evaluate(disturbed) as run:
        wait_for_driving(disturbed / "runs/ours/rooms-1", run)
        kill_worker(run)
        run.wait_until_gone(lambda _, command: "__name:=" in command)  # nodes of the run that the worker made
        run.wait_for_line(r"rooms 1 \(ours\): finished", RUN_LIMIT_S)
        wait_for_driving(disturbed / "runs/ours/rooms-2", run)
        os.kill(run.process.pid, signal.SIGKILL)
        run.wait_until_gone()
        assert not run.running()
    first = (disturbed / "runs/ours/rooms-1/outcome.json").read_bytes()
    with evaluate(disturbed) as run:
        assert run.wait(RUN_LIMIT_S) == 0, run.text
        assert "2 runs, 1 of them to be made" in run.text
    assert (disturbed / "runs/ours/rooms-1/outcome.json").read_bytes() == first
    assert json.loads(first)["attempts"] == 2
    reports = [steady(json.loads((out / "results.json").read_text())) for out in (calm, disturbed)]
    assert reports[0] == reports[1]
    assert all(run["clairvoyant_ratio"] > 1.0 for run in json.loads((calm / "results.json").read_text())["runs"])
    assert (disturbed / "report.html").stat().st_size > 10_000 and (disturbed / "report.md").exists()
