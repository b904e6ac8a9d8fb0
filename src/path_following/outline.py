"""What lies beneath the robot's outline, or beneath its middle: the kernels that every question about a motion comes down to."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

INSCRIBED, LETHAL, UNKNOWN = 253, 254, 255
DEEPER_M = 0.01  # is no deeper: less than the points of a lattice lie apart


@njit(cache=True)
def cost_under(cost: NDArray[np.uint8], corner: NDArray[np.float64], x: float, y: float) -> int:
    """Cost at x, y m in map; 255 outside. `corner` (3,): x, y of the costmap's corner and its resolution, m."""
    column = math.floor((x - corner[0]) / corner[2] + 1e-9)
    row = math.floor((y - corner[1]) / corner[2] + 1e-9)
    if row < 0 or column < 0 or row >= cost.shape[0] or column >= cost.shape[1]:
        return 255
    return int(cost[row, column])


@njit(cache=True)
def beneath(
    cost: NDArray[np.uint8], corner: NDArray[np.float64], footprint: NDArray[np.float64], pose: NDArray[np.float64]
) -> tuple[int, int]:
    """How many of the points (P, 2) of base_link lie over lethal and over unknown cells, with base_link at `pose` (3,) in map."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    lethal, unknown = 0, 0
    for i in range(footprint.shape[0]):
        px, py = footprint[i, 0], footprint[i, 1]
        value = cost_under(cost, corner, pose[0] + c * px - s * py, pose[1] + s * px + c * py)
        lethal += value == LETHAL
        unknown += value == UNKNOWN
    return lethal, unknown


@njit(cache=True)
def deepest(cost: NDArray[np.uint8], corner: NDArray[np.float64], footprint: NDArray[np.float64], pose: NDArray[np.float64]) -> float:
    """How far inside its border a point of the outline lies over a lethal cell, with base_link at `pose` (3,) in map, m; 0 where none does.

    `footprint` (P, 2): points of base_link of a rectangle around it, whose last is a corner.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    deep = 0.0
    for px, py in footprint:
        inside = min(footprint[-1, 0] - abs(px), footprint[-1, 1] - abs(py))
        if inside > deep and cost_under(cost, corner, pose[0] + c * px - s * py, pose[1] + s * px + c * py) == LETHAL:
            deep = inside
    return deep


@njit(cache=True)
def is_no_more(count: float, fewest: float) -> bool:
    """Whether so many points over cells are no new contact, after so few: along a wall points of a lattice cross cell borders as the robot
    turns. A corner has few points, and each of them is five centimetres.
    """
    return bool(count <= fewest + fewest // 4)
