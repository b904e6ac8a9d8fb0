"""The beams of one sweep, as the octree's builder takes and keeps them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Bounds = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Lowest and highest corner."""


@dataclass(frozen=True, eq=False)
class Beams:
    """One sweep in base_link: hits and their origins (N, 3) float32, ends and origins of beams that met nothing (M, 3) float32."""

    points: NDArray[np.float32]
    origins: NDArray[np.float32]
    free_ends: NDArray[np.float32]
    free_origins: NDArray[np.float32]


def inside(points: NDArray[np.float32], bounds: Bounds) -> NDArray[np.float32]:
    """The points (N, 3) between two corners."""
    return points[((points >= bounds[0]) & (points <= bounds[1])).all(axis=1)]
