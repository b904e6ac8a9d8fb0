"""The alignment of planes with planes against its formula written out, against small_gicp's, and with things that stand elsewhere."""

import numpy as np
import pytest
import small_gicp
from synthetic_sweeps import furnished_room, pose, sweep, world_of

from pose_graph_mapping.registration.cloud import PointCloud, moved_points, vertex_cloud
from pose_graph_mapping.registration.gicp_alignment import Stage, _normal_equations, align
from pose_graph_mapping.registration.gicp_surface import nearest, surface_of, voxel_cloud
from pose_graph_mapping.registration.match_quality import exp_motion
from rigid_geometry import inverse, rotation_angle, transform_from_rpy

T_START = transform_from_rpy((0.1, -0.08, 0.02), (0.01, 0.0, 0.04))
FINE = Stage(0.3, 20, 1e-5)


@pytest.fixture(scope="module")
def pair():
    """Two sweeps of one room from one place, as voxel means with normals."""
    rng, scene = np.random.default_rng(41), world_of(furnished_room())
    return [vertex_cloud(PointCloud(*sweep(scene, pose(0.5, -0.3, 0.4), rng)), 0.1, 20) for _ in range(2)]


def unit(rng, count):
    vectors = rng.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def skew(v):
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


@pytest.mark.parametrize(("doubt", "least_cos"), [(0.0, -np.inf), (0.3, -np.inf), (0.3, 0.0)])
def test_normal_equations_are_those_of_the_sum_written_out(doubt, least_cos):
    rng, T = np.random.default_rng(42), transform_from_rpy((1.0, 2.0, -0.5), (0.2, -0.3, 1.0))
    points, normals, target_normals = rng.normal(0, 3, (50, 3)), unit(rng, 50), unit(rng, 50)
    normals[7] = target_normals[8] = 0.0  # not known: as wide across as along
    target = moved_points(T, points) + rng.normal(0, 0.1, (50, 3))
    squared = np.sum((target - moved_points(T, points)) ** 2, axis=1)
    most, index = np.median(squared), np.arange(50, dtype=np.uint64)
    H, gradient, pairs, weight = _normal_equations(points, normals, target, target_normals, index, squared, most, doubt, least_cos, T)
    R = T[:3, :3]
    near = np.flatnonzero((squared <= most) & (np.sum(target_normals * (normals @ R.T), axis=1) >= least_cos))
    H_sum, gradient_sum, weights = np.zeros((6, 6)), np.zeros(6), []
    for i in near:
        n, m = R.T @ target_normals[i], normals[i]
        W = np.linalg.inv(2.0 * np.eye(3) - 0.999 * (np.outer(n, n) + np.outer(m, m)))
        r, J = R.T @ (target[i] - T[:3, 3]) - points[i], np.hstack([skew(points[i]), -np.eye(3)])
        weights.append(1.0 / (1.0 + doubt * r @ W @ r))
        H_sum, gradient_sum = H_sum + weights[-1] * J.T @ W @ J, gradient_sum + weights[-1] * J.T @ W @ r
    np.testing.assert_allclose(H, H_sum, rtol=1e-9, atol=1e-9 * np.abs(H_sum).max())
    np.testing.assert_allclose(gradient, gradient_sum, rtol=1e-9, atol=1e-9 * np.abs(gradient_sum).max())
    assert pairs == len(near) and weight == pytest.approx(sum(weights))


def test_alignment_is_that_of_small_gicp(pair):
    reference, reading = pair
    clouds = [small_gicp.PointCloud(cloud.points) for cloud in pair]
    tree = small_gicp.KdTree(clouds[0])
    for cloud in clouds:
        small_gicp.estimate_normals_covariances(cloud, num_neighbors=20)
    expected = small_gicp.align(
        *clouds,
        tree,
        T_START,
        registration_type="GICP",
        max_correspondence_distance=FINE.distance_m,
        rotation_epsilon=1e-5,
        translation_epsilon=1e-5,
    )
    found = align(surface_of(reference), reading, T_START, FINE)
    off = inverse(np.asarray(expected.T_target_source)) @ found.T
    assert np.linalg.norm(off[:3, 3]) < 1e-5 and rotation_angle(off) < 1e-5
    np.testing.assert_allclose(found.hessian, np.asarray(expected.H), rtol=1e-3, atol=1e-3 * np.abs(found.hessian).max())
    assert found.inliers == expected.num_inliers and found.weight == pytest.approx(found.inliers)


