"""What was measured of up: its bias is told from the map's tilt by headings, and sweeps of one drive share one error."""

import gtsam
import numpy as np
import pytest

from pose_graph_mapping.config import MappingConfig
from pose_graph_mapping.graph.dead_reckoning import gravity_sigma
from pose_graph_mapping.graph.graph_measurements import Gravity
from pose_graph_mapping.graph.gravity_bias import estimated_bias
from pose_graph_mapping.graph.mapper import levelled
from pose_graph_mapping.graph.pose_graph import EdgeKind, PoseGraph
from rigid_geometry import inverse, transform_from_rpy

BIAS = np.radians(0.3)
SIGMA = np.radians(0.3)
EDGE_COVARIANCE = np.diag([np.radians(0.05) ** 2] * 3 + [0.006**2] * 3)
SEEDS = (1, 2, 3, 4)


def loop_with_a_long_side():
    """Sixteen vertices one behind the other, then a full circle: all headings, but one of them more often."""
    poses = [np.eye(4)]
    for k in range(1, 40):
        poses.append(poses[-1] @ transform_from_rpy((2.0, 0, 0), (0, 0, 2 * np.pi / 24 if k >= 16 else 0.0)))
    return poses


def straight_line():
    return [transform_from_rpy((2.0 * k, 0, 0)) for k in range(24)]


def bias_of(seed):
    angle = np.random.default_rng(seed).uniform(-np.pi, np.pi)
    return BIAS * np.array([np.cos(angle), np.sin(angle), 0.0])


def measured_ups(poses, seed):
    """Up in the body frames, with the bias and a little noise."""
    rng = np.random.default_rng(100 + seed)
    ups = [T[2, :3] + bias_of(seed) + rng.normal(0, np.radians(0.02), 3) for T in poses]
    return [up / np.linalg.norm(up) for up in ups]


def mapped(poses, seed, bias_sigma_rad):
    """A graph that grew along `poses`, first levelled by what its biased IMU says."""
    rng, ups, graph = np.random.default_rng(seed), measured_ups(poses, seed), PoseGraph(gravity_bias_sigma_rad=bias_sigma_rad)
    for k, up in enumerate(ups):
        if k == 0:
            graph.add_vertex(levelled(poses[0], up))
        else:
            noise = gtsam.Pose3.Expmap(rng.multivariate_normal(np.zeros(6), EDGE_COVARIANCE)).matrix()
            measured = inverse(poses[k - 1]) @ poses[k] @ noise
            graph.add_edge(k - 1, graph.add_vertex(graph.pose(k - 1) @ measured), measured, EDGE_COVARIANCE, EdgeKind.MATCH)
        graph.add_gravity(k, up, SIGMA)
        graph.optimise()
    return graph


def tilt_deg(graph, poses):
    """Angle between the map's up and the truth's, as all rotations together have it."""
    U, _, Vt = np.linalg.svd(sum(A[:3, :3] @ B[:3, :3].T for A, B in zip(graph.poses(), poses, strict=True)))
    return np.degrees(np.arccos(min(1.0, (U @ Vt)[2, 2])))


@pytest.mark.parametrize("seed", SEEDS)
def test_bias_over_a_loop_with_all_headings_leaves_the_map_level(seed):
    poses = loop_with_a_long_side()
    plain, with_bias = mapped(poses, seed, 0.0), mapped(poses, seed, SIGMA)
    assert tilt_deg(with_bias, poses) < 0.05 < 0.1 < tilt_deg(plain, poses)
    assert np.linalg.norm(with_bias._bias - bias_of(seed)) < 0.3 * BIAS
    assert not plain._bias.any()


@pytest.mark.parametrize("seed", SEEDS)
def test_bias_is_no_worse_than_the_plain_factor_where_all_headings_are_alike(seed):
    poses = straight_line()
    assert tilt_deg(mapped(poses, seed, SIGMA), poses) < tilt_deg(mapped(poses, seed, 0.0), poses) + 0.005


