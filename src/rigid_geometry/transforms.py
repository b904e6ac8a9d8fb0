"""Transforms as 4x4 arrays: composing them is `@`; this module builds, inverts, interpolates and measures them."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation, Slerp

Transform = NDArray[np.float64]

_RIGID_TOLERANCE = 1e-5
_IDENTITY_3 = np.eye(3)
_LAST_ROW = np.array([0.0, 0.0, 0.0, 1.0])


def as_transform(matrix: ArrayLike) -> Transform:
    """A checked rigid transform from anything shaped (4, 4); ValueError when it is not finite or not rigid."""
    T = np.asarray(matrix, dtype=np.float64)
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise ValueError(f"a transform is a finite 4x4 matrix, not shape {T.shape}: {matrix!r}")
    R = T[:3, :3]
    with np.errstate(invalid="ignore", over="ignore"):
        orthonormal = np.abs(R @ R.T - _IDENTITY_3).max() <= _RIGID_TOLERANCE
    if not orthonormal or _triple_product(R) < 0 or np.abs(T[3] - _LAST_ROW).max() > _RIGID_TOLERANCE:
        raise ValueError(f"not a rigid transform (rotation not orthonormal, or last row not 0 0 0 1): {matrix!r}")
    return T


def as_transforms(matrices: ArrayLike) -> NDArray[np.float64]:
    """(N, 4, 4) checked rigid transforms; ValueError names the first one that is none."""
    stack = np.array(matrices, dtype=np.float64)
    if stack.ndim != 3 or stack.shape[1:] != (4, 4):
        raise ValueError(f"transforms are (N, 4, 4), not {stack.shape}")
    with np.errstate(invalid="ignore", over="ignore"):
        R = stack[:, :3, :3]
        good = np.isfinite(stack).all(axis=(1, 2)) & (np.linalg.det(R) > 0)
        good &= np.abs(R @ R.transpose(0, 2, 1) - _IDENTITY_3).max(axis=(1, 2), initial=0.0) <= _RIGID_TOLERANCE
        good &= np.abs(stack[:, 3] - _LAST_ROW).max(axis=1, initial=0.0) <= _RIGID_TOLERANCE
    if not good.all():
        first = int(np.argmin(good))
        raise ValueError(f"transform {first} is not rigid: {stack[first].tolist()!r}")
    return stack


def as_covariance(matrix: ArrayLike) -> NDArray[np.float64]:
    """A checked (6, 6) covariance; ValueError when it is not finite, symmetric and positive definite."""
    covariance = np.asarray(matrix, dtype=np.float64)
    if covariance.shape != (6, 6) or not np.isfinite(covariance).all():
        raise ValueError(f"a covariance is a finite 6x6 matrix, not shape {covariance.shape}: {matrix!r}")
    smallest = float(np.linalg.eigvalsh(covariance)[0])
    if not np.allclose(covariance, covariance.T, rtol=1e-6, atol=1e-12) or smallest <= 0.0:
        raise ValueError(f"a covariance is symmetric and positive definite; smallest eigenvalue {smallest:.3g}")
    return covariance


def _triple_product(R: NDArray[np.float64]) -> float:
    """The determinant of a (3, 3) matrix: as_transform is called for every pose that arrives."""
    a, b, c, d, e, f, g, h, i = map(float, R.flat)
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def rotation_from_rpy(roll: float, pitch: float, yaw: float) -> NDArray[np.float64]:
    """(3, 3) rotation Rz(yaw) Ry(pitch) Rx(roll)."""
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_from_rotation(R: NDArray[np.float64]) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a (3, 3) rotation; pitch in [-pi/2, pi/2]."""
    pitch = math.asin(max(-1.0, min(1.0, -R[2, 0])))
    return math.atan2(R[2, 1], R[2, 2]), pitch, math.atan2(R[1, 0], R[0, 0])


def rotation_from_quat(x: float, y: float, z: float, w: float) -> NDArray[np.float64]:
    """(3, 3) rotation of a quaternion, normalised first; ValueError when its norm is not near one."""
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if not abs(norm - 1.0) < 0.1:
        raise ValueError(f"not a unit quaternion: ({x}, {y}, {z}, {w})")
    x, y, z, w = x / norm, y / norm, z / norm, w / norm
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _assemble(R: NDArray[np.float64], translation: ArrayLike) -> Transform:
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = translation
    return T


