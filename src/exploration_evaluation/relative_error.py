"""Estimated poses beside the true ones of the same stamps, and how far the motion from each to the next is off.

Between the two trajectories of a run and its scores. The relative error needs no alignment: a map that bends slowly has a
large absolute error and a small relative one, a single bad match the reverse.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from rigid_geometry import interpolate_transforms

Floats = NDArray[np.float64]

_STAMP_TOLERANCE_S = 0.051


@dataclass(frozen=True)
class MatchedPoses:
    """Estimated poses (N, 4, 4) T_map_base, the true ones (N, 4, 4) T_world_base at their (N,) stamps, and how many have no truth."""

    stamps: Floats
    estimate: Floats
    truth: Floats
    unmatched: int


@dataclass(frozen=True)
class RelativeError:
    """RMS of the errors of the motions between consecutive poses."""

    translation_rms_m: float
    rotation_rms_rad: float


def matched_poses(stamps: ArrayLike, T_est: ArrayLike, stamps_truth: ArrayLike, T_truth: ArrayLike) -> MatchedPoses:
    """The (N, 4, 4) estimated poses that have a truth, which is interpolated between (M, 4, 4) true poses.

    Stamps are seconds; true ones increase. ValueError when no stamp has a truth, or for another number of stamps than poses.
    """
    at, poses = np.asarray(stamps, dtype=np.float64), checked_poses(T_est)
    at_truth, truth = np.asarray(stamps_truth, dtype=np.float64), checked_poses(T_truth)
    if len(at) != len(poses) or len(at_truth) != len(truth) or not len(truth):
        raise ValueError(f"every pose needs a stamp: {len(at)} for {len(poses)} estimated, {len(at_truth)} for {len(truth)} true poses")
    known = (at >= at_truth[0] - _STAMP_TOLERANCE_S) & (at <= at_truth[-1] + _STAMP_TOLERANCE_S)
    if not known.any():
        raise ValueError(f"none of {len(at)} estimated poses lies within the truth's {at_truth[0]:.2f}..{at_truth[-1]:.2f} s")
    true_poses = interpolate_transforms(at_truth, truth, np.clip(at[known], at_truth[0], at_truth[-1]))
    return MatchedPoses(at[known], poses[known], true_poses, int((~known).sum()))


def relative_pose_error(T_est: ArrayLike, T_truth: ArrayLike) -> RelativeError:
    """Relative pose error of (N, 4, 4) estimated against (N, 4, 4) true poses at the same stamps, each pose with the next.

    What is left when the true motion is taken off the estimated one, as evo's RPE (delta of one frame) and Sturm et al. 2012,
    equation 2, define it. ValueError for fewer than two poses.
    """
    estimate, truth = checked_poses(T_est), checked_poses(T_truth)
    if len(estimate) != len(truth) or len(truth) < 2:
        raise ValueError(f"a relative error needs two poses or more, and as many true ones, not {len(estimate)} and {len(truth)}")
    error = np.linalg.inv(_motions(truth)) @ _motions(estimate)
    angles = Rotation.from_matrix(error[:, :3, :3]).magnitude()
    return RelativeError(rms(np.linalg.norm(error[:, :3, 3], axis=1)), rms(angles))


def _motions(poses: Floats) -> Floats:
    return np.asarray(np.linalg.inv(poses[:-1]) @ poses[1:])


def checked_poses(values: ArrayLike) -> Floats:
    """(N, 4, 4) float64 poses; ValueError for another shape, or numbers that are not finite."""
    poses = np.asarray(values, dtype=np.float64)
    if poses.ndim != 3 or poses.shape[1:] != (4, 4) or not np.isfinite(poses).all():
        raise ValueError(f"poses are finite and of shape (N, 4, 4), not {poses.shape}")
    return poses


def rms(values: Floats) -> float:
    """Root of the mean square of (N,) values."""
    return float(np.sqrt(np.mean(np.square(values))))