def test_running_graph_is_levelled_as_the_whole_one():
    graph = mapped(loop_with_a_long_side(), 1, SIGMA)
    running, bias = graph.poses(), graph._bias
    graph.solve()
    np.testing.assert_allclose(graph.poses(), running, atol=2e-4)
    np.testing.assert_allclose(graph._bias, bias, atol=1e-5)


def turned_about(axis, angle):
    return gtsam.Rot3.Expmap(np.asarray(axis, dtype=float) * angle).matrix()


def test_bias_and_tilt_of_rigid_rotations_come_out_exactly():
    rng, bias, tilt = np.random.default_rng(3), np.array([0.004, -0.003, 0.0]), turned_about((0.6, 0.8, 0), 0.01)
    poses = np.array([transform_from_rpy((0, 0, 0), (*rng.normal(0, 0.1, 2), yaw)) for yaw in np.linspace(-3, 3, 30)])
    gravity = [Gravity(k, T[2, :3] + bias, 0.01) for k, T in enumerate(poses)]
    tilted = poses.copy()
    tilted[:, :3, :3] = tilt @ poses[:, :3, :3]
    found = estimated_bias(tilted, gravity, 10.0)
    np.testing.assert_allclose(found[:2], bias[:2], atol=1e-4)


def test_one_heading_says_nothing_of_the_bias():
    poses = np.array([np.eye(4)] * 5)
    up = np.array([0.005, 0.0, 1.0]) / np.linalg.norm([0.005, 0.0, 1.0])
    found = estimated_bias(poses, [Gravity(k, up, 0.005) for k in range(5)], 0.005)
    assert np.abs(found).max() < 1e-4


def test_without_prior_or_measurements_there_is_no_bias():
    assert not estimated_bias(np.array([np.eye(4)]), [Gravity(0, np.array([0.01, 0, 1.0]), 0.01)], 0.0).any()
    assert not estimated_bias(np.array([np.eye(4)]), [], 0.01).any()


def test_wrong_sigmas_are_refused():
    with pytest.raises(ValueError, match="gravity_bias_sigma_rad"):
        PoseGraph(gravity_bias_sigma_rad=-0.1)
    with pytest.raises(ValueError, match="outlier_chi2"):
        PoseGraph(outlier_chi2=0.0)


def test_sweeps_of_one_drive_share_the_error_of_its_odometry_and_do_not_bend_the_map():
    """The attitude of an odometry is off by 0.4 degrees for forty sweeps, then as much the other way."""
    poses = [transform_from_rpy((1.0 * k, 0, 0)) for k in range(80)]
    config, stamps_s, graph = MappingConfig(), [2.0 * k for k in range(80)], PoseGraph()
    covariance = np.diag([np.radians(0.02) ** 2] * 3 + [0.001**2] * 3)
    for k, T in enumerate(poses):
        graph.add_vertex(T)
        if k:
            graph.add_edge(k - 1, k, inverse(poses[k - 1]) @ T, covariance, EdgeKind.MATCH)
        off = turned_about((1, 0, 0), np.radians(0.4 if k < 40 else -0.4))
        graph.add_gravity(k, off[:, 2], gravity_sigma(np.radians(0.48), stamps_s, k, config))
    graph.solve()
    bend = graph.pose(10)[:3, :3].T @ graph.pose(70)[:3, :3]
    assert np.degrees(abs(np.arcsin(bend[2, 1]))) < 0.25


def test_what_was_up_counts_once_within_the_time_that_its_error_lasts():
    config = MappingConfig(gravity_time_s=25.0, gravity_sigma_rad=0.01)
    assert gravity_sigma(None, [3.0], 0, config) == 0.01
    assert gravity_sigma(0.002, [3.0, 4.0], 1, config) == pytest.approx(0.01)
    assert gravity_sigma(0.002, [3.0, 40.0], 1, config) == 0.002
    assert gravity_sigma(0.002, [40.0, 15.0], 1, config) == 0.002, "the clock was set back"
