"""What a placement says of itself: two-way free space, degenerate directions, covariance; `verdict` makes a judgement of it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import gtsam
import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter
from scipy.spatial.transform import Rotation

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.cloud import PointCloud, viewpoints
from rigid_geometry import inverse

Array = NDArray[np.float64]

_ROWS, _COLUMNS = 180, 360
DEGENERATE_SIGMA_M = 2.0  # sigma given to an unconstrained direction, at the distance of a typical point
DEGENERATE_GUESS_SIGMA_M = 0.6  # a guess known no better than this along an unconstrained direction does not stand there
_FREE_SPACE_MARGIN_M = 0.15  # a point contradicts when it is nearer than seen by more than this
_FREE_SPACE_MARGIN_RATIO = 0.02  # and this share of the range
_FREE_SPACE_LEAST_COS = 0.4  # surfaces that a beam meets at a smaller cosine are not compared: the filter of veiled points takes them out


@njit(cache=True, inline="always")
def _angle(y: float, x: float) -> float:
    """The arc tangent of y / x in its quadrant, to 1e-5 rad, in a fifth of the time (Abramowitz and Stegun 4.4.49)."""
    across, along = min(abs(x), abs(y)), max(abs(x), abs(y))
    t = across / along if along > 0.0 else 0.0
    s = t * t
    angle = t * (0.9998660 + s * (-0.3302995 + s * (0.1801410 + s * (-0.0851330 + s * 0.0208351))))
    angle = 0.5 * math.pi - angle if abs(y) > abs(x) else angle
    angle = math.pi - angle if x < 0.0 else angle
    return angle if y >= 0.0 else -angle


@njit(cache=True)
def _cell(dx: float, dy: float, dz: float) -> tuple[int, int]:
    row = int((_angle(dz, math.sqrt(dx * dx + dy * dy)) + 0.5 * math.pi) * (_ROWS / math.pi))
    column = int((_angle(dy, dx) + math.pi) * (_COLUMNS / (2.0 * math.pi)))
    return min(row, _ROWS - 1), min(column, _COLUMNS - 1)


@njit(cache=True)
def _nearest_by_cell(points: Array, eye: Array) -> Array:
    image = np.full((_ROWS, _COLUMNS), np.inf)
    for i in range(len(points)):
        dx, dy, dz = points[i, 0] - eye[0], points[i, 1] - eye[1], points[i, 2] - eye[2]
        distance = math.sqrt(dx * dx + dy * dy + dz * dz)
        if distance > 1e-3:
            row, column = _cell(dx, dy, dz)
            image[row, column] = min(image[row, column], distance)
    return image


@njit(cache=True)
def _compare(
    points: Array, normals: Array, eye: Array, image: Array, margin_m: float, margin_ratio: float, least_cos: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(N,) which points are compared with what was seen from `eye`, and which of them lie in front of it.

    Surfaces that it sees along are not compared.
    """
    compared, in_front = np.zeros(len(points), dtype=np.bool_), np.zeros(len(points), dtype=np.bool_)
    for i in range(len(points)):
        dx, dy, dz = points[i, 0] - eye[0], points[i, 1] - eye[1], points[i, 2] - eye[2]
        distance = math.sqrt(dx * dx + dy * dy + dz * dz)
        nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
        has_normal = nx * nx + ny * ny + nz * nz > 0.25
        if distance <= 1e-3 or (has_normal and abs(nx * dx + ny * dy + nz * dz) < least_cos * distance):
            continue
        row, column = _cell(dx, dy, dz)
        seen = image[row, column]
        compared[i] = seen < np.inf
        in_front[i] = compared[i] and distance < seen - margin_m - margin_ratio * seen
    return compared, in_front


def lies_in_front(points: PointCloud, eye: Array, image: Array, margin_m: float, least_cos: float) -> NDArray[np.bool_]:
    """(N,) which points lie in front of what was seen from `eye`, by more than a margin; not those that it sees along."""
    normals = np.zeros_like(points.points) if points.normals is None else points.normals
    return np.asarray(_compare(points.points, normals, eye, image, margin_m, 0.0, least_cos)[1])


