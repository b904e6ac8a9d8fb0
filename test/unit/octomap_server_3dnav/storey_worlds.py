"""Places where ground lies above ground, as literal maps: a ramp that one can drive under, a spiral over itself, a bridge."""

import math

import numpy as np
from numpy.typing import NDArray
from terrain_worlds import BELOW, FREE, OCCUPIED, RESOLUTION, UNKNOWN

THICK = 2  # voxels of a slab
BLOCK = 9  # voxels that a block is high
RISE = 3  # columns along a ramp for each voxel that it rises: 18 degrees
HIGH = 24  # voxels from floor to deck, and from turn to turn
WAY = slice(32, 58)  # columns across a ramp and its deck
TURN_M, ROUND_M = (1.6, 3.4), (3.6, 4.4)  # inner and outer radius of the spiral, and its middle


def floor(nx: int, ny: int, top: int = 2 * HIGH + 30) -> NDArray[np.uint8]:
    """Level ground, its surface at height 0.08 m, with free space above."""
    states = np.full((nx, ny, BELOW + top), FREE)
    states[:, :, :BELOW], states[:, :, BELOW] = UNKNOWN, OCCUPIED
    return states


def raise_to(states: NDArray[np.uint8], x: int, y: int | slice, level: int) -> None:
    """A slab over a column or a row, its surface `level` voxels above the floor's."""
    states[x, y, BELOW + max(1, level - THICK + 1) : BELOW + level + 1] = OCCUPIED


def stand_on(states: NDArray[np.uint8], x: slice, y: slice, level: int) -> None:
    """A block on the ground of that level."""
    states[x, y, BELOW + level + 1 : BELOW + level + 1 + BLOCK] = OCCUPIED


def ramp_to_drive_under() -> NDArray[np.uint8]:
    """Up along x to a deck that ends in free air; a block stands on the floor below the deck."""
    states = floor(150, 90)
    for x in range(20, 140):
        raise_to(states, x, WAY, min((x - 20) // RISE, HIGH))
    stand_on(states, slice(112, 120), slice(36, 42), 0)
    return states


def bridge() -> NDArray[np.uint8]:
    """Up along x, level, and down again; a block stands on the bridge and one on the floor below, elsewhere."""
    states = floor(200, 90)
    for x in range(10, 190):
        raise_to(states, x, WAY, min((x - 10) // RISE, (190 - x) // RISE, HIGH))
    stand_on(states, slice(96, 102), slice(36, 41), HIGH)
    stand_on(states, slice(104, 110), slice(49, 54), 0)
    return states


def spiral() -> NDArray[np.uint8]:
    """Two turns around a hole, each `HIGH` voxels over the one below; on the first one a block stands half way round."""
    states = floor(round(2 * ROUND_M[0] / RESOLUTION), 110)
    for x, y in np.ndindex(*states.shape[:2]):
        radius, turn = around(x, y)
        for level in (turn * HIGH, (turn + 1) * HIGH):
            if TURN_M[0] <= radius <= TURN_M[1]:
                raise_to(states, x, y, int(level))
    stand_on(states, slice(17, 22), slice(54, 58), HIGH // 2)
    return states


def around(x: int, y: int) -> tuple[float, float]:
    """Distance in metres of a column from the middle of the spiral, and its part of a turn from where that leaves the floor, 0 to 1."""
    dx, dy = (x + 0.5) * RESOLUTION - ROUND_M[0], (y + 0.5) * RESOLUTION - ROUND_M[1]
    return math.hypot(dx, dy), math.atan2(dy, dx) / (2 * math.pi) % 1.0
