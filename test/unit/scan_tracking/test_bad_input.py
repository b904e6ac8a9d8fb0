"""Odometry that jumps, time that goes back, tilts that do not come, maps without normals: told, counted, and never a pose that is NaN."""

import numpy as np
import pytest
from drive_in_a_box import ROOM, Drive, Pose, ahead, tracker_in, walls

from rigid_geometry import inverse, rotation_angle, transform_from_rpy
from scan_tracking import ScanTracker, ScanTrackingConfig
from sweep_assembly import LaserScans


def test_a_jump_of_the_odometry_is_counted_and_the_tracked_pose_goes_on() -> None:
    def jumping(t: float) -> np.ndarray:
        return np.eye(4) if t < 1.0 else transform_from_rpy((2.0, 1.0, 0.0), (0.0, 0.0, 0.7))

    tracker = tracker_in(ROOM)
    drive = Drive(slip=jumping, end_s=3.0)
    poses = drive.into(tracker)
    assert tracker.counts["odometry_jump"] == 1
    steps = [np.linalg.norm(b.T_odom_base[:3, 3] - a.T_odom_base[:3, 3]) for a, b in zip(poses, poses[1:], strict=False)]
    assert max(steps) < 0.08
    after = next(pose for pose in poses if pose.stamp_s >= 1.0)
    assert after.refused == "odometry jumped" and np.sqrt(after.covariance[0, 0]) > 0.1
    assert np.linalg.norm(poses[-1].T_odom_base[:3, 3] - drive.pose(3.0)[:3, 3]) < 0.03 and poses[-1].refused == ""


@pytest.mark.parametrize("way", [np.eye(4), transform_from_rpy((0.5, 0.0, 0.0)), transform_from_rpy((0.0, 0.0, 0.0), (0.0, 0.0, 0.5236))])
@pytest.mark.parametrize("lost", [(), (1.0,), (1.0, 1.05)], ids=["no message lost", "one lost", "two lost"])
def test_odometry_that_jumps_between_two_messages_leaves_the_tracked_pose_on_its_way(way: np.ndarray, lost: tuple[float, ...]) -> None:
    tracker = tracker_in(ROOM)
    drive = Drive(slip=lambda t: np.eye(4) if t < 1.0 else way, end_s=2.0)
    poses = drive.into(tracker, without=lost)
    assert tracker.counts.get("odometry_jump", 0) == (not np.allclose(way, np.eye(4)))
    off = [inverse(drive.pose(pose.stamp_s)) @ pose.T_odom_base for pose in poses]
    assert max(np.linalg.norm(T[:3, 3]) for T in off) < 0.03 + 0.025 * len(lost) and max(rotation_angle(T) for T in off) < 0.02
    assert np.linalg.norm(off[-1][:3, 3]) < 0.01 and poses[-1].refused == "" and np.sqrt(poses[-1].covariance[0, 0]) < 0.02


def test_robot_that_stands_after_a_jump_looks_for_its_place_until_it_has_it() -> None:
    def halts(t: float) -> np.ndarray:
        return ahead(min(t, 1.0))

    def jumps(t: float) -> np.ndarray:
        return np.eye(4) if t < 1.0 else transform_from_rpy((0.5, 0.2, 0.0))

    tracker = tracker_in(ROOM)
    poses = Drive(pose=halts, slip=jumps, end_s=2.0).into(tracker)
    sigmas_m = [np.sqrt(pose.covariance[0, 0]) for pose in poses]
    assert max(sigmas_m) > 0.1 and sigmas_m[-1] < 0.03
    assert np.linalg.norm(poses[-1].T_odom_base[:3, 3] - halts(2.0)[:3, 3]) < 0.01


def test_a_map_that_lies_elsewhere_is_refused_and_odometry_stands_with_a_covariance_that_grows() -> None:
    tracker = tracker_in(None, start_sigma_m=0.002, start_sigma_rad=0.002, reach_m=0.5, gate_sigmas=100.0)
    points, normals = walls(ROOM)
    tracker.set_map(points + [0.25, 0.25, 0.2], normals, np.eye(4))
    poses = Drive(end_s=0.8).into(tracker)
    refused = [pose for pose in poses if pose.refused]
    assert tracker.counts["bundle_refused"] > 4 and "bundle_matched" not in tracker.counts
    assert all("sigmas of odometry" in pose.refused for pose in refused)
    assert all(np.array_equal(pose.T_odom_base, ahead(pose.stamp_s)) for pose in poses)
    assert refused[-1].covariance[1, 1] > 1.2 * refused[0].covariance[1, 1]


def displaced_at_one(tracker: ScanTracker, pose: Pose) -> list:
    """A drive in which odometry at 1 s says that it knows nothing of the way to there."""
    before = Drive(pose=pose, end_s=1.0).into(tracker, without=(1.0,))
    tracker.add_odometry(1.0, pose(1.0), displaced=True)
    return [*before, *Drive(pose=pose, end_s=1.6).into(tracker, begin_s=1.025)]


def test_robot_that_was_displaced_is_anywhere_and_is_not_matched_until_a_sweep_tells_where_it_is() -> None:
    tracker = tracker_in(ROOM)
    poses = displaced_at_one(tracker, ahead)
    matched = tracker.counts["bundle_matched"]
    assert all(np.sqrt(pose.covariance[1, 1]) < 0.1 for pose in poses if pose.stamp_s < 0.9)
    lost = [pose for pose in poses if pose.stamp_s >= 1.0]
    assert all(np.sqrt(pose.covariance[1, 1]) > 4.0 and "moved" in pose.refused for pose in lost)
    assert np.abs(lost[-1].T_odom_base - ahead(1.6)).max() < 0.02
    tracker.set_map(*walls(ROOM), np.eye(4))
    Drive(end_s=2.0).into(tracker, begin_s=1.625)
    assert tracker.counts["bundle_matched"] == matched
    tracker.set_map(*walls(ROOM), np.eye(4), 1e-4 * np.eye(6), 2.0)
    found = Drive(end_s=2.6).into(tracker, begin_s=2.025)[-1]
    assert tracker.counts["bundle_matched"] > matched and found.refused == "" and np.sqrt(found.covariance[1, 1]) < 0.02


