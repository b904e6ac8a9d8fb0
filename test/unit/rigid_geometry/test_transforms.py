"""Transforms against scipy's rotations and against their own inverses."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from rigid_geometry import (
    angle_difference,
    as_transform,
    as_transforms,
    interpolate_transforms,
    inverse,
    quat_xyzw_from_transform,
    rotation_angle,
    rotation_angles,
    rotation_from_quat,
    rotation_from_rpy,
    rpy_from_rotation,
    tilt_angle,
    transform_from_quat,
    transform_from_rpy,
    transform_points,
    translation_distance,
    yaw_of,
)


def random_transforms(count: int, seed: int = 1) -> list[NDArray[np.float64]]:
    rng = np.random.default_rng(seed)
    rotations = Rotation.random(count, random_state=seed).as_matrix()
    out = []
    for R in rotations:
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R, rng.uniform(-10.0, 10.0, 3)
        out.append(T)
    return out


@pytest.mark.parametrize("rpy", [(0.0, 0.0, 0.0), (0.3, -0.2, 2.9), (-3.0, 1.5, -3.1), (0.1, math.pi / 2 - 1e-6, 0.2)])
def test_roll_pitch_yaw_are_those_of_scipy_and_come_back(rpy: tuple[float, float, float]) -> None:
    R = rotation_from_rpy(*rpy)
    np.testing.assert_allclose(R, Rotation.from_euler("xyz", rpy).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(rotation_from_rpy(*rpy_from_rotation(R)), R, atol=1e-6)


@pytest.mark.parametrize("T", random_transforms(20))
def test_quaternions_are_those_of_scipy_and_come_back(T: NDArray[np.float64]) -> None:
    quat = quat_xyzw_from_transform(T)
    assert quat[3] >= 0.0
    np.testing.assert_allclose(rotation_from_quat(*quat), T[:3, :3], atol=1e-12)
    np.testing.assert_allclose(Rotation.from_quat(quat).as_matrix(), T[:3, :3], atol=1e-12)
    np.testing.assert_allclose(transform_from_quat(T[:3, 3], tuple(-quat)), T, atol=1e-12)


@pytest.mark.parametrize("quat", [(0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 2.0), (math.nan, 0.0, 0.0, 1.0)])
def test_quaternion_that_is_no_rotation_is_refused(quat: tuple[float, float, float, float]) -> None:
    with pytest.raises(ValueError, match="not a unit quaternion"):
        rotation_from_quat(*quat)


@pytest.mark.parametrize("T", random_transforms(10, seed=2))
def test_inverse_undoes_a_transform(T: NDArray[np.float64]) -> None:
    np.testing.assert_allclose(inverse(T), np.linalg.inv(T), atol=1e-12)
    points = np.random.default_rng(3).uniform(-5.0, 5.0, (50, 3))
    np.testing.assert_allclose(transform_points(inverse(T), transform_points(T, points)), points, atol=1e-12)


def test_points_are_moved_as_homogeneous_ones_and_keep_their_type() -> None:
    T = random_transforms(1)[0]
    points = np.random.default_rng(4).uniform(-5.0, 5.0, (7, 3))
    expected = (T @ np.column_stack([points, np.ones(7)]).T).T[:, :3]
    np.testing.assert_allclose(transform_points(T, points), expected, atol=1e-12)
    assert transform_points(T, points.astype(np.float32)).dtype == np.float32
    assert transform_points(T, np.zeros((0, 3))).shape == (0, 3)


@pytest.mark.parametrize(
    "matrix",
    [np.eye(3), np.full((4, 4), np.nan), np.diag([2.0, 1.0, 1.0, 1.0]), np.diag([-1.0, 1.0, 1.0, 1.0]), np.diag([1.0, 1.0, 1.0, 2.0])],
    ids=["shape", "not finite", "scaled", "mirrored", "last row"],
)
def test_matrix_that_is_not_rigid_is_refused(matrix: NDArray[np.float64]) -> None:
    with pytest.raises(ValueError):
        as_transform(matrix)


def test_interpolation_is_linear_in_place_and_spherical_in_rotation() -> None:
    stamps = np.array([1.0, 1.5, 3.0])
    transforms = np.stack(random_transforms(3, seed=5))
    at = np.linspace(1.0, 3.0, 41)
    found = interpolate_transforms(stamps, transforms, at)
    np.testing.assert_allclose(found[:, :3, :3], Slerp(stamps, Rotation.from_matrix(transforms[:, :3, :3]))(at).as_matrix(), atol=1e-12)
    for axis in range(3):
        np.testing.assert_allclose(found[:, axis, 3], np.interp(at, stamps, transforms[:, axis, 3]), atol=1e-12)
    np.testing.assert_allclose(interpolate_transforms(stamps, transforms, stamps), transforms, atol=1e-12)


@pytest.mark.parametrize("at", [0.9, 3.1])
def test_nothing_is_extrapolated(at: float) -> None:
    with pytest.raises(ValueError, match="lie outside"):
        interpolate_transforms([1.0, 3.0], np.stack(random_transforms(2)), at)


def test_one_pose_holds_at_its_own_time_only() -> None:
    T = random_transforms(1)
    np.testing.assert_array_equal(interpolate_transforms([2.0], np.stack(T), 2.0)[0], T[0])
    with pytest.raises(ValueError):
        interpolate_transforms([2.0], np.stack(T), 2.1)


@pytest.mark.parametrize(
    ("a", "b", "turn"), [(0.1, -0.1, 0.2), (3.1, -3.1, 6.2 - 2 * math.pi), (math.pi, 0.0, math.pi), (-math.pi, 0.0, math.pi)]
)
def test_angle_difference_is_the_short_way_round(a: float, b: float, turn: float) -> None:
    assert angle_difference(a, b) == pytest.approx(turn)


def test_yaw_tilt_angle_and_distance_are_those_put_in() -> None:
    T = transform_from_rpy((1.0, 2.0, 2.0), (0.0, 0.3, 1.1))
    assert yaw_of(T) == pytest.approx(1.1)
    assert tilt_angle(T) == pytest.approx(0.3)
    assert translation_distance(T, np.eye(4)) == pytest.approx(3.0)


@pytest.mark.parametrize("angle", [0.0, 1e-7, 0.5, math.pi - 1e-7, math.pi])
def test_rotation_angle_is_exact_near_zero_and_near_pi(angle: float) -> None:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(angle * np.array([1.0, 2.0, 2.0]) / 3.0).as_matrix()
    assert rotation_angle(T) == pytest.approx(angle, abs=1e-9)


def test_quaternion_agrees_with_scipy_also_at_half_turns():
    half_turns = Rotation.from_rotvec(np.pi * np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0.8, 0.0]]))
    for R in [np.eye(3), *half_turns.as_matrix(), *Rotation.random(200, random_state=1).as_matrix()]:
        T = np.eye(4)
        T[:3, :3] = R
        quat = quat_xyzw_from_transform(T)
        assert quat[3] >= 0.0 and np.linalg.norm(quat) == pytest.approx(1.0)
        np.testing.assert_allclose(Rotation.from_quat(quat).as_matrix(), R, atol=1e-12)


def test_stack_of_transforms_is_checked_and_turned_like_each_of_them() -> None:
    rng = np.random.default_rng(5)
    stack = np.array([transform_from_rpy(rng.normal(size=3), rng.normal(size=3)) for _ in range(6)])
    np.testing.assert_array_equal(as_transforms(stack), stack)
    np.testing.assert_allclose(rotation_angles(stack), [rotation_angle(T) for T in stack], atol=1e-15)
    assert as_transforms(np.zeros((0, 4, 4))).shape == (0, 4, 4)


@pytest.mark.parametrize("spoil", [lambda T: T * np.nan, lambda T: T * [[-1], [1], [1], [1]], lambda T: T * 1.01])
def test_stack_with_a_transform_that_is_none_names_it(spoil) -> None:
    stack = np.tile(np.eye(4), (3, 1, 1))
    stack[1] = spoil(stack[1])
    with pytest.raises(ValueError, match="transform 1 is not rigid"):
        as_transforms(stack)
    with pytest.raises(ValueError, match="N, 4, 4"):
        as_transforms(np.eye(4))
