"""A run that is killed in its middle goes on from its folder, with a robot that was carried elsewhere meanwhile."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from exploring import ExploreRun

from pose_graph_mapping.session.session_store import SessionStore

THREE_MAPPED = re.compile(r"\b[3-9] sweeps\b.*\| (?!mapping)")  # a sweep that is being mapped counts already, and is not on disk yet


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a run in rooms of which everything was killed at once, after three mapped sweeps."""
    out = tmp_path_factory.mktemp("killed") / "run"
    with ExploreRun("--headless", "--world", "rooms", "--seed", "1", "--out", str(out)) as run:
        run.wait_for_line(THREE_MAPPED, 150.0)
        run.end()
    return out


def summary_of(out: Path) -> dict[str, object]:
    return dict(json.loads((out / "summary.json").read_text()))


def test_killed_run_goes_on_to_the_end_and_keeps_every_sweep(killed: Path, tmp_path: Path) -> None:
    out, before = tmp_path / "run", SessionStore(killed)
    sweeps = len(before.sweeps)
    assert sweeps >= 3 and not (killed / "summary.json").exists()
    shutil.copytree(killed, out)
    with ExploreRun("--headless", "--resume", str(out)) as run:
        assert run.wait(300.0) == 0, run.text
    store = SessionStore(out)
    assert len(store.sweeps) > sweeps and not store.notes
    for k in range(sweeps):
        np.testing.assert_array_equal(store.load_sweep(k).points, before.load_sweep(k).points)
    summary = summary_of(out)
    assert summary["success"] is True and summary["wrong_edges"] == 0, summary
    assert summary["coverage"] >= 0.97 and summary["trajectory_ate_m"] < 0.03, summary
    assert (summary["collisions"], summary["fell"]) == (0, False)


def test_robot_that_is_not_in_the_map_drives_nowhere(killed: Path, tmp_path: Path) -> None:
    """The map of one world, the robot in another."""
    out = tmp_path / "run"
    arguments = ("--map", str(killed), "--world", "moon", "--seed", "1", "--out", str(out))
    with ExploreRun("--headless", *arguments) as run:
        assert run.wait(200.0) == 1, run.text
    assert "not found in the map" in str(summary_of(out)["stop_reason"])
    assert summary_of(out)["distance_m"] < 0.1
    assert len(SessionStore(out).sweeps) == len(SessionStore(killed).sweeps)