def test_sweep_that_ended_before_the_robot_was_displaced_does_not_place_it() -> None:
    tracker = tracker_in(ROOM)
    displaced_at_one(tracker, ahead)
    tracker.set_map(*walls(ROOM), np.eye(4), 1e-4 * np.eye(6), 0.9)
    assert np.sqrt(Drive(end_s=2.0).into(tracker, begin_s=1.625)[-1].covariance[1, 1]) > 4.0


def test_robot_that_the_map_contradicts_for_a_second_of_driving_says_that_it_is_lost() -> None:
    tracker = tracker_in(None, start_sigma_m=0.002, start_sigma_rad=0.002, reach_m=0.5, gate_sigmas=100.0)
    points, normals = walls(ROOM)
    tracker.set_map(points + [0.25, 0.25, 0.2], normals, np.eye(4))
    poses = Drive(end_s=2.0).into(tracker)
    lost = [pose for pose in poses if pose.covariance[1, 1] > 4.0]
    assert tracker.counts["lost"] == 1 and lost[-1] is poses[-1] and 0.9 < lost[0].stamp_s < 1.6


def test_time_that_goes_back_starts_afresh_at_the_tracked_pose() -> None:
    tracker = tracker_in(ROOM)
    before = Drive(end_s=2.0).into(tracker)[-1]
    again = Drive(end_s=1.5).into(tracker)
    assert tracker.counts["time_jump"] > 0
    assert np.linalg.norm(again[-1].T_odom_base[:3, 3] - before.T_odom_base[:3, 3]) < 1.0
    assert all(np.isfinite(pose.T_odom_base).all() for pose in again) and len(again) > 25


@pytest.mark.parametrize("bad", [np.full((4, 4), np.nan), np.zeros((4, 4)), np.eye(3)])
def test_odometry_that_is_no_pose_is_dropped(bad) -> None:
    tracker = tracker_in(ROOM)
    tracker.add_odometry(1.0, bad)
    tracker.add_odometry(float("nan"), np.eye(4))
    tracker.add_tilt(1.0, float("nan"))
    tracker.add_scan(float("nan"), Drive().scan(0.0))
    assert tracker.advance(2.0) == []
    assert tracker.counts == {"odometry_not_rigid": 1, "odometry_not_finite": 1, "tilt_not_finite": 1, "scan_not_finite": 1}


def test_scans_without_tilts_are_refused_and_odometry_stands() -> None:
    tracker, drive = tracker_in(ROOM), Drive()
    poses = []
    for k in range(60):
        tracker.add_odometry(k * 0.05, drive.odometry(k * 0.05))
        for j in range(2):
            tracker.add_scan(k * 0.05 + j * 0.025, drive.scan(k * 0.05 + j * 0.025))
        poses += tracker.advance(k * 0.05)
    assert len(poses) == 60 and poses[-1].refused == "no tilt of the mount"
    assert np.array_equal(poses[-1].T_odom_base, drive.odometry(59 * 0.05))


def test_poses_come_when_scans_do_not() -> None:
    tracker, drive = tracker_in(ROOM), Drive()
    poses = []
    for k in range(40):
        tracker.add_odometry(k * 0.05, drive.odometry(k * 0.05))
        tracker.add_tilt(k * 0.05, 0.0)
        poses += tracker.advance(k * 0.05)
    assert len(poses) == 40 and poses[-1].refused == ""
    assert poses[-1].covariance[0, 0] > 1.2 * poses[0].covariance[0, 0]


def test_late_and_doubled_samples_are_dropped() -> None:
    tracker = tracker_in(None)
    for stamp in (1.0, 1.05, 1.05, 1.02):
        tracker.add_odometry(stamp, np.eye(4))
    assert tracker.counts == {"odometry_late": 2} and len(tracker.advance(2.0)) == 2


@pytest.mark.parametrize(
    ("points", "normals", "said"),
    [
        (np.zeros((5, 3)), np.zeros((5, 3)), "none of 5 points of a map has a normal"),
        (np.zeros((5, 3)), np.zeros((4, 3)), r"not \(5, 3\) and \(4, 3\)"),
        (np.full((5, 3), np.nan), np.tile([0.0, 0.0, 1.0], (5, 1)), "5 of 5 points of a map"),
        (np.zeros((5, 3)), np.tile([0.0, 0.0, 2.0], (5, 1)), "5 of 5 normals of a map are not of length one"),
    ],
)
def test_a_map_that_is_none_is_told_and_the_old_one_stays(points, normals, said) -> None:
    tracker = tracker_in(ROOM)
    with pytest.raises(ValueError, match=said):
        tracker.set_map(points, normals, np.eye(4))
    with pytest.raises(ValueError, match="rigid"):
        tracker.set_map(*walls(ROOM), 2.0 * np.eye(4))
    Drive(end_s=1.0).into(tracker)
    assert tracker.counts["bundle_matched"] > 5


def test_a_configuration_that_is_wrong_is_told_whole() -> None:
    with pytest.raises(ValueError, match=r"cell_m.*; min_range_m"):
        ScanTracker(ScanTrackingConfig(cell_m=-1.0, min_range_m=9.0, max_range_m=3.0), LaserScans(), None)
