"""The bias of the measured up directions: it is fixed in the body, gravity is fixed in the map, so headings tell them apart.

An accelerometer's bias b makes a resting robot measure up_body = R_map_body^T z + b. The graph's edges hold the rotations against each
other firmly, and their common tilt only by gravity itself; bias and tilt therefore are solved for together, in closed form, with the
rotations as they are. Solving for the bias alone would take hundreds of turns where headings are nearly alike.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pose_graph_mapping.graph.graph_measurements import Gravity

Array = NDArray[np.float64]

_Z_CROSS = np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 0.0]])
"""How the map's up direction moves when the map tilts about its x and y axes."""
_TILT_SIGMA_RAD = 0.2


def estimated_bias(poses: Array, gravity: Sequence[Gravity], prior_sigma_rad: float) -> Array:
    """(3,) the likeliest bias of unit up directions measured at vertices of `poses` (V, 4, 4), in the body frame.

    prior_sigma_rad of each of its axes; where all headings are alike the prior alone decides, for it: no bias, and the tilt is gravity's.
    """
    if not gravity or not prior_sigma_rad > 0.0:
        return np.zeros(3)
    R_body_map = poses[[m.vertex_id for m in gravity], :3, :3].transpose(0, 2, 1)
    up_body = R_body_map[:, :, 2]
    across = np.eye(3) - up_body[:, :, None] * up_body[:, None, :]  # a direction has no length that could differ
    residual = np.einsum("kij,kj->ki", across, np.array([m.up_body for m in gravity]) - up_body)
    rows = across @ np.concatenate([R_body_map @ _Z_CROSS, np.broadcast_to(np.eye(3), (len(gravity), 3, 3))], axis=2)
    weight = np.array([m.sigma_rad for m in gravity]) ** -2.0
    information = np.einsum("k,kri,krj->ij", weight, rows, rows)
    information[2:, 2:] += np.eye(3) / prior_sigma_rad**2
    information[:2, :2] += np.eye(2) / _TILT_SIGMA_RAD**2
    return np.asarray(np.linalg.solve(information, np.einsum("k,kri,kr->i", weight, rows, residual))[2:])
