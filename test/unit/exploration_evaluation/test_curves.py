"""Coverage after each sweep: rooms swept half by half, and against the coverage of a map made of the same points."""

import numpy as np
import pytest
from hand_made import START, VOXEL_M, WORLD, hand_made_map

from exploration_evaluation import covered_cells, motion, reachable_ground
from exploration_evaluation.curves import CurvePoint, coverage_curve, driven_distances, placed_sweeps, swept_ground
from rigid_geometry import inverse, transform_from_rpy, transform_points


@pytest.fixture(scope="module")
def cells():
    return reachable_ground(*WORLD, START).covered_points


def flat_floor(x0, x1):
    x, y = np.meshgrid(np.arange(x0 + 0.025, x1, 0.05), np.arange(0.025, 4, 0.05))
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 0.001)])


def test_room_swept_half_by_half_is_covered_half_by_half(cells):
    halves = [flat_floor(0, 3), np.empty((0, 3)), flat_floor(3, 6), flat_floor(0, 6)]
    # The tolerance of 0.12 m covers one more row of cells beyond x = 3: 28 cells of the centre's width and 3 at each side.
    first = 0.5 + 34 / len(cells)
    np.testing.assert_allclose(swept_ground(cells, halves, np.eye(4), VOXEL_M).shares, [first, first, 1.0, 1.0])


def test_hand_made_map_swept_in_one_has_its_score_found_on_paper(cells):
    shares = swept_ground(cells, [hand_made_map().voxels + 0.001], np.eye(4), VOXEL_M).shares
    assert shares == pytest.approx([1 - 128 / 1832])


@pytest.mark.parametrize("seed", range(5))
def test_curve_is_the_coverage_of_a_map_of_all_points_until_then(cells, seed):
    rng = np.random.default_rng(seed)
    T_world_map = transform_from_rpy(rng.uniform(-5, 5, 3), (0.03, -0.02, rng.uniform(-3, 3)))
    sweeps = [transform_points(inverse(T_world_map), rng.uniform((-2, -2, -0.4), (8, 6, 0.4), (1500, 3))) for _ in range(5)]
    expected = []
    for k in range(5):
        voxels = np.unique(np.floor(np.vstack(sweeps[: k + 1]) / VOXEL_M), axis=0)
        expected.append(covered_cells(cells, transform_points(T_world_map, (voxels + 0.5) * VOXEL_M)).mean())
    np.testing.assert_allclose(swept_ground(cells, sweeps, T_world_map, VOXEL_M).shares, expected)


def test_sweeps_are_placed_by_their_poses_and_cropped_around_the_robot():
    T = np.stack([transform_from_rpy((10.0, 0, 0)), transform_from_rpy((0, 20.0, 0), (0, 0, np.pi / 2))])
    points = np.array([[1.0, 0, 0], [6.9, -6.9, 3], [7.1, 0, 0], [0, -7.1, 0]])
    first, second = placed_sweeps([points, points], T, 7.0)
    np.testing.assert_allclose(first, [[11, 0, 0], [16.9, -6.9, 3]])
    np.testing.assert_allclose(second, [[0, 21, 0], [6.9, 26.9, 3]], atol=1e-9)
    with pytest.raises(ValueError, match="zip"):
        list(placed_sweeps([points], T, 7.0))


def test_curve_tells_time_since_the_first_true_pose_and_the_way_driven():
    stamps = np.arange(1.0, 21.0, 0.05)
    truth = np.stack([transform_from_rpy((0.5 * min(max(t - 5.0, 0.0), 10.0), 0, 0)) for t in stamps])
    curve = coverage_curve([0.25, 0.5, 0.75], [4.0, 9.0, 30.0], stamps, truth)
    assert curve[0] == CurvePoint(3.0, 0.0, 0.25)
    assert (curve[1].time_s, curve[1].distance_m) == (8.0, pytest.approx(2.0))
    assert curve[2].distance_m == motion(stamps, truth).distance_m


def test_what_makes_no_curve_is_refused(cells):
    pose = np.eye(4)[None]
    with pytest.raises(ValueError, match="at least one cell"):
        swept_ground(np.empty((0, 3)), [], np.eye(4), VOXEL_M)
    with pytest.raises(ValueError, match="no true pose is known before 0.5"):
        driven_distances([1.0], pose, [0.5, 2.0])
    with pytest.raises(ValueError, match="a stamp and a coverage"):
        coverage_curve([0.5], [1.0, 2.0], [1.0], pose)
    assert len(swept_ground(cells, [], np.eye(4), VOXEL_M).shares) == 0
