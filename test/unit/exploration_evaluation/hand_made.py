"""A room and a map of it with three faults, so plain that every score is found on paper.

The world is a floor of 6 x 4 m between four walls of 2 m. The map has a voxel of 0.1 m on every tenth of a metre of their
surfaces, save that a square metre of the floor is missing, another one is raised by 0.3 m, and the wall at x = 6 is 0.05 m too far
out. Map and world have the same frame.

    4 +-----------------------+
      |                       | :
      |    hole      plate    | :  shifted
      |    1.5..2.5  4..5     | :  wall
      |                       | :
    0 +-----------------------+
      0                       6
"""

from dataclasses import dataclass

import numpy as np
from hand_made_worlds import Mesh, room
from numpy.typing import NDArray

Floats = NDArray[np.float64]

WORLD: Mesh = room(6, 4)
START = (3.0, 2.0, 0.132)
VOXEL_M = 0.1
HOLE = (1.5, 1.5, 2.5, 2.5)
PLATE = (4.0, 1.5, 5.0, 2.5)
RAISED_M = 0.3
SHIFTED_M = 0.05


@dataclass(frozen=True)
class HandMadeMap:
    """Centres (N, 3) of voxels by what they are; the hole has none."""

    floor: Floats
    plate: Floats
    walls: Floats
    shifted_wall: Floats

    @property
    def voxels(self) -> Floats:
        """All (N, 3) of them."""
        return np.vstack([self.floor, self.plate, self.walls, self.shifted_wall])


def hand_made_map() -> HandMadeMap:
    """2200 voxels of floor, 100 of the raised plate, 3200 of three walls and 800 of the shifted one."""
    x, y, z = (np.arange(0.5 * VOXEL_M, length, VOXEL_M) for length in (6.0, 4.0, 2.0))
    floor = _lattice(x, y, [0.0])
    hole, raised = _inside(floor, HOLE), _inside(floor, PLATE)
    walls = np.vstack([_lattice(x, [0.0], z), _lattice(x, [4.0], z), _lattice([0.0], y, z)])
    return HandMadeMap(floor[~hole & ~raised], floor[raised] + [0.0, 0.0, RAISED_M], walls, _lattice([6.0 + SHIFTED_M], y, z))


def _lattice(x: Floats | list[float], y: Floats | list[float], z: Floats | list[float]) -> Floats:
    return np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)


def _inside(points: Floats, rectangle: tuple[float, float, float, float]) -> NDArray[np.bool_]:
    x0, y0, x1, y1 = rectangle
    return (points[:, 0] > x0) & (points[:, 0] < x1) & (points[:, 1] > y0) & (points[:, 1] < y1)