def range_image(points: Array, eye: Array) -> Array:
    """(180, 360) nearest distance in every degree as seen from `eye` (3,), minimum of 3 x 3 cells; inf where nothing was seen."""
    return np.asarray(minimum_filter(_nearest_by_cell(points, eye), size=3, mode=("nearest", "wrap")))


class FreeSpace:
    """What two clouds saw free, each from its standpoints: range images made once, asked for many placements.

    Each cloud in its own frame. Without origins every answer is NaN.
    """

    def __init__(self, reference: PointCloud, reading: PointCloud, near: Array, config: RegistrationConfig) -> None:
        """`near` (3,), in the reference: of many standpoints there, the nearest to it are asked."""
        self._config = config
        self._reference, self._reading = _with_normals(reference), _with_normals(reading)
        self._seen_by_reference = _images(reference, near, config)
        self._seen_by_reading = _images(reading, np.zeros(3), config)

    def contradiction(self, T_reference_reading: Array, most: int | None = None) -> float:
        """Share of the points of one cloud that lie in space the other saw free, the worse of both directions; NaN without origins.

        Only directions in which the observer saw something count; nothing in common gives NaN too. `most` points of a cloud are enough
        for a rough answer; None asks all.
        """
        reading, reference = self._reading, self._reference
        if most is not None:
            reading, reference = reading.thinned(most), reference.thinned(most)
        reading, reference = reading.transformed(T_reference_reading), reference.transformed(inverse(T_reference_reading))
        ways = [self._one_way(self._seen_by_reading, reference), self._one_way(self._seen_by_reference, reading)]
        if any(compared == 0 for compared, _ in ways):
            return float("nan")
        return max(in_front / compared for compared, in_front in ways)

    def in_reference_free_space(self, T_reference_reading: Array) -> NDArray[np.bool_]:
        """(N,) which points of the reading lie in space that the reference saw free."""
        found = np.zeros(len(self._reading), dtype=np.bool_)
        for _, in_front in self._compared(self._seen_by_reference, self._reading.transformed(T_reference_reading)):
            found |= in_front
        return found

    def _one_way(self, images: Sequence[tuple[Array, Array]], others: PointCloud) -> tuple[int, int]:
        """Points compared with, and in front of, what was seen from the standpoints."""
        counts = [
            (int(np.count_nonzero(compared)), int(np.count_nonzero(in_front))) for compared, in_front in self._compared(images, others)
        ]
        return sum(compared for compared, _ in counts), sum(in_front for _, in_front in counts)

    def _compared(self, images: Sequence[tuple[Array, Array]], others: PointCloud) -> Iterator[tuple[NDArray[np.bool_], NDArray[np.bool_]]]:
        """Of every standpoint which points are compared with what was seen from it, and which lie in front of that."""
        margins = _FREE_SPACE_MARGIN_M, _FREE_SPACE_MARGIN_RATIO, _FREE_SPACE_LEAST_COS
        assert others.normals is not None
        for eye, image in images:
            yield _compare(others.points, others.normals, eye, image, *margins)


def _with_normals(cloud: PointCloud) -> PointCloud:
    """The points with their normals, zero where they are not known; the rest is not needed."""
    return PointCloud(cloud.points, None, np.zeros_like(cloud.points) if cloud.normals is None else cloud.normals)


def _images(observer: PointCloud, near: Array, config: RegistrationConfig) -> list[tuple[Array, Array]]:
    """Standpoints (those nearest to `near`) with what was seen from them."""
    if observer.origins is None or not len(observer):
        return []
    eyes, index = viewpoints(observer.origins, config.standpoint_m)
    order = np.argsort(np.linalg.norm(eyes - near, axis=1), kind="stable")[: config.free_space_viewpoints]
    return [(eyes[k], range_image(observer.points[index == k], eyes[k])) for k in order]


