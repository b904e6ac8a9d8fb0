"""The pattern of residuals: noise and rigid offsets leave none, a sweep that is bent does."""

import math

import numpy as np
import pytest

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.residual_pattern import pattern_covariance, residual_pattern
from rigid_geometry import rotation_from_rpy, transform_from_rpy, transform_points

SENSOR = np.array([0.2, 0.0, 0.8])
T = transform_from_rpy((3.0, -2.0, 0.1), (0.02, -0.01, 0.8))


def room(count=12_000):
    """Points (N, 3) and normals (N, 3) of a box of 8 x 6 x 2.4 m around the robot, in its body frame."""
    rng = np.random.default_rng(2)
    low, high = np.array([-4.0, -3.0, -0.1]), np.array([4.0, 3.0, 2.3])
    points, axis, side = rng.uniform(low, high, (count, 3)), rng.integers(3, size=count), rng.random(count) < 0.5
    points[np.arange(count), axis] = np.where(side, low[axis], high[axis])
    normals = np.zeros((count, 3))
    normals[np.arange(count), axis] = np.where(side, 1.0, -1.0)
    return points, normals


def found(bend=lambda p: p, sigma_m=0.01, T_found=T, sign=1.0):
    """The pattern of a reading of the room that came out as `bend` of it, placed by `T_found` in a perfect map."""
    points, normals = room()
    noise = np.random.default_rng(4).normal(0.0, sigma_m, (len(points), 1))
    return residual_pattern(bend(points) + noise * normals, SENSOR, T_found, transform_points(T, points), sign * normals @ T[:3, :3].T)


def tilted(points, scale=0.005):
    """What a tilt that is wrong by half a percent makes of points: turned about y by that share of their angle from ahead."""
    beams = points - SENSOR
    angle = scale * np.arctan2(np.hypot(beams[:, 1], beams[:, 2]), beams[:, 0])
    return np.array([rotation_from_rpy(0.0, a, 0.0) @ b for a, b in zip(angle, beams, strict=True)]) + SENSOR


def test_noise_leaves_no_pattern():
    assert found() < math.radians(0.01)


def test_pose_that_is_off_leaves_no_pattern():
    assert found(T_found=T @ transform_from_rpy((0.02, -0.01, 0.01), (0.002, 0.0, 0.003))) < math.radians(0.015)


def test_bent_sweep_leaves_a_pattern_that_goes_with_how_much_it_is_bent():
    bent = found(bend=tilted)
    assert bent > math.radians(0.05)
    assert found(bend=lambda points: tilted(points, 0.0025)) == pytest.approx(bent / 2.0, rel=0.1)


def test_normals_may_point_to_either_side():
    assert found(bend=tilted, sign=-1.0) == found(bend=tilted)


def test_too_few_points_tell_nothing():
    points, normals = room(20)
    assert residual_pattern(points, SENSOR, T, transform_points(T, points), normals) is None


def test_plane_that_holds_three_directions_only_is_no_trouble():
    points, normals = room()
    flat = normals[:, 2] > 0.5
    pattern = residual_pattern(points[flat], SENSOR, T, transform_points(T, points[flat]), normals[flat] @ T[:3, :3].T)
    assert pattern == pytest.approx(0.0, abs=1e-9)


def test_sigmas_go_with_what_the_pattern_is_beyond_a_good_mount_s():
    config = RegistrationConfig(pattern_rotation_factor=5.0, pattern_yaw_factor=0.5, pattern_translation_m=7.0, pattern_good_rad=0.0003)
    covariance = pattern_covariance(0.0005, config)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), [0.002, 0.002, 0.0002, 0.0028, 0.0028, 0.0028])
    assert np.count_nonzero(covariance) == 6 and not pattern_covariance(0.0003, config).any() and not pattern_covariance(0.0, config).any()
