"""Scores against closed forms: maps with a known hole, trajectories with a known error, contacts with known pauses."""

import math

import numpy as np
import pytest
from hand_made_worlds import plate, room

from exploration_evaluation import (
    align_poses,
    contact_episodes,
    coverage,
    covered_cells,
    divided_voxels,
    map_error,
    motion,
    reachable_ground,
    trajectory_errors,
)
from rigid_geometry import rotation_angle, transform_from_rpy, transform_points


def mapped_floor(width=4.0, depth=4.0, size=0.1, z=0.02):
    """Occupied voxels under the whole floor, in the middle of the truth's cells."""
    x, y = np.meshgrid(np.arange(size / 2, width, size), np.arange(size / 2, depth, size), indexing="ij")
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z)])


def without_plate(voxels, low, high):
    inside = (voxels[:, 0] > low) & (voxels[:, 0] < high) & (voxels[:, 1] > low) & (voxels[:, 1] < high)
    return voxels[~inside]


def test_map_of_the_whole_floor_covers_everything():
    assert coverage(reachable_ground(*room(), (2, 2, 0.1)).points, mapped_floor()) == 1.0


def test_missing_square_metre_costs_its_cells_without_the_tolerance_s_rim():
    ground = reachable_ground(*room(), (2, 2, 0.1)).points
    holed = without_plate(mapped_floor(), 1.5, 2.5)
    # 10 x 10 cells are not mapped; the outer ring has a mapped neighbour at 0.1 m (tolerance 0.12 m), 8 x 8 have none.
    assert coverage(ground, holed, 0.12, 0.15) == pytest.approx(1 - 64 / 784)
    assert coverage(ground, holed, 0.05, 0.15) == pytest.approx(1 - 100 / 784)


@pytest.mark.parametrize(("z", "expected"), [(0.09, 1.0), (-0.09, 1.0), (-0.14, 0.0), (0.2, 0.0)])
def test_floor_mapped_at_a_wrong_height_covers_only_within_the_tolerance(z, expected):
    assert coverage(reachable_ground(*room(), (2, 2, 0.1)).points, mapped_floor(z=z)) == expected


def test_raised_plate_of_one_square_metre_is_not_covered():
    floor = mapped_floor()
    plate_at = (abs(floor[:, 0] - 2) < 0.5) & (abs(floor[:, 1] - 2) < 0.5)
    floor[plate_at, 2] += 0.3
    assert coverage(reachable_ground(*room(), (2, 2, 0.1)).points, floor) == pytest.approx(1 - 64 / 784)


def test_empty_map_covers_nothing_and_no_ground_has_no_coverage():
    assert not covered_cells(np.zeros((3, 3)), np.empty((0, 3))).any()
    with pytest.raises(ValueError, match="at least one cell"):
        coverage(np.empty((0, 3)), mapped_floor())


def test_coverage_agrees_with_brute_force():
    rng = np.random.default_rng(5)
    cells, voxels = rng.uniform(0, 2, (300, 3)), rng.uniform(0, 2, (400, 3))
    away = np.abs(cells[:, None] - voxels[None])
    near = (away <= [0.12, 0.12, 0.10]).all(axis=2).any(axis=1)
    np.testing.assert_array_equal(covered_cells(cells, voxels), near)


def test_divided_voxels_fill_the_pruned_cube():
    parts = divided_voxels([[0.16, 0.16, 0.16], [1.0, 1.0, 1.0]], [0.32, 0.08], 0.08)
    assert len(parts) == 4**3 + 1
    np.testing.assert_allclose(parts[1:].min(axis=0), [0.04] * 3)
    np.testing.assert_allclose(parts[1:].max(axis=0), [0.28] * 3)
    np.testing.assert_allclose(parts[0], 1.0)  # smaller ones first


def test_map_error_is_the_distance_to_the_surface():
    cloud = mapped_floor(z=0.0)
    cloud[:, 2] = np.where(np.arange(len(cloud)) % 2, 0.03, -0.01)
    error = map_error(cloud, *plate(0, 0, 4, 4))
    assert error.rms_m == pytest.approx(math.sqrt((0.03**2 + 0.01**2) / 2), rel=1e-4)
    assert error.p95_m == pytest.approx(0.03, rel=1e-4)


