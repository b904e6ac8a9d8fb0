"""Whole explorations of `rooms` by a robot that maps while it drives: as it is, and with faults on the way, of mount, laser, odometry."""

import os
import subprocess
from pathlib import Path

import pytest
from exploring import ExploreRun, summary

DRIVING = ("--headless", "--world", "rooms", "--seed", "1", "--mapping", "driving")


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Folder and output of the run."""
    out = tmp_path_factory.mktemp("driven") / "run"
    with ExploreRun(*DRIVING, "--out", out) as run:
        assert run.wait(300.0) == 0, run.text
    return out, run.text


def test_rooms_are_explored_and_mapped_truly_while_driving(driven: tuple[Path, str]) -> None:
    result = summary(driven[0])
    assert result["success"] is True and result["coverage"] >= 0.995 and result["collisions"] == 0, result  # type: ignore[operator]
    assert result["trajectory_ate_m"] < 0.03 and result["map_rmse_m"] < 0.03 and result["wrong_edges"] == 0, result  # type: ignore[operator]


def test_most_of_the_time_it_drives(driven: tuple[Path, str]) -> None:
    result = summary(driven[0])
    activity = result["activity_s"]
    assert isinstance(activity, dict)
    assert activity["driving"] > 0.7 * sum(activity.values()), activity
    assert result["sweeps"] > 15, result  # type: ignore[operator]


def test_no_node_printed_a_traceback(driven: tuple[Path, str]) -> None:
    assert "Traceback" not in (driven[0] / "roslaunch.log").read_text()


def test_mount_that_stops_nodding_stops_the_robot_and_is_asked_again(tmp_path: Path) -> None:
    out = tmp_path / "run"
    with ExploreRun(*DRIVING, "--out", out) as run:
        master = run.wait_for_line("ROS_MASTER_URI=", 60.0).partition("ROS_MASTER_URI=")[2].strip()
        run.wait_for_line(r"\b[3-9] sweeps\b", 120.0)
        stop = ["rosservice", "call", "/nod", "data: false"]
        subprocess.run(stop, env={**os.environ, "ROS_MASTER_URI": master}, check=True, capture_output=True, timeout=120.0)
        assert run.wait(300.0) == 0, run.text
    assert "no sweep comes: the robot has stood" in (out / "roslaunch.log").read_text()
    result = summary(out)
    assert result["success"] is True and result["collisions"] == 0 and result["trajectory_ate_m"] < 0.03, result  # type: ignore[operator]


def test_odometry_that_jumps_and_matches_that_are_refused_stop_the_robot_and_bend_no_map(tmp_path: Path) -> None:
    out, faults = tmp_path / "run", str(Path(__file__).with_name("injected_faults"))
    path = os.pathsep.join([faults, *filter(None, [os.environ.get("PYTHONPATH")])])
    with ExploreRun(*DRIVING, "--out", out, environment={"PYTHONPATH": path}) as run:
        assert run.wait(300.0) == 0, run.text
    log, result = (out / "roslaunch.log").read_text(), summary(out)
    assert log.count("odometry jumped: the tracked pose goes on where it was") == 3
    assert "matches are refused: 2 in a row" in log and "settling: matches were refused" in run.text
    assert result["refused_matches"] == 3 and result["success"] is True and result["collisions"] == 0, result
    assert result["trajectory_ate_m"] < 0.03 and result["map_rmse_m"] < 0.03 and result["wrong_edges"] == 0, result  # type: ignore[operator]


def test_laser_that_misses_half_of_five_sweeps_slows_the_robot_and_bends_no_map(tmp_path: Path) -> None:
    out = tmp_path / "run"
    faults = ", ".join(f"silent /scan {begin} {begin + 0.9}" for begin in (14, 16, 18, 20, 22))
    with ExploreRun(*DRIVING, "--out", out, "--set", f"pybullet_sim_node/timing/faults={faults}") as run:
        assert run.wait(300.0) == 0, run.text
    assert "scans of a sweep are missing:" in (out / "roslaunch.log").read_text()
    result = summary(out)
    assert result["success"] is True and result["coverage"] >= 0.995 and result["collisions"] == 0, result  # type: ignore[operator]
    assert result["trajectory_ate_m"] < 0.03 and result["map_rmse_m"] < 0.03 and result["wrong_edges"] == 0, result  # type: ignore[operator]
