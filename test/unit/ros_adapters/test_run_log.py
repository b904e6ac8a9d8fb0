"""What is written about a run ends where the run ends, however long its nodes go on."""

import errno
import json
import os
import pickle
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from explore_3dnav.msg import Contact, ExplorationDecision, RunEvent
from nav_msgs.msg import Odometry

from exploration_evaluation import ending
from mount_calibration import RECORDED_FILE, TiltCalibration, read_calibration
from rigid_geometry import transform_from_rpy
from robot_body import DESCRIPTION, RobotBody, load_robot, robot_from_mapping
from ros_adapters import run_log
from ros_adapters.conversions import header
from ros_adapters.run_log import RunLog


def odometry(stamp_s: float, x: float) -> Odometry:
    message = Odometry(header=header(stamp_s, "odom"))
    message.pose.pose.orientation.w = 1.0
    message.pose.pose.position.x = x
    return message


def finished_at_2(out: Path, *, judged: bool) -> str:
    """What a run says at its end that finished at 2 s and was told of until 3 s."""
    parameters = {"exploration_monitor_node": {"world": "rooms", "seed": 4}, "sensor": "tilting", "robot_description": "<robot/>"}
    log = RunLog(out, parameters, RobotBody(), judged=judged)
    for tick in range(20, 61):
        stamp_s = 0.05 * tick
        if tick == 40:
            log.event(RunEvent(header(stamp_s, "odom"), "finished", "explored: all", 3, False, "", 0.0, False, 0.0))
        if tick == 50:
            log.event(RunEvent(header(stamp_s, "odom"), "driving", "to a goal after exploration", 4, False, "", 0.0, False, 0.0))
        log.truth(stamp_s, transform_from_rpy((stamp_s, 0.0, 0.0)))
        log.contact(Contact(header(stamp_s, "world"), "deck", 0.1, 5.0, ""))
        log.odometry(odometry(stamp_s, stamp_s))
    log.finished = True
    return log.finish("explored: all")


def read_summary(out: Path) -> dict[str, object]:
    return json.loads((out / "summary.json").read_text())


def test_truth_and_contacts_end_with_the_run(tmp_path: Path) -> None:
    finished_at_2(tmp_path, judged=True)
    truth = np.loadtxt(tmp_path / "trajectory_truth.txt")
    np.testing.assert_allclose(truth[:, 0], np.arange(1.0, 2.01, 0.05))
    np.testing.assert_allclose(truth[:, 1], truth[:, 0])
    assert (tmp_path / "contacts.csv").read_text().splitlines()[-1].startswith("2.000,deck,")


@pytest.mark.parametrize("judged", [True, False])
def test_time_ends_with_the_run(tmp_path: Path, judged: bool) -> None:
    finished_at_2(tmp_path, judged=judged)
    summary = read_summary(tmp_path)
    assert (summary["sim_time_s"], summary["stop_reason"]) == (1.0, "explored: all")


def test_sweeps_are_those_that_were_mapped_since_the_run_began(tmp_path: Path) -> None:
    stamps = 0.5, 2.0, 2.5, 3.0, 3.5  # the first is of a run before, that this one went on from
    (tmp_path / "trajectory.txt").write_text("".join(f"{t} 0 0 0 0 0 0 1\n" for t in stamps))
    finished_at_2(tmp_path, judged=False)  # with three sweeps, by what was told until then
    assert read_summary(tmp_path)["sweeps"] == 4


def test_sweeps_of_a_robot_that_only_localises_are_those_that_were_told_of(tmp_path: Path) -> None:
    log = RunLog(tmp_path, {"mapping": "off"}, RobotBody(), judged=False)
    log.event(RunEvent(header(2.0, "odom"), "finished", "stopped", 3, False, "", 0.0, False, 0.0))
    log.finish("stopped")
    assert read_summary(tmp_path)["sweeps"] == 3


def test_sweeps_of_a_run_that_mapped_nothing_are_not_known(tmp_path: Path) -> None:
    finished_at_2(tmp_path, judged=False)
    assert read_summary(tmp_path)["sweeps"] is None


def test_run_that_ended_before_there_was_a_world_is_no_success(tmp_path: Path) -> None:
    assert finished_at_2(tmp_path, judged=True).startswith("ended before it began")
    summary = read_summary(tmp_path)
    assert (summary["world"], summary["seed"], summary["success"]) == ("rooms", 4, False)


def test_what_was_written_of_a_run_is_on_disk_line_by_line(tmp_path: Path) -> None:
    log = RunLog(tmp_path, {}, RobotBody(), judged=True)
    for stamp_s in (1.0, 1.05):
        log.truth(stamp_s, transform_from_rpy((stamp_s, 0.0, 0.0)))
        log.contact(Contact(header(stamp_s, "world"), "deck", 0.1, 5.0, ""))
    assert (tmp_path / "trajectory_truth.txt").read_text().count("\n") == 2
    assert (tmp_path / "contacts.csv").read_text().splitlines()[-1].startswith("1.050,deck,")


