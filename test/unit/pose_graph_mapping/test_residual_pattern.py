"""The pattern of residuals: noise and rigid offsets leave none, a sweep that is bent does."""

import math

import numpy as np
import pytest

from pose_graph_mapping.residual_pattern import ResidualPattern, pattern_covariance, residual_pattern
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
    pattern = found()
    assert pattern.metres < 5e-4 and pattern.radians < math.radians(0.01)


def test_pose_that_is_off_leaves_no_pattern():
    pattern = found(T_found=T @ transform_from_rpy((0.02, -0.01, 0.01), (0.002, 0.0, 0.003)))
    assert pattern.metres < 1e-3


def test_bent_sweep_leaves_a_pattern():
    pattern = found(bend=tilted)
    assert pattern.metres > 2e-3 and pattern.radians > math.radians(0.05)


def test_normals_may_point_to_either_side():
    assert found(bend=tilted, sign=-1.0) == found(bend=tilted)


def test_too_few_points_tell_nothing():
    points, normals = room(20)
    assert residual_pattern(points, SENSOR, T, transform_points(T, points), normals) is None


def test_plane_that_holds_three_directions_only_is_no_trouble():
    points, normals = room()
    flat = normals[:, 2] > 0.5
    pattern = residual_pattern(points[flat], SENSOR, T, transform_points(T, points[flat]), normals[flat] @ T[:3, :3].T)
    assert pattern.metres == pytest.approx(0.0, abs=1e-9)


def test_sigmas_go_with_the_pattern():
    covariance = pattern_covariance(ResidualPattern(0.004, 0.001), 5.0, 1.5)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), [0.005] * 3 + [0.006] * 3)