def test_map_error_of_a_shifted_wall_is_its_shift():
    y, z = np.meshgrid(np.linspace(0.2, 3.8, 30), np.linspace(0.3, 1.8, 20))
    wall_points = np.column_stack([np.full(y.size, 4.05), y.ravel(), z.ravel()])
    assert map_error(wall_points, *room()).rms_m == pytest.approx(0.05, rel=1e-4)


def test_large_cloud_is_thinned_evenly():
    cloud = np.tile([[1.0, 1.0, 9.0]], (9, 1))
    cloud[[0, 4, 8], 2] = 0.1
    assert map_error(cloud, *plate(0, 0, 4, 4), max_points=3).rms_m == pytest.approx(0.1, rel=1e-5)


def poses_at(positions, yaws=None):
    yaws = np.zeros(len(positions)) if yaws is None else yaws
    return np.stack([transform_from_rpy(p, (0, 0, yaw)) for p, yaw in zip(positions, yaws, strict=True)])


SQUARE = np.array([[1.0, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
STAMPS = np.array([1.0, 2.0, 3.0, 4.0])


def test_ate_of_a_warped_square_is_its_warp():
    d = 0.04  # corners up, down, up, down: no plane fits better than the square's own
    estimate = SQUARE + np.outer([1, -1, 1, -1], [0, 0, d])
    errors = trajectory_errors(STAMPS, poses_at(estimate), STAMPS, poses_at(SQUARE))
    assert errors.ate_rms_m == pytest.approx(d)
    # From the first pose, which is d too high, the others lie 2d, 0, 2d off.
    assert errors.origin_rms_m == pytest.approx(math.sqrt((0 + 4 + 0 + 4) / 4) * d)


def test_ate_of_a_line_driven_too_far_is_the_spread_about_the_mean():
    line = np.column_stack([np.arange(4.0), np.zeros(4), np.zeros(4)])
    errors = trajectory_errors(STAMPS, poses_at(line * [1.1, 1, 1]), STAMPS, poses_at(line))
    assert errors.ate_rms_m == pytest.approx(0.1 * math.sqrt(1.25))  # standard deviation of 0, 1, 2, 3
    assert errors.map_tilt_rad == pytest.approx(0.0, abs=1e-6)


def random_run(seed=3, count=20):
    rng = np.random.default_rng(seed)
    truth = np.stack([transform_from_rpy(rng.uniform(-5, 5, 3), tuple(rng.uniform(-0.3, 0.3, 3))) for _ in range(count)])
    noise = np.stack([transform_from_rpy(rng.normal(0, 0.05, 3), tuple(rng.normal(0, 0.01, 3))) for _ in range(count)])
    return np.arange(count) * 0.5, truth, truth @ noise


def test_rigid_motion_of_the_map_changes_no_error():
    stamps, truth, estimate = random_run()
    T = transform_from_rpy((3.0, -8.0, 1.0), (0.05, -0.1, 2.0))
    here, there = (trajectory_errors(stamps, e, stamps, truth) for e in (estimate, T @ estimate))
    assert there.ate_rms_m == pytest.approx(here.ate_rms_m)
    assert there.origin_rms_m == pytest.approx(here.origin_rms_m)
    np.testing.assert_allclose(there.T_world_map @ T, here.T_world_map, atol=1e-9)


def test_ate_is_the_least_over_all_alignments():
    stamps, truth, estimate = random_run()
    best = trajectory_errors(stamps, estimate, stamps, truth)
    rng = np.random.default_rng(9)
    for _ in range(50):
        T = best.T_world_map @ transform_from_rpy(rng.normal(0, 0.02, 3), tuple(rng.normal(0, 0.005, 3)))
        rms = np.sqrt(np.mean(np.sum((transform_points(T, estimate[:, :3, 3]) - truth[:, :3, 3]) ** 2, axis=1)))
        assert best.ate_rms_m <= rms + 1e-12


def test_map_of_a_robot_that_started_tilted_is_tilted_by_as_much():
    stamps, truth, _ = random_run()
    T_map_world = transform_from_rpy((1.0, 2.0, 0.0), (0.0, 0.03, 1.0))
    errors = trajectory_errors(stamps, T_map_world @ truth, stamps, truth)
    assert errors.map_tilt_rad == pytest.approx(0.03)
    assert errors.map_tilt_origin_rad == pytest.approx(0.03)
    assert errors.ate_rms_m == pytest.approx(0.0, abs=1e-9)


def test_single_pose_aligns_the_map():
    pose = transform_from_rpy((4.0, 5.0, 6.0), (0.1, 0.2, 0.3))
    T = align_poses(np.eye(4)[None], pose[None])
    np.testing.assert_allclose(T, pose, atol=1e-12)


def test_half_turn_about_the_line_of_driving_is_not_left_open():
    line = poses_at(np.column_stack([np.arange(4.0), np.zeros(4), np.zeros(4)]))
    assert rotation_angle(align_poses(line, line)) == pytest.approx(0.0, abs=1e-9)


def test_truth_is_interpolated_and_poses_without_it_are_counted():
    truth = poses_at([[0.0, 0, 0], [1, 0, 0]])
    errors = trajectory_errors([0.5, 9.0], poses_at([[0.5, 0, 0], [9.0, 0, 0]]), [0.0, 1.0], truth)
    assert errors.unmatched == 1
    assert errors.T_world_map[0, 3] == pytest.approx(0.0)
    with pytest.raises(ValueError, match="lies within"):
        trajectory_errors([9.0], truth[:1], [0.0, 1.0], truth)


def test_contacts_belong_together_until_a_pause_of_more_than_a_second():
    stamps = [5.0, 5.05, 6.0, 7.05, 20.0]
    episodes = contact_episodes(stamps, [0.1, 0.4, 0.0, 0.2, 0.3], [9, 5, 1, 2, 7], 1.0)
    assert [(e.top_speed_mps, e.top_force_n) for e in episodes] == [(0.4, 9.0), (0.2, 2.0), (0.3, 7.0)]


def test_no_contact_is_no_episode_and_order_in_the_file_does_not_matter():
    assert contact_episodes([], [], [], 1.0) == ()
    assert len(contact_episodes([9.0, 1.0, 1.5], [0, 0, 0], [0, 0, 0], 1.0)) == 2


def circle_drive(tremble=0.0):
    stamps = np.arange(1.0, 21.0, 0.05)
    angle = np.clip(stamps - 1.0, 0, 10) * 0.25
    positions = np.column_stack([2 * np.cos(angle), 2 * np.sin(angle), np.zeros(len(angle))])
    positions += np.random.default_rng(1).normal(0, tremble, positions.shape)
    return stamps, poses_at(positions, angle + math.pi / 2)


@pytest.mark.parametrize("tremble", [0.0, 0.0001])
def test_distance_follows_the_arc_and_not_the_tremble(tremble):
    assert motion(*circle_drive(tremble)).distance_m == pytest.approx(5.0, rel=0.002)


def test_tilt_beyond_the_limit_is_a_fall():
    stamps, poses = circle_drive()
    poses[200] = transform_from_rpy(poses[200, :3, 3], (0.5, 0, 0))
    assert motion(stamps, poses).max_tilt_rad == pytest.approx(0.5)
    assert not motion(stamps, poses).fell
    poses[200] = transform_from_rpy(poses[200, :3, 3], (0, 1.0, 0))
    assert motion(stamps, poses).fell


def test_drop_is_a_fall_and_driving_down_a_ramp_is_none():
    stamps = np.arange(1.0, 3.0, 0.05)
    ramp_down = poses_at(np.column_stack([stamps, 0 * stamps, -0.35 * stamps]))
    drop = poses_at(np.column_stack([0 * stamps, 0 * stamps, -0.5 * 9.81 * np.clip(stamps - 2, 0, 0.3) ** 2]))
    assert not motion(stamps, ramp_down).fell
    assert motion(stamps, drop).fell


@pytest.mark.parametrize("bad", [np.zeros((3, 2)), np.full((2, 3), np.nan)])
def test_points_of_a_wrong_shape_or_not_finite_are_refused(bad):
    with pytest.raises(ValueError, match="finite points"):
        coverage(bad, np.zeros((1, 3)))
    with pytest.raises(ValueError, match="finite points"):
        map_error(bad, *room())


def test_poses_and_stamps_must_agree():
    with pytest.raises(ValueError, match="stamp"):
        trajectory_errors([1.0], poses_at(SQUARE), STAMPS, poses_at(SQUARE))
    with pytest.raises(ValueError, match="N, 4, 4"):
        motion(STAMPS, np.zeros((4, 3)))