def free_space_contradiction(reference: PointCloud, reading: PointCloud, T_reference_reading: Array, config: RegistrationConfig) -> float:
    """`FreeSpace.contradiction` of one placement."""
    return FreeSpace(reference, reading, T_reference_reading[:3, 3], config).contradiction(T_reference_reading)


@dataclass(frozen=True, eq=False)
class Degeneracy:
    """Directions of a 6-D Hessian (rotation, translation; body frame) that the points do not hold.

    scale (6,): multiplies a motion to make rotation a length (RMS distance of the points); directions (K, 6) unit rows of scaled motion.
    """

    scale: Array
    directions: Array


def degeneracy(hessian: Array, matches: float, points_body: Array, least_eigenvalue: float) -> Degeneracy:
    """Directions whose eigenvalue by match, rotation rows divided by the RMS point distance, is below `least_eigenvalue`."""
    rms = math.sqrt(float(np.mean(np.sum(points_body**2, axis=1))))
    scale = np.array([rms, rms, rms, 1.0, 1.0, 1.0])
    values, vectors = np.linalg.eigh(hessian / matches / np.outer(scale, scale))
    return Degeneracy(scale, vectors[:, values < least_eigenvalue].T)


def exp_motion(motion: Array) -> Array:
    """(4, 4) exponential of a (6,) motion: rotation vector, then translation in the tangent space (gtsam's Pose3.Expmap)."""
    return np.asarray(gtsam.Pose3.Expmap(motion).matrix())


def offset_between(T_reference_a: Array, T_reference_b: Array) -> Array:
    """(6,) rotation vector and translation from `a` to `b` in the body frame of `a`, each by itself: no path between far poses is meant."""
    T = inverse(T_reference_a) @ T_reference_b
    return np.concatenate([Rotation.from_matrix(T[:3, :3]).as_rotvec(), T[:3, 3]])


def known_directions(weak: Degeneracy, guess_covariance: Array | None, most_sigma_m: float) -> Degeneracy:
    """Those degenerate directions along which the guess is known to `most_sigma_m`, at the distance of a typical point."""
    if guess_covariance is None:
        return Degeneracy(weak.scale, np.zeros((0, 6)))
    along = weak.directions * weak.scale
    variances = np.einsum("ki,ij,kj->k", along, guess_covariance, along)
    return Degeneracy(weak.scale, weak.directions[variances <= most_sigma_m**2])


def keep_guess(T_guess: Array, T_matched: Array, weak: Degeneracy) -> Array:
    """The match, but the guess along the degenerate directions of the matched body frame (solution remapping)."""
    if len(weak.directions) == 0:
        return T_matched
    kept = weak.directions.T @ (weak.directions @ (weak.scale * offset_between(T_matched, T_guess))) / weak.scale
    T = T_matched.copy()
    T[:3, :3] = T_matched[:3, :3] @ Rotation.from_rotvec(kept[:3]).as_matrix()
    T[:3, 3] += T_matched[:3, :3] @ kept[3:]
    return T


def match_covariance(information_inverse: Array, weak: Degeneracy, config: RegistrationConfig) -> Array:
    """`information_inverse` (6, 6) with the floor added, and `DEGENERATE_SIGMA_M` in the directions that the points do not hold."""
    floor = np.diag([config.floor_rotation_rad**2] * 3 + [config.floor_translation_m**2] * 3)
    open_directions = weak.directions / weak.scale
    inflation = DEGENERATE_SIGMA_M**2 * open_directions.T @ open_directions
    covariance = information_inverse + floor + inflation
    return np.asarray(0.5 * (covariance + covariance.T))


def compile_kernels() -> None:
    """Compiles the kernels of the free-space check for the types that a match passes."""
    config, ahead = RegistrationConfig(), np.array([[1.0, 0.0, 0.0]])
    FreeSpace(PointCloud(ahead, np.zeros((1, 3))), PointCloud(ahead, np.zeros((1, 3))), np.zeros(3), config).contradiction(np.eye(4))
