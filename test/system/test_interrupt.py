"""Ctrl-C in the middle of a run: everything ends, and the map made so far is there."""

import time
from pathlib import Path

from exploring import ExploreRun, summary
from slow_machine import slowness

from octomap_server_3dnav.octree.octree import OctreeMap

END_LIMIT_S = 40.0


def test_interrupted_run_ends_everything_and_leaves_its_map(tmp_path: Path) -> None:
    out = tmp_path / "run"
    with ExploreRun("--world", "rooms", "--seed", 1, "--headless", "--out", out) as run:
        run.wait_for_first_sweep()
        run.wait_for_line(r"driving", 60.0)
        run.interrupt()
        interrupted_s = time.monotonic()
        code = run.wait(END_LIMIT_S)
        assert time.monotonic() - interrupted_s < END_LIMIT_S * slowness()
        assert not run.running(), f"still running: {run.running()}"
    assert code == 1, run.text
    assert "Traceback" not in run.text
    assert str(summary(out)["stop_reason"]).startswith("interrupted")
    assert summary(out)["success"] is False
    assert len(OctreeMap.read(out / "map.bt").occupied_voxels()[0]) > 1000
    assert (out / "cloud.ply").stat().st_size > 10_000
