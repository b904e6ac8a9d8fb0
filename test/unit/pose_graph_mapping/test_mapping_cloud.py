"""Point clouds, voxel means and standpoints against brute force."""

import numpy as np
import pytest

from pose_graph_mapping.registration.cloud import (
    PointCloud,
    farthest,
    merged,
    reference_cloud,
    vertex_cloud,
    viewpoints,
    voxel_downsample,
    with_normals,
    within,
)
from pose_graph_mapping.registration.voxel_grid import first_in_voxels
from rigid_geometry import transform_from_rpy


def brute_force_means(points, voxel_m):
    cells = {}
    for point in points:
        cells.setdefault(tuple(np.floor(point / voxel_m).astype(int)), []).append(point)
    return np.array([np.mean(members, axis=0) for members in cells.values()])


def test_voxel_means_are_those_of_a_dictionary_in_the_same_order():
    points = np.random.default_rng(1).normal(0, 2, (3000, 3))
    np.testing.assert_allclose(voxel_downsample(PointCloud(points), 0.5).points, brute_force_means(points, 0.5), atol=1e-12)


def test_voxel_means_of_voxel_means_are_the_same():
    once = voxel_downsample(PointCloud(np.random.default_rng(2).normal(0, 3, (5000, 3))), 0.2)
    np.testing.assert_allclose(voxel_downsample(once, 0.2).points, once.points, atol=1e-12)


def test_voxel_means_are_bit_identical_when_repeated():
    cloud = PointCloud(np.random.default_rng(3).normal(0, 3, (5000, 3)))
    assert voxel_downsample(cloud, 0.3).points.tobytes() == voxel_downsample(cloud, 0.3).points.tobytes()


def test_first_in_voxels_are_those_of_a_dictionary():
    points = np.random.default_rng(7).normal(0, 2, (3000, 3))
    first: dict[tuple[int, ...], int] = {}
    for k, point in enumerate(points):
        first.setdefault(tuple(np.floor(point / 0.5).astype(int)), k)
    np.testing.assert_array_equal(first_in_voxels(points, 0.5), list(first.values()))


def test_points_in_reach_are_those_of_the_norm():
    points, centre = np.random.default_rng(8).normal(0, 2, (1000, 3)), np.array([0.5, -1.0, 0.3])
    np.testing.assert_array_equal(within(points, centre, 2.0), np.linalg.norm(points - centre, axis=1) <= 2.0)
    assert farthest(points) == pytest.approx(np.linalg.norm(points, axis=1).max())


@pytest.mark.parametrize(("most", "left"), [(100, 100), (99, 50), (30, 25), (1, 1)])
def test_thinned_cloud_holds_at_most_so_many_with_all_that_belongs_to_them(most, left):
    rows = np.arange(300.0).reshape(100, 3)
    thin = PointCloud(rows, rows + 1.0, rows + 2.0).thinned(most)
    assert len(thin) == left
    np.testing.assert_array_equal(thin.origins - thin.points, np.ones((left, 3)))
    np.testing.assert_array_equal(thin.normals - thin.points, np.full((left, 3), 2.0))


def test_normals_point_to_where_the_beam_started():
    xy = np.random.default_rng(4).uniform(-1, 1, (500, 2))
    floor = PointCloud(np.column_stack([xy, np.zeros(500)]), np.tile([0.0, 0.0, -2.0], (500, 1)))
    np.testing.assert_allclose(with_normals(floor, 20).normals, np.tile([0.0, 0.0, -1.0], (500, 1)), atol=1e-6)


def test_transformed_moves_origins_and_turns_normals():
    cloud = PointCloud([[1.0, 0, 0]], [[0.0, 0, 0]], [[-1.0, 0, 0]])
    moved = cloud.transformed(transform_from_rpy((0, 0, 1), (0, 0, np.pi / 2)))
    np.testing.assert_allclose([moved.points[0], moved.origins[0], moved.normals[0]], [[0, 1, 1], [0, 0, 1], [0, -1, 0]], atol=1e-12)


def test_points_that_are_not_finite_are_dropped_and_counted():
    cloud = PointCloud.of_finite([[0, 0, 0], [np.nan, 0, 0], [1, 1, 1]], [[0, 0, 0], [0, 0, 0], [np.inf, 0, 0]])
    assert (len(cloud), cloud.dropped) == (1, 2)


@pytest.mark.parametrize(
    ("points", "origins", "message"),
    [
        ([[0.0, 0.0]], None, "shape"),
        ([[np.nan, 0.0, 0.0], [0, 0, 0]], None, "1 of 2 points are not finite"),
        ([[0.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]] * 2, "2 origins for 1 points"),
    ],
)
def test_bad_clouds_are_refused(points, origins, message):
    with pytest.raises(ValueError, match=message):
        PointCloud(points, origins)


@pytest.mark.parametrize("voxel_m", [0.0, -1.0, float("nan")])
def test_voxels_without_size_are_refused(voxel_m):
    with pytest.raises(ValueError, match="voxel_m"):
        voxel_downsample(PointCloud(np.zeros((1, 3))), voxel_m)


def test_points_beyond_the_grid_are_refused():
    with pytest.raises(ValueError, match="do not fit"):
        voxel_downsample(PointCloud([[1e9, 0, 0]]), 0.1)


def test_merged_keeps_origins_only_when_all_have_them():
    with_origin, without = PointCloud([[0.0, 0, 0]], [[1.0, 0, 0]]), PointCloud([[0.0, 0, 0]])
    assert merged([with_origin, with_origin]).origins.shape == (2, 3)
    assert merged([with_origin, without]).origins is None
    with pytest.raises(ValueError, match="at least one"):
        merged([])


def test_standpoints_of_two_sweeps_are_told_apart():
    rng = np.random.default_rng(5)
    origins = np.concatenate([rng.normal(0, 0.02, (50, 3)), rng.normal(0, 0.02, (50, 3)) + [3, 0, 0]])
    centres, index = viewpoints(origins)
    np.testing.assert_allclose(centres, [[0, 0, 0], [3, 0, 0]], atol=0.02)
    np.testing.assert_array_equal(index, np.repeat([0, 1], 50))


def test_both_sides_of_a_thin_wall_keep_their_own_normals():
    yz = np.random.default_rng(6).uniform(-1, 1, (2000, 2))
    near = PointCloud(np.column_stack([np.full(2000, -0.03), yz]), np.tile([-2.0, 0, 0], (2000, 1)))
    far = PointCloud(np.column_stack([np.full(2000, 0.03), yz]), np.tile([2.0, 0, 0], (2000, 1)))
    wall = reference_cloud(merged([near, far]), 0.1, 20)
    np.testing.assert_allclose(wall.normals[:, 0], np.sign(wall.points[:, 0]), atol=1e-6)
    assert reference_cloud(wall, 0.1, 20) is wall


def test_empty_clouds_stay_empty():
    assert len(vertex_cloud(PointCloud(np.zeros((0, 3)), np.zeros((0, 3))), 0.1, 20)) == 0