def test_run_that_goes_on_keeps_what_was_touched_before(tmp_path: Path) -> None:
    resumed = {"exploration_monitor_node": {"resume": True}}
    for parameters, touches in (({}, 1), (resumed, 2), ({}, 1)):
        log = RunLog(tmp_path, parameters, RobotBody(), judged=True)
        log.contact(Contact(header(1.0, "world"), "deck", 0.1, 5.0, ""))
        lines = (tmp_path / "contacts.csv").read_text().splitlines()
        assert lines == ["stamp,link,speed_mps,force_n,other", *["1.000,deck,0.1000,5.00,"] * touches]


def test_run_that_is_not_to_be_judged_leaves_its_reason_and_no_summary(tmp_path: Path) -> None:
    log = RunLog(tmp_path, {}, RobotBody(), judged=True)
    assert log.finish("interrupted", judge=False) == "ended: interrupted"
    assert json.loads((tmp_path / "counters.json").read_text())["stop_reason"] == "interrupted"
    assert not (tmp_path / "summary.json").exists()


def test_robot_that_drove_is_saved_with_the_results(tmp_path: Path) -> None:
    finished_at_2(tmp_path, judged=True)
    assert load_robot(tmp_path / "robot.yaml") == RobotBody()
    assert (tmp_path / DESCRIPTION).read_text() == "<robot/>"
    assert robot_from_mapping(read_summary(tmp_path)["config"]["robot"]) == RobotBody()


def test_real_robot_tells_what_it_knows_and_of_no_simulated_world(tmp_path: Path) -> None:
    told = finished_at_2(tmp_path, judged=False)
    assert told.startswith("SUCCESS  explored: all")
    assert "coverage" not in told and "1.0 m in 0:01 min of ROS time" in told
    summary = read_summary(tmp_path)
    assert (summary["distance_m"], summary["success"]) == (1.0, True)
    assert not {"world", "seed", "coverage"} & set(summary)
    assert not (tmp_path / "trajectory_truth.txt").exists() and not (tmp_path / "contacts.csv").exists()


@pytest.mark.parametrize(("to_x", "set_aside", "success"), [(0.5, 12, False), (0.5, 0, True), (1.5, 12, True)])
def test_real_robot_that_set_all_aside_without_leaving_its_start_has_not_explored(
    tmp_path: Path, to_x: float, set_aside: int, success: bool
) -> None:
    log = RunLog(tmp_path, {}, RobotBody(), judged=False)
    for x in (0.0, to_x):
        log.odometry(odometry(1.0 + x, x))
    log.decision(ExplorationDecision(kind="explored", set_aside_frontiers=set_aside))
    told = log.finish("explored: no reachable frontier is left in the whole map; 12 set aside")
    assert read_summary(tmp_path)["success"] is success
    assert ("never left its start" in told) is not success


def test_run_keeps_the_calibration_that_its_nodes_applied(tmp_path: Path) -> None:
    for name, calibration in (("off", TiltCalibration(offset_rad=0.01)), ("described", TiltCalibration()), ("none", None)):
        (tmp_path / name).mkdir()
        (tmp_path / name / RECORDED_FILE).write_text("of an earlier run")
        RunLog(tmp_path / name, {}, RobotBody(), calibration, judged=False)
    assert read_calibration(tmp_path / "off" / RECORDED_FILE).offset_rad == 0.01
    assert not (tmp_path / "described" / RECORDED_FILE).exists() and not (tmp_path / "none" / RECORDED_FILE).exists()


def test_run_without_a_folder_only_keeps_its_status() -> None:
    log = RunLog(None, {}, RobotBody(), judged=False)
    log.odometry(odometry(1.0, 0.0))
    log.odometry(odometry(3.0, 2.0))
    assert log.status_line().startswith("t=2.0 s")
    assert log.finish("stopped") == "ended: stopped"


def test_clock_that_is_set_anew_does_not_count_as_time_driven(tmp_path: Path) -> None:
    log = RunLog(tmp_path, {"robot_description": "<robot/>"}, RobotBody(), judged=False)
    for stamp_s in (1.0, 1.05, 1e9, 1e9 + 0.05, 50.0, 50.05):
        log.odometry(odometry(stamp_s, 0.0))
    assert log.sim_time_s == pytest.approx(0.15, abs=1e-6)


def test_odometry_that_begins_anew_when_the_clock_is_set_back_has_driven_no_way_there(tmp_path: Path) -> None:
    log = RunLog(tmp_path, {"robot_description": "<robot/>"}, RobotBody(), judged=False)
    for stamp_s, x in ((100.0, 9.0), (100.1, 9.5), (98.0, 0.0), (98.1, 0.5)):
        log.odometry(odometry(stamp_s, x))
    log.finish("stopped")
    assert read_summary(tmp_path)["distance_m"] == 1.0