def test_what_stands_elsewhere_pulls_less_when_it_counts_less(pair):
    reference, reading = pair
    moved = reading.points.copy()
    moved[(moved[:, 0] > 1.0) & (moved[:, 2] < 0.7)] += [0.12, 0.0, 0.0]  # the foot of one wall, and what stands before it
    reading, surface = PointCloud(moved, None, reading.normals), surface_of(reference)
    pulled, held = (align(surface, reading, np.eye(4), Stage(0.3, 30, 1e-5, half_m)).T for half_m in (np.inf, 0.05))
    assert np.linalg.norm(pulled[:3, 3]) > 0.01 and np.linalg.norm(held[:3, 3]) < 0.5 * np.linalg.norm(pulled[:3, 3])


def test_point_that_is_half_a_weight_off_counts_half():
    points, up = np.array([[1.0, 2.0, 0.05]]), np.array([[0.0, 0.0, 1.0]])
    target = surface_of(PointCloud(points * [1.0, 1.0, 0.0], None, up))
    assert align(target, PointCloud(points, None, up), np.eye(4), Stage(0.3, 1, 0.0, 0.05)).weight == pytest.approx(0.5)


def test_nothing_in_reach_moves_nothing(pair):
    reference, reading = pair
    T_far = transform_from_rpy((100.0, 0.0, 0.0))
    found = align(surface_of(reference), reading, T_far, FINE)
    assert found.inliers == 0 and found.iterations == 1
    np.testing.assert_array_equal(found.T, T_far)


def test_motion_that_no_point_feels_is_not_made():
    """A line says nothing of a turn about itself."""
    line = PointCloud(np.column_stack([np.linspace(-5, 5, 300), np.zeros(300), np.zeros(300)]), None, np.zeros((300, 3)))
    T = align(surface_of(line), line, exp_motion(np.array([0.3, 0.0, 0.0, 0.0, 0.02, 0.01])), FINE).T
    assert np.isfinite(T).all() and np.linalg.norm(T[1:3, 3]) < 1e-3 and T[1, 2] == pytest.approx(-np.sin(0.3), abs=1e-3)


def test_normals_are_kept_where_they_point_to_a_sensor_and_estimated_where_not():
    xy = np.random.default_rng(43).uniform(-1, 1, (4000, 2))
    points, tilted = np.column_stack([xy, np.zeros(4000)]), np.tile([0.6, 0.0, 0.8], (4000, 1))
    kept = voxel_cloud(PointCloud(points, np.tile([0.0, 0.0, 2.0], (4000, 1)), tilted), 0.1, 20)
    np.testing.assert_allclose(kept.normals, np.tile([0.6, 0.0, 0.8], (len(kept), 1)), atol=1e-12)
    estimated = voxel_cloud(PointCloud(points, None, np.where(np.arange(4000)[:, None] % 2, tilted, -tilted)), 0.1, 20)
    np.testing.assert_allclose(np.abs(estimated.normals[:, 2]), 1.0, atol=1e-6)


def test_nearest_is_that_of_brute_force():
    rng = np.random.default_rng(44)
    points, asked = rng.normal(size=(200, 3)), rng.normal(size=(50, 3))
    index, squared = nearest(surface_of(PointCloud(points, None, points)).tree, asked)
    distances = np.sum((asked[:, None] - points[None]) ** 2, axis=2)
    np.testing.assert_array_equal(index, distances.argmin(axis=1))
    np.testing.assert_allclose(squared, distances.min(axis=1))
