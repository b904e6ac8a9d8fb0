"""The one interface of cloud matching, behind service `match_clouds`: what goes in, what comes out, which implementations there are.

The mapper (Algorithm 1, line 16) and the loop closure (Algorithm 2, line 15) call it and know nothing of what is behind.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pose_graph_mapping.registration.cloud import PointCloud
from rigid_geometry import as_transform

Array = NDArray[np.float64]
MAX_ITERATIONS = 20  # most iterations of a stage; along a corridor more of them only slide
MIN_POINTS = 200  # fewest points of a cloud after voxelling that are matched


class Verdict(enum.Enum):
    """What may be made of a match."""

    ACCEPTED = "accepted"
    DEGENERATE = "degenerate"
    """Right, but some directions are the guess's own: covariance is large there. Good for an edge, not for a loop."""
    AMBIGUOUS = "ambiguous"
    """Several placements explain the clouds equally well, and the guess is not known well enough to choose among them."""
    REFUSED = "refused"


@dataclass(frozen=True, eq=False)
class RegistrationResult:
    """Outcome of one match; numbers that could not be had are NaN.

    T_reference_reading (4, 4), not verified where it was refused, and the guess itself when nothing could be matched (match_ratio is NaN
    then); reason: of a refusal which limit was broken, and by how much; covariance (6, 6) in gtsam's order
    (rotation rad, translation m) of the reading's body frame; match_ratio: share of reading points that took part; overlap: share near
    the reference; free_space_contradiction: share of points in space the other cloud saw free, the worse direction;
    degenerate_directions (K, 6) unit rows in the covariance's order, rotation scaled by the RMS distance of the points; rivals (R, 4, 4):
    other placements that explain the clouds as well.
    """

    T_reference_reading: Array
    covariance: Array
    match_ratio: float
    overlap: float
    free_space_contradiction: float
    iterations: int
    degenerate_directions: Array
    verdict: Verdict
    reason: str
    rivals: Array = field(default_factory=lambda: np.zeros((0, 4, 4)))

    @property
    def usable(self) -> bool:
        """Whether an edge may be made of the transform and its covariance."""
        return self.verdict in (Verdict.ACCEPTED, Verdict.DEGENERATE)


class Registration(Protocol):
    """Anything that finds the transform between two overlapping clouds."""

    def match(
        self,
        reference: PointCloud,
        reading: PointCloud,
        T_reference_reading_guess: Array,
        guess_covariance: Array | None = None,
    ) -> RegistrationResult:
        """Match `reading` (in its body frame) to `reference`; ValueError for clouds that are empty or a guess that is not rigid.

        guess_covariance (6, 6) of the guess, in the order of the result's; None: nothing is known, and the guess chooses between no
        two placements.
        """
        ...


def asked(reference: PointCloud, reading: PointCloud, T_guess: Array) -> Array:
    """The (4, 4) guess of a match that can be made; ValueError for clouds that are empty or a guess that is not rigid."""
    if len(reference) == 0 or len(reading) == 0:
        raise ValueError(f"clouds to match must hold points: reference has {len(reference)}, reading {len(reading)}")
    return as_transform(T_guess)


def refused(T_guess: Array, reason: str) -> RegistrationResult:
    """The result of a match that could not be made; its covariance is NaN, for nothing is known."""
    nan = float("nan")
    return RegistrationResult(T_guess, np.full((6, 6), nan), nan, nan, nan, 0, np.zeros((0, 6)), Verdict.REFUSED, reason)


__all__ = ["PointCloud", "Registration", "RegistrationResult", "Verdict", "asked", "refused"]
