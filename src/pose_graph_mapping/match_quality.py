"""Is a match right? Overlap, two-way free space and degeneracy: the judgement that both registrations share.

Overlap alone does not tell right from wrong; points that lie where the other cloud looked through do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import gtsam
import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from pose_graph_mapping.cloud import PointCloud, viewpoints
from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration import Verdict
from rigid_geometry import inverse

Array = NDArray[np.float64]

_ROWS, _COLUMNS = 180, 360


@njit(cache=True)
def _cell(dx: float, dy: float, dz: float, distance: float) -> tuple[int, int]:
    row = int((math.asin(max(-1.0, min(1.0, dz / distance))) + 0.5 * math.pi) * (_ROWS / math.pi))
    column = int((math.atan2(dy, dx) + math.pi) * (_COLUMNS / (2.0 * math.pi)))
    return min(row, _ROWS - 1), min(column, _COLUMNS - 1)


@njit(cache=True)
def _nearest_by_cell(points: Array, eye: Array) -> Array:
    image = np.full((_ROWS, _COLUMNS), np.inf)
    for i in range(len(points)):
        dx, dy, dz = points[i, 0] - eye[0], points[i, 1] - eye[1], points[i, 2] - eye[2]
        distance = math.sqrt(dx * dx + dy * dy + dz * dz)
        if distance > 1e-3:
            row, column = _cell(dx, dy, dz, distance)
            image[row, column] = min(image[row, column], distance)
    return image


@njit(cache=True)
def _count_in_front(points: Array, eye: Array, image: Array, margin_m: float, margin_ratio: float) -> tuple[int, int]:
    compared = 0
    in_front = 0
    for i in range(len(points)):
        dx, dy, dz = points[i, 0] - eye[0], points[i, 1] - eye[1], points[i, 2] - eye[2]
        distance = math.sqrt(dx * dx + dy * dy + dz * dz)
        if distance <= 1e-3:
            continue
        row, column = _cell(dx, dy, dz, distance)
        seen = image[row, column]
        if seen < np.inf:
            compared += 1
            if distance < seen - margin_m - margin_ratio * seen:
                in_front += 1
    return compared, in_front


def range_image(points: Array, eye: Array) -> Array:
    """(180, 360) nearest distance in every degree as seen from `eye` (3,), minimum of 3 x 3 cells; inf where nothing was seen."""
    return np.asarray(minimum_filter(_nearest_by_cell(points, eye), size=3, mode=("nearest", "wrap")))


def _one_way(observer: PointCloud, others: Array, near: Array, config: RegistrationConfig) -> tuple[int, int]:
    """Points compared with, and in front of, what `observer` saw from its standpoints (those nearest to `near`)."""
    assert observer.origins is not None
    eyes, index = viewpoints(observer.origins)
    order = np.argsort(np.linalg.norm(eyes - near, axis=1), kind="stable")[: config.free_space_viewpoints]
    compared = in_front = 0
    for k in order:
        image = range_image(observer.points[index == k], eyes[k])
        counts = _count_in_front(others, eyes[k], image, config.free_space_margin_m, config.free_space_margin_ratio)
        compared, in_front = compared + counts[0], in_front + counts[1]
    return compared, in_front


def free_space_contradiction(reference: PointCloud, reading: PointCloud, T_reference_reading: Array, config: RegistrationConfig) -> float:
    """Share of the points of one cloud that lie in space the other saw free, the worse of both directions; NaN without origins.

    Only directions in which the observer saw something count; nothing in common gives NaN too.
    """
    if reference.origins is None or reading.origins is None:
        return float("nan")
    moved = reading.transformed(T_reference_reading)
    assert moved.origins is not None
    sensor = moved.origins.mean(axis=0)
    ways = [_one_way(moved, reference.points, sensor, config), _one_way(reference, moved.points, sensor, config)]
    if any(compared == 0 for compared, _ in ways):
        return float("nan")
    return max(in_front / compared for compared, in_front in ways)


@dataclass(frozen=True, eq=False)
class Degeneracy:
    """Directions of a 6-D Hessian (rotation, translation; body frame) that the points do not hold.

    scale (6,): multiplies a motion to make rotation a length (RMS distance of the points); directions (K, 6) unit rows of scaled motion.
    """

    scale: Array
    directions: Array


def degeneracy(hessian: Array, matches: int, points_body: Array, least_eigenvalue: float) -> Degeneracy:
    """Directions whose eigenvalue by match, rotation rows divided by the RMS point distance, is below `least_eigenvalue`."""
    rms = math.sqrt(float(np.mean(np.sum(points_body**2, axis=1))))
    scale = np.array([rms, rms, rms, 1.0, 1.0, 1.0])
    values, vectors = np.linalg.eigh(hessian / matches / np.outer(scale, scale))
    return Degeneracy(scale, vectors[:, values < least_eigenvalue].T)


def exp_motion(motion: Array) -> Array:
    """(4, 4) exponential of a (6,) motion: rotation vector, then translation in the tangent space (gtsam's Pose3.Expmap)."""
    return np.asarray(gtsam.Pose3.Expmap(motion).matrix())


def log_motion(T: Array) -> Array:
    """(6,) logarithm of a transform, the inverse of `exp_motion`."""
    return np.asarray(gtsam.Pose3.Logmap(gtsam.Pose3(T)))


def keep_guess(T_guess: Array, T_matched: Array, weak: Degeneracy) -> Array:
    """The match without its motion along the degenerate directions: there the guess stands (solution remapping)."""
    if len(weak.directions) == 0:
        return T_matched
    motion = weak.scale * log_motion(inverse(T_guess) @ T_matched)
    motion = motion - weak.directions.T @ (weak.directions @ motion)
    return T_guess @ exp_motion(motion / weak.scale)


def match_covariance(information_inverse: Array, weak: Degeneracy, config: RegistrationConfig) -> Array:
    """`information_inverse` (6, 6) with the floor added, and `degenerate_sigma_m` in the directions that the guess filled."""
    floor = np.diag([config.floor_rotation_rad**2] * 3 + [config.floor_translation_m**2] * 3)
    open_directions = weak.directions / weak.scale
    inflation = config.degenerate_sigma_m**2 * open_directions.T @ open_directions
    covariance = information_inverse + floor + inflation
    return np.asarray(0.5 * (covariance + covariance.T))


def judge(ratio: float, overlap: float, contradiction: float, weak: Degeneracy, config: RegistrationConfig) -> tuple[Verdict, str]:
    """Verdict and its reason; what could not be checked is refused."""
    if config.verdict == "match_ratio":
        accepted = ratio >= config.min_match_ratio
        return (Verdict.ACCEPTED if accepted else Verdict.REFUSED), f"match ratio {ratio:.2f}, wanted {config.min_match_ratio}"
    if overlap < config.min_overlap:
        return Verdict.REFUSED, f"overlap {overlap:.2f} is below {config.min_overlap}"
    if math.isnan(contradiction):
        return Verdict.REFUSED, "free space cannot be checked: no beam origins, or no common field of view"
    if contradiction > config.max_contradiction:
        allowed = f"{100 * config.max_contradiction:.2f} %"
        return Verdict.REFUSED, f"{100 * contradiction:.2f} % of the points lie in space seen free, allowed are {allowed}"
    if len(weak.directions):
        return Verdict.DEGENERATE, f"{len(weak.directions)} directions are not held by the points and keep the guess"
    return Verdict.ACCEPTED, f"overlap {overlap:.2f}, contradiction {100 * contradiction:.2f} %"


def compile_kernels() -> None:
    """Compiles the kernels of the free-space check for the types that a match passes."""
    config, ahead = RegistrationConfig(), np.array([[1.0, 0.0, 0.0]])
    _count_in_front(ahead, np.zeros(3), range_image(ahead, np.zeros(3)), config.free_space_margin_m, config.free_space_margin_ratio)