def test_parameters_that_change_are_in_the_run_s_description_with_the_time(tmp_path: Path) -> None:
    log = RunLog(tmp_path, {}, RobotBody(), judged=False)
    log.parameters_of("move_base_node", {"follower_max_speed_mps": 0.5, "monitor_margin_m": 0.1})
    assert json.loads((tmp_path / "run.json").read_text())["parameter_changes"] == []
    log.odometry(odometry(12.5, 0.0))
    log.parameters_of("move_base_node", {"follower_max_speed_mps": 0.3, "monitor_margin_m": 0.1})
    told = {"stamp_s": 12.5, "node": "move_base_node", "parameter": "follower_max_speed_mps", "before": 0.5, "value": 0.3}
    assert json.loads((tmp_path / "run.json").read_text())["parameter_changes"] == [told]
    log.finish("explored: all")
    assert read_summary(tmp_path)["parameter_changes"] == [told]


def test_log_that_goes_on_after_its_process_died_is_one_log(tmp_path: Path) -> None:
    def event(stamp_s: float, state: str) -> RunEvent:
        return RunEvent(header(stamp_s, "odom"), state, "", 3, False, "", 0.0, False, 0.0)

    def hear(log: RunLog, *ticks: int) -> None:
        for tick in ticks:
            log.truth(0.05 * tick, transform_from_rpy((0.05 * tick, 0.0, 0.0)))
            log.contact(Contact(header(0.05 * tick, "world"), "deck", 0.1, 5.0, ""))
            log.odometry(odometry(0.05 * tick, 0.05 * tick))

    first = RunLog(tmp_path, {}, RobotBody(), judged=True)
    first.event(event(1.0, "driving"))
    first.decision(ExplorationDecision(kind="goal", set_aside_frontiers=2))
    hear(first, *range(20, 40))
    second = RunLog(tmp_path, {}, RobotBody(), judged=True, memory=pickle.loads(pickle.dumps(first.memory())))
    second.event(event(1.0, "driving"))  # latched, and so heard again
    hear(second, *range(40, 60))
    second.event(event(3.0, "finished"))
    second.finish("explored: all", restarts={"exploration_monitor_node": 1})
    counters = json.loads((tmp_path / "counters.json").read_text())
    assert counters["sim_time_s"] == pytest.approx(1.95) and counters["set_aside_frontiers"] == 2
    assert counters["restarts"] == {"exploration_monitor_node": 1}
    assert len(np.loadtxt(tmp_path / "trajectory_truth.txt")) == 40
    assert (tmp_path / "contacts.csv").read_text().count("\n") == 41
    assert [line.split(",")[2] for line in (tmp_path / "events.csv").read_text().splitlines()] == ["state", "driving", "finished"]


def test_disk_that_takes_nothing_ends_no_log_and_no_success_comes_of_it(tmp_path: Path) -> None:
    """As on a full disk, by /dev/full."""
    for name in ("trajectory_truth.txt", "events.csv"):
        (tmp_path / name).symlink_to("/dev/full")
    told = finished_at_2(tmp_path, judged=False)
    assert told.startswith("FAILED") and f"not on disk: {tmp_path / 'events.csv'}: the disk /" in told
    summary = read_summary(tmp_path)
    assert summary["success"] is False and summary["faults"] == ["not on disk"]
    assert "is full: make room there" in str(summary["not_on_disk"])


def test_folder_that_became_read_only_is_told_and_not_judged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: Path, **_: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))

    monkeypatch.setattr(run_log, "write_json", refuse)
    monkeypatch.setattr(ending, "write_json", lambda path, _: refuse(path))
    told = finished_at_2(tmp_path, judged=True)
    assert told.startswith(f"not judged: {tmp_path / 'summary.json'}: the disk /") and "is read-only: mount it for writing" in told
    assert f"python -m exploration_evaluation {tmp_path}" in told


def test_what_a_node_could_not_save_speaks_against_a_run(tmp_path: Path) -> None:
    log = RunLog(tmp_path, {}, RobotBody(), judged=False)
    log.finish("explored: all", not_saved=["octomap_server_3dnav_node: map not saved: it is full"])
    assert read_summary(tmp_path)["faults"] == ["not on disk"]


@pytest.mark.parametrize(("namespace", "own", "other"), [("/", "", "left/"), ("/left/", "left/", "right/"), ("/left/", "left/", "")])
def test_counts_are_those_of_the_robot_s_own_nodes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, namespace: str, own: str, other: str
) -> None:
    monkeypatch.setattr("rospy.names._caller_id", f"{namespace}exploration_monitor_node")
    log = RunLog(tmp_path, {}, RobotBody(), judged=False)
    for prefix, closures in ((own, "3"), (other, "7")):
        status = DiagnosticStatus(name=f"{prefix}pose_graph_mapping_node", values=[KeyValue("loop closures", closures)])
        log.diagnostics(DiagnosticArray(status=[status]))
    log.finish("explored: all")
    assert read_summary(tmp_path)["loop_closures"] == 3
