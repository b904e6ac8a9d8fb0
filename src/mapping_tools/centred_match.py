"""A match in a frame that stands where the reading was seen from, for clouds whose own frame lies far away, as in map coordinates.

A match searches around the origin of the reading's frame and turns about it: what is a degree there must not be metres at the points.
"""

from __future__ import annotations

from dataclasses import replace

import gtsam
import numpy as np
from numpy.typing import NDArray

from pose_graph_mapping.registration.cloud import PointCloud
from pose_graph_mapping.registration.matching import Registration, RegistrationResult
from rigid_geometry import inverse, transform_from_rpy

Array = NDArray[np.float64]


def centre_of(reading: PointCloud) -> Array:
    """(3,) the mean of the beam origins; of the points where those are not known."""
    return np.asarray((reading.points if reading.origins is None else reading.origins).mean(axis=0))


def carried(T_a_b: Array, covariance_b: Array) -> Array:
    """(6, 6) the covariance of a pose, given in its body frame b, in the body frame a that is rigidly tied to it."""
    adjoint = gtsam.Pose3(T_a_b).AdjointMap()
    moved = adjoint @ covariance_b @ adjoint.T
    return np.asarray(0.5 * (moved + moved.T))


def match_centred(
    matcher: Registration, reference: PointCloud, reading: PointCloud, T_reference_reading_guess: Array, guess_covariance: Array | None
) -> RegistrationResult:
    """`Registration.match`, with arguments and result in the reading's own frame, except `degenerate_directions`: about its centre."""
    T_reading_centre = transform_from_rpy(centre_of(reading))
    T_centre_reading = inverse(T_reading_centre)
    result = matcher.match(
        reference,
        reading.transformed(T_centre_reading),
        T_reference_reading_guess @ T_reading_centre,
        None if guess_covariance is None else carried(T_centre_reading, guess_covariance),
    )
    return replace(
        result,
        T_reference_reading=result.T_reference_reading @ T_centre_reading,
        covariance=carried(T_reading_centre, result.covariance),
        rivals=result.rivals @ T_centre_reading,
    )
