"""Polylines of straight legs."""

import numpy as np
from numpy.typing import NDArray

_BEND_RAD = 0.02  # a direction that changes by less is the same: over a metre, two centimetres aside


def legs_of(points: NDArray[np.float64]) -> list[tuple[int, int]]:
    """First and last index of every straight leg of a polyline (K, 2) or (K, 3), as seen from above; each begins where the last ends."""
    along = np.diff(points[:, :2], axis=0)
    legs, begin, direction = [], 0, None
    for i, step in enumerate(along):
        if np.hypot(*step) < 1e-9:
            continue
        if direction is not None and abs(np.arctan2(direction[0] * step[1] - direction[1] * step[0], direction @ step)) > _BEND_RAD:
            legs.append((begin, i))
            begin = i
        direction = step
    return [*legs, (begin, len(points) - 1)] if len(points) > 1 else []