def transform_from_rpy(xyz: ArrayLike, rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Transform:
    """Transform with translation `xyz` in metres and rotation `rpy` in radians."""
    return _assemble(rotation_from_rpy(*rpy), xyz)


def transform_from_quat(xyz: ArrayLike, quat_xyzw: tuple[float, float, float, float]) -> Transform:
    """Transform with translation `xyz` in metres and the rotation of a unit quaternion."""
    return _assemble(rotation_from_quat(*quat_xyzw), xyz)


def quat_xyzw_from_transform(T: Transform) -> NDArray[np.float64]:
    """(4,) unit quaternion x, y, z, w with w >= 0 (Shepperd 1978: from the largest of the four, never divided by a small one)."""
    (a, b, c), (d, e, f), (g, h, i) = T[:3, :3].tolist()
    candidates = (
        (1 + a - e - i, b + d, c + g, h - f),
        (b + d, 1 - a + e - i, f + h, c - g),
        (c + g, f + h, 1 - a - e + i, d - b),
        (h - f, c - g, d - b, 1 + a + e + i),
    )
    largest = max(range(4), key=lambda k: candidates[k][k])
    quat = np.array(candidates[largest])
    norm = math.sqrt(quat @ quat)
    return quat / (norm if quat[3] >= 0 else -norm)


def inverse(T: Transform) -> Transform:
    """Inverse of a rigid transform, by its transposed rotation."""
    R_t = T[:3, :3].T
    return _assemble(R_t, -R_t @ T[:3, 3])


def transform_points(T: Transform, points: NDArray[np.floating]) -> NDArray[np.floating]:
    """(N, 3) points moved by `T`, in the dtype of `points`."""
    R, t = T[:3, :3].astype(points.dtype), T[:3, 3].astype(points.dtype)
    return points @ R.T + t


def interpolate_transforms(stamps: ArrayLike, transforms: NDArray[np.float64], at: ArrayLike) -> NDArray[np.float64]:
    """(K, 4, 4) transforms at the times `at` between (M,) increasing stamps and their (M, 4, 4) transforms.

    Linear in translation, spherical in rotation. ValueError when a time lies outside: nothing is extrapolated.
    """
    known = np.asarray(stamps, dtype=np.float64)
    times = np.atleast_1d(np.asarray(at, dtype=np.float64))
    if times.size and (times.min() < known[0] - 1e-9 or times.max() > known[-1] + 1e-9):
        raise ValueError(f"times {times.min():.4f}..{times.max():.4f} s lie outside the poses {known[0]:.4f}..{known[-1]:.4f} s")
    times = np.clip(times, known[0], known[-1])
    out = np.tile(np.eye(4), (times.size, 1, 1))
    if known.size == 1:
        out[:] = transforms[0]
        return out
    out[:, :3, :3] = Slerp(known, Rotation.from_matrix(transforms[:, :3, :3]))(times).as_matrix()
    for axis in range(3):
        out[:, axis, 3] = np.interp(times, known, transforms[:, axis, 3])
    return out


def angle_difference(a: float, b: float) -> float:
    """The signed turn from angle `b` to angle `a`, in (-pi, pi]."""
    d = math.remainder(a - b, 2.0 * math.pi)
    return math.pi if d == -math.pi else d


def yaw_of(T: Transform) -> float:
    """Heading of the x axis, projected on the horizontal plane."""
    return math.atan2(T[1, 0], T[0, 0])


def tilt_angle(T: Transform) -> float:
    """Angle between the frame's z axis and the vertical, in [0, pi]."""
    return math.acos(max(-1.0, min(1.0, T[2, 2])))


def rotation_angle(T: Transform) -> float:
    """Angle of the rotation of `T`, in [0, pi]."""
    return float(rotation_angles(T[None])[0])


def rotation_angles(T: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) `rotation_angle` of each of (N, 4, 4), or of their (N, 3, 3) rotations."""
    skew = np.stack([T[:, 2, 1] - T[:, 1, 2], T[:, 0, 2] - T[:, 2, 0], T[:, 1, 0] - T[:, 0, 1]], axis=1)
    return np.asarray(np.arctan2(0.5 * np.linalg.norm(skew, axis=1), 0.5 * (np.trace(T[:, :3, :3], axis1=1, axis2=2) - 1.0)))


def translation_distance(T_a: Transform, T_b: Transform) -> float:
    """Euclidean distance between two origins, in metres."""
    return float(np.linalg.norm(T_a[:3, 3] - T_b[:3, 3]))
