"""What is written about a run ends where the run ends, however long its nodes go on."""

import json
from pathlib import Path

import numpy as np
import pytest
from explore_3dnav.msg import Contact, RunEvent
from nav_msgs.msg import Odometry

from rigid_geometry import transform_from_rpy
from ros_adapters.conversions import header
from ros_adapters.run_log import RunLog


def odometry(stamp_s: float, x: float) -> Odometry:
    message = Odometry(header=header(stamp_s, "odom"))
    message.pose.pose.position.x = x
    return message


@pytest.fixture
def finished_at_2(tmp_path: Path) -> Path:
    """A run that finished at 2 s and was told of until 3 s."""
    log = RunLog(tmp_path, {"exploration_monitor_node": {"world": "rooms", "seed": 4}})
    for tick in range(20, 61):
        stamp_s = 0.05 * tick
        if tick == 40:
            log.event(RunEvent(header(stamp_s, "odom"), "finished", "explored: all", 3, False, ""))
        log.truth(stamp_s, transform_from_rpy((stamp_s, 0.0, 0.0)))
        log.contact(Contact(header(stamp_s, "world"), "deck", 0.1, 5.0))
        log.odometry(odometry(stamp_s, stamp_s))
    log.finished = True
    log.finish("explored: all", judged=False)
    return tmp_path


def test_truth_and_contacts_end_with_the_run(finished_at_2: Path) -> None:
    truth = np.loadtxt(finished_at_2 / "trajectory_truth.txt")
    np.testing.assert_allclose(truth[:, 0], np.arange(1.0, 2.01, 0.05))
    np.testing.assert_allclose(truth[:, 1], truth[:, 0])
    assert (finished_at_2 / "contacts.csv").read_text().splitlines()[-1].startswith("2.000,deck,")


def test_time_ends_with_the_run(finished_at_2: Path) -> None:
    summary = json.loads((finished_at_2 / "summary.json").read_text())
    assert (summary["sim_time_s"], summary["sweeps"], summary["success"]) == (1.0, 3, True)
    assert (summary["world"], summary["seed"], summary["stop_reason"]) == ("rooms", 4, "explored: all")


def test_run_without_a_folder_only_keeps_its_status() -> None:
    log = RunLog(None, {})
    log.odometry(odometry(1.0, 0.0))
    log.odometry(odometry(3.0, 2.0))
    assert log.status_line().startswith("t=2.0 s")
    assert log.finish("stopped", judged=False) == "ended: stopped"
