"""Odometry that slips is kept on the map, as far as the map tells; where it does not, odometry stands, and its covariance grows."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from drive_in_a_box import CORRIDOR, MOUNT, ROOM, Drive, ahead, bend, level, nod, still, tracker_in, walls

from rigid_geometry import inverse, transform_from_rpy
from scan_tracking import ScanTracker, ScanTrackingConfig
from scan_tracking.local_map import supported
from scan_tracking.pose_error import error_between
from sweep_assembly import LaserScans, LidarConfig, LidarRevolutions, Revolution, Scan


def slipping(t: float) -> np.ndarray:
    return transform_from_rpy((0.03 * t, 0.02 * t, 0.0), (0.0, 0.0, 0.01 * t))


def off_by(T: np.ndarray, truth: np.ndarray) -> tuple[float, float]:
    """Metres and radians."""
    error = error_between(truth, T)
    return float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))


def sigmas(pose) -> np.ndarray:
    return np.sqrt(np.diag(pose.covariance))


def test_pose_is_found_in_a_room_from_a_prior_that_is_off() -> None:
    tracker = ScanTracker(ScanTrackingConfig(start_sigma_m=0.05, start_sigma_rad=0.02), LaserScans(), MOUNT)
    tracker.set_map(*walls(ROOM), transform_from_rpy((0.04, -0.03, 0.03), (0.005, -0.01, 0.015)))
    drive = Drive(pose=bend, end_s=3.0)
    last = drive.into(tracker)[-1]
    T_tracked_map = inverse(transform_from_rpy((0.04, -0.03, 0.03), (0.005, -0.01, 0.015)))
    metres, radians = off_by(last.T_odom_base, T_tracked_map @ drive.pose(last.stamp_s))
    assert metres < 0.004 and radians < 0.002
    assert tracker.counts["bundle_matched"] > 25 and not tracker.counts.get("bundle_refused")


def test_odometry_that_slips_is_held_in_a_room() -> None:
    drive = Drive(slip=slipping, range_sigma_m=0.01, end_s=3.0)
    worst = max(off_by(pose.T_odom_base, drive.pose(pose.stamp_s))[0] for pose in drive.into(tracker_in(ROOM)))
    assert off_by(drive.odometry(3.0), drive.pose(3.0))[0] > 0.1
    assert worst < 0.04


def test_along_a_corridor_the_prior_stands_and_its_covariance_grows_and_across_it_shrinks() -> None:
    drive = Drive(box=CORRIDOR, tilt=level, slip=slipping, range_sigma_m=0.01, end_s=4.0)
    poses = drive.into(tracker_in(CORRIDOR))
    walked = ScanTrackingConfig().ground_walk * np.sqrt(2.0)
    assert sigmas(poses[-1])[0] > 0.95 * walked
    assert poses[-1].T_odom_base[0, 3] == pytest.approx(drive.odometry(4.0)[0, 3], abs=0.005)
    assert sigmas(poses[-1])[1] < 0.012 and abs(poses[-1].T_odom_base[1, 3]) < 0.01
    assert sigmas(poses[-1])[5] < 0.003


def test_errors_of_normals_do_not_hold_the_robot_along_a_corridor() -> None:
    points, normals = walls(CORRIDOR)
    normals = normals + np.random.default_rng(3).normal(0.0, 0.02, normals.shape)
    tracker = tracker_in(None)
    tracker.set_map(points, normals / np.linalg.norm(normals, axis=1, keepdims=True), np.eye(4))
    last = Drive(box=CORRIDOR, tilt=level, slip=slipping, range_sigma_m=0.01, end_s=4.0).into(tracker)[-1]
    assert sigmas(last)[0] > 0.95 * ScanTrackingConfig().ground_walk * np.sqrt(2.0)


def test_far_side_of_a_wall_is_no_partner() -> None:
    points, normals = walls(ROOM)
    tracker = tracker_in(None, own_every_m=0.0)
    tracker.set_map(points, -normals, np.eye(4))
    last = Drive(slip=slipping).into(tracker)[-1]
    assert "have a partner" in last.refused
    assert np.array_equal(last.T_odom_base, Drive(slip=slipping).odometry(2.0))


@pytest.mark.parametrize("tilt", [nod, level])
def test_covariance_is_true_where_map_ranges_and_odometry_err(tilt) -> None:
    found = [nees(seed, tilt) for seed in range(12)]
    assert 0.5 * 3 < np.mean(found) < 2.0 * 3


def nees(seed: int, tilt) -> float:
    """Mean of x, y and yaw over a drive, with patches of the map and the way of the odometry off at random."""
    rng = np.random.default_rng(seed)
    points, normals = walls(ROOM)
    _, patch = np.unique(np.floor(points / 0.5), axis=0, return_inverse=True)
    points = points + normals * rng.normal(0.0, 0.01, patch.max() + 1)[patch.ravel(), None]
    tracker = tracker_in(None, start_sigma_m=0.01, start_sigma_rad=0.003)
    tracker.set_map(points, normals, np.eye(4))
    steps = np.cumsum(rng.normal(0.0, 1.0, (200, 3)), axis=0) * np.sqrt(0.025) * [0.03, 0.03, 0.003]
    start = rng.normal(0.0, 1.0, 3) * [0.01, 0.01, 0.003]

    def walk(t: float) -> np.ndarray:
        x, y, yaw = steps[round(t * 20)] + start
        return transform_from_rpy((x, y, 0.0), (0.0, 0.0, yaw))

    drive = Drive(tilt=tilt, slip=walk, range_sigma_m=0.01, end_s=3.0, seed=seed)
    some = [0, 1, 5]
    values = []
    for pose in drive.into(tracker)[20::4]:
        error = error_between(pose.T_odom_base, drive.pose(pose.stamp_s))[some]
        values.append(error @ np.linalg.solve(pose.covariance[np.ix_(some, some)], error))
    return float(np.mean(values))


def test_without_a_map_odometry_passes_to_the_bit() -> None:
    for box in (None, np.zeros((2, 3))):
        tracker = tracker_in(None)
        if box is not None:
            tracker.set_map(np.zeros((0, 3)), np.zeros((0, 3)), np.eye(4))
        drive = Drive(pose=bend, slip=slipping)
        poses = drive.into(tracker)
        assert poses and all(np.array_equal(pose.T_odom_base, drive.odometry(pose.stamp_s)) and pose.refused == "" for pose in poses)


def test_surfaces_that_the_map_lacks_are_put_down_and_hold_the_robot_with_a_covariance_that_owns_to_it() -> None:
    points, normals = walls(ROOM)
    known = points[:, 0] < -2.9  # the wall behind, alone
    drive = Drive(tilt=level, slip=slipping, range_sigma_m=0.005, end_s=4.0)
    found = {}
    for every_m in (0.0, 1.0):
        tracker = tracker_in(None, own_every_m=every_m)
        tracker.set_map(points[known], normals[known], np.eye(4))
        found[every_m] = drive.into(tracker)
    alone, with_own = (poses[-1] for poses in found.values())
    assert abs(alone.T_odom_base[1, 3]) > 0.05 and abs(with_own.T_odom_base[1, 3]) < 0.02
    assert sigmas(with_own)[1] < 0.5 * sigmas(alone)[1]
    assert sigmas(with_own)[1] >= sigmas(found[1.0][4])[1]  # never surer than where they were put down


def test_a_robot_that_rocks_as_its_mount_turns_is_not_matched() -> None:
    def rocking(t: float) -> np.ndarray:
        return transform_from_rpy((0.002 * np.sin(9.0 * t), 0.0, 0.0), (0.0, 0.01 * np.sin(9.0 * t), 0.0))

    tracker = tracker_in(ROOM)
    poses = Drive(pose=rocking, range_sigma_m=0.01).into(tracker)
    assert "bundle_matched" not in tracker.counts
    assert off_by(poses[-1].T_odom_base, rocking(2.0))[0] < 0.01


def test_a_robot_that_stands_stays_where_it_was_tracked() -> None:
    tracker = tracker_in(ROOM)
    poses = Drive(pose=still, range_sigma_m=0.01).into(tracker)
    assert "bundle_matched" not in tracker.counts
    assert np.array_equal(poses[0].T_odom_base, poses[-1].T_odom_base)
    assert np.allclose(poses[0].covariance, poses[-1].covariance, rtol=1e-9)


def test_a_robot_that_stopped_where_it_could_not_see_looks_for_its_place_while_it_stands() -> None:
    def halts(t: float) -> np.ndarray:
        return ahead(min(t, 1.0))

    def slid(t: float) -> np.ndarray:
        return transform_from_rpy((0.04 * min(t, 1.0), 0.0, 0.0))

    tracker = tracker_in(None)
    Drive(pose=halts, slip=slid, end_s=1.2).into(tracker)
    tracker.set_map(*walls(ROOM), np.eye(4))
    poses = Drive(pose=halts, slip=slid, end_s=4.0).into(tracker, 1.225)
    assert off_by(poses[-1].T_odom_base, halts(4.0))[0] < 0.01
    assert sigmas(poses[-1])[0] < 0.015
    looked = tracker.counts["bundle_matched"]
    assert 0 < looked < 10  # and no longer: a wall that is seen again and again tells no more


def test_a_robot_that_stands_in_a_corridor_does_not_look_for_ever() -> None:
    def halts(t: float) -> np.ndarray:
        return ahead(min(t, 1.0))

    tracker = tracker_in(CORRIDOR)
    poses = Drive(box=CORRIDOR, pose=halts, end_s=6.0, range_sigma_m=0.01).into(tracker)
    assert tracker.counts["bundle_matched"] < 45  # 10 while it drives
    last = [pose for pose in poses if pose.stamp_s > 5.0]
    assert np.array_equal(last[0].T_odom_base, last[-1].T_odom_base)
    assert sigmas(last[-1])[0] > 0.015 and np.allclose(last[0].covariance, last[-1].covariance, rtol=1e-9)


def test_a_match_that_comes_with_the_map_makes_the_pose_surer_where_it_was_not_left_open() -> None:
    tracker = tracker_in(None)
    Drive(pose=still).into(tracker)
    T_map_odom = transform_from_rpy((5.0, 0.0, 0.0), (0.0, 0.0, np.pi / 2))
    tracker.set_map(*walls(ROOM), T_map_odom, np.diag([1e2, 1e-6, 1e-6, 1e-8, 1e-8, 1e-8]))
    last = Drive(pose=still, end_s=2.5).into(tracker, begin_s=2.025)[-1]
    assert sigmas(last) == pytest.approx([1e-3, ScanTrackingConfig().start_sigma_m, 1e-3, 1e-4, 1e-4, 1e-4], rel=0.01)


def test_the_map_may_move_with_its_frame() -> None:
    tracker = tracker_in(ROOM)
    first = Drive(slip=slipping, end_s=1.0).into(tracker)[-1]
    T = transform_from_rpy((8.0, -3.0, 0.2), (0.0, 0.0, 1.0))
    points, normals = walls(ROOM)
    tracker.set_map(points @ T[:3, :3].T + T[:3, 3], normals @ T[:3, :3].T, T)
    later = Drive(slip=slipping, end_s=2.0).into(tracker, begin_s=1.025)
    assert off_by(later[0].T_odom_base, first.T_odom_base)[0] < 0.04
    assert off_by(later[-1].T_odom_base, ahead(2.0))[0] < 0.03


def test_scans_of_nothing_leave_odometry_alone() -> None:
    far = Drive(box=np.array([[-90.0, -90.0, -90.0], [90.0, 90.0, 90.0]]))
    poses = far.into(tracker_in(ROOM))
    assert np.array_equal(poses[-1].T_odom_base, far.odometry(2.0)) and poses[-1].refused == ""


def test_a_scan_of_another_sensor_is_an_error() -> None:
    with pytest.raises(ValueError, match="a reading of a laser is a Scan"):
        tracker_in(ROOM).add_scan(1.0, "scan")
    assert isinstance(Drive().scan(0.0), Scan)


def test_revolutions_of_a_spinning_lidar_are_tracked_as_well() -> None:
    lidar, drive = LidarConfig(), Drive(box=ROOM, slip=slipping, end_s=2.0)
    tracker = ScanTracker(ScanTrackingConfig(), LidarRevolutions(lidar), MOUNT)
    tracker.set_map(*walls(ROOM), np.eye(4))
    poses = []
    for k in range(41):
        t = 0.05 * k
        tracker.add_tilt(t, 0.4)
        tracker.add_odometry(t, drive.odometry(t))
        if k and k % 2 == 0:
            tracker.add_scan(t - 0.1, revolution(drive, lidar, t - 0.1))
        poses += tracker.advance(t)
    assert tracker.counts["bundle_matched"] > 15
    assert off_by(drive.odometry(2.0), drive.pose(2.0))[0] > 0.07
    assert max(off_by(pose.T_odom_base, drive.pose(pose.stamp_s))[0] for pose in poses) < 0.02


def revolution(drive: Drive, lidar: LidarConfig, stamp_s: float) -> Revolution:
    """One turn of 180 columns through the box, the mount pitched down by 0.4 rad."""
    columns, rings = (a.ravel() for a in np.meshgrid(np.arange(180), np.arange(lidar.rings), indexing="ij"))
    times, azimuths, up = columns / 180 * lidar.duration_s, np.pi - 2 * np.pi * columns / 180, lidar.elevations[rings]
    directions = np.stack([np.cos(up) * np.cos(azimuths), np.cos(up) * np.sin(azimuths), np.sin(up)], axis=1)
    by_column = np.stack([drive.pose(stamp_s + t) for t in np.arange(180) / 180 * lidar.duration_s])
    T = by_column[columns] @ MOUNT.base_from_laser(0.4)[0]
    points = drive.ranges(T, directions)[:, None] * directions
    return Revolution(points.astype(np.float32), rings, times)


def test_normals_that_agree_nowhere_are_no_map() -> None:
    points, normals = walls(ROOM, spacing_m=0.1)
    normals = np.random.default_rng(5).normal(0.0, 1.0, normals.shape)
    tracker = tracker_in(None, own_every_m=0.0)
    tracker.set_map(points[::20], (normals / np.linalg.norm(normals, axis=1, keepdims=True))[::20], np.eye(4))
    last = Drive(slip=slipping).into(tracker)[-1]
    assert "bundle_matched" not in tracker.counts and np.array_equal(last.T_odom_base, Drive(slip=slipping).odometry(2.0))


def test_points_of_a_patch_count_little_more_than_one() -> None:
    first, second = (Drive(range_sigma_m=0.005).into(tracker_in(ROOM, patch_sigma_m=sigma_m))[-1] for sigma_m in (0.0, 0.1))
    assert sigmas(second)[1] > 1.3 * sigmas(first)[1]


def test_a_normal_without_others_like_it_is_of_no_surface() -> None:
    x, y = (side.ravel() for side in np.meshgrid(np.arange(0.05, 0.5, 0.1), np.arange(0.05, 0.5, 0.1)))
    floor = np.column_stack([x, y, np.full(25, 0.1)])
    points = np.vstack([floor, floor[:1] + 0.01, floor[:1] + 0.02])
    normals = np.tile([0.0, 0.0, 1.0], (27, 1))
    normals[25], normals[26] = [0.0, np.sin(0.5), np.cos(0.5)], [1.0, 0.0, 0.0]
    assert supported(points, normals, 0.5, 0.24).tolist() == [True] * 25 + [False, False]


def test_tracker_that_was_kept_and_given_its_map_again_goes_on_as_it_was() -> None:
    drive = Drive(slip=slipping, range_sigma_m=0.01, end_s=3.0)
    whole = drive.into(tracker_in(ROOM))
    tracker = tracker_in(ROOM)
    found = replace(drive, end_s=1.5).into(tracker)
    kept = pickle.loads(pickle.dumps(tracker))
    kept.set_map(*walls(ROOM), np.eye(4))
    found += drive.into(kept, begin_s=1.525)
    assert len(found) == len(whole)
    np.testing.assert_allclose([p.T_odom_base for p in found], [p.T_odom_base for p in whole], atol=1e-12)


def test_kept_tracker_is_small_without_its_map() -> None:
    tracker = tracker_in(ROOM)
    Drive(end_s=1.0).into(tracker)
    assert len(pickle.dumps(tracker)) < 100_000
