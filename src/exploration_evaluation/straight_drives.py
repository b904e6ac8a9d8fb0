"""Where the robot gets straight ahead with its true outline and has no room to turn: through doors, over narrow ramps, into dead ends.

Beside `truth` in the judge. From the border of the places where the centre turns the outline is swept along straight lines, at many
headings and a few offsets, until it meets a barrier. Places to turn that such a drive comes to are reached, and are started from in turn.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from exploration_evaluation.config import RobotShape
from exploration_evaluation.ground_grid import Floats, Grid, Ints, Mask, Surfaces, first_of

_HEADINGS = 48  # in a full turn: a passage of 0.9 m is found up to 1.8 m long, whichever way it lies, and every one along the axes
_OFFSETS = 3  # lines beside each other within a cell: a door is found wherever it lies between the places
_FARTHEST_M = 100.0


@dataclass(frozen=True)
class StraightDrives:
    """Pieces of ground to turn on that straight drives come to, (N,) their numbers; and the nodes under the outline on the way, (M,)."""

    pieces: Ints
    under: Mask


def straight_drives(grid: Grid, nodes: Surfaces, barriers: Floats, pieces: Ints, start_piece: int, robot: RobotShape) -> StraightDrives:
    """Drives from the piece of the start, and from all that these come to.

    barriers (B, 3). pieces (M,): the number of the connected piece of each node over which the centre can turn, -1 for other nodes.
    """
    column = grid.columns_of(barriers[:, :2])
    order = np.argsort(column, kind="stable")[np.count_nonzero(column < 0) :]
    things, first_thing = barriers[order], first_of(column[order], grid.nx * grid.ny)
    limits = np.array([grid.cell, 0.5 * robot.length_m, 0.5 * robot.width_m, robot.level_m, robot.rise_m(grid.cell)])
    frame = (grid.origin, np.array([grid.nx, grid.ny], dtype=np.int64), limits)
    under, border = np.zeros(len(pieces), dtype=np.bool_), _border(grid, nodes, pieces)
    known, todo = {start_piece}, [start_piece]
    while todo:
        met = np.zeros(int(pieces.max()) + 1, dtype=np.bool_)
        starts = np.flatnonzero(border & (pieces == todo.pop()))
        _drive(nodes.xyz, nodes.first, (things, first_thing), frame, pieces, starts, (met, under))
        found = set(np.flatnonzero(met).tolist()) - known
        known |= found
        todo += sorted(found)
    return StraightDrives(np.array(sorted(known), dtype=np.int64), under)


def _border(grid: Grid, nodes: Surfaces, pieces: Ints) -> Mask:
    """(M,) places beside which, or beside a neighbour of which, the centre cannot turn."""
    places = np.zeros((grid.nx + 2, grid.ny + 2), dtype=np.int64)
    i, j = nodes.column // grid.ny + 1, nodes.column % grid.ny + 1
    np.add.at(places, (i[pieces >= 0], j[pieces >= 0]), 1)
    around = np.min([places[i + di, j + dj] for di in (-1, 0, 1) for dj in (-1, 0, 1)], axis=0)
    return np.asarray((around < places[i, j]) | (around == 0))


Things = tuple[Floats, Ints]
Frame = tuple[Floats, Ints, Floats]


@njit(cache=True)
def _drive(xyz: Floats, first: Ints, things: Things, frame: Frame, pieces: Ints, starts: Ints, found: tuple[Mask, Mask]) -> None:
    """Sweeps the outline from every start in all directions; marks the pieces that it meets and the nodes that it passes over."""
    met, under = found
    limits = frame[2]
    cell, half_length = limits[0], limits[1]
    step = 0.5 * cell
    for start in starts:
        for line in range(_HEADINGS * _OFFSETS):
            angle, aside = 2.0 * math.pi * (line // _OFFSETS) / _HEADINGS, ((line % _OFFSETS + 0.5) / _OFFSETS - 0.5) * cell
            u = (math.cos(angle), math.sin(angle))
            x, y, z = xyz[start, 0] - aside * u[1], xyz[start, 1] + aside * u[0], xyz[start, 2]
            beside = _surface_at(xyz, first, frame, (xyz[start, 0] + cell * u[0], xyz[start, 1] + cell * u[1], z))
            if beside < 0 or pieces[beside] >= 0:
                continue
            for _ in range(int(_FARTHEST_M / step)):
                x, y = x + step * u[0], y + step * u[1]
                node = _surface_at(xyz, first, frame, (x, y, z))
                if node < 0:
                    break
                z = xyz[node, 2]
                if _is_blocked(things, frame, (x, y, z), u, half_length - step):
                    break
                _mark_front(xyz, first, frame, (x, y, z), u, under)
                if node != start and pieces[node] >= 0:
                    met[pieces[node]] = True
                    break


@njit(cache=True)
def _surface_at(xyz: Floats, first: Ints, frame: Frame, at: tuple[float, float, float]) -> int:
    """The surface under a place, no farther from its height than ground rises over a cell; -1 for none."""
    origin, shape, limits = frame
    i, j = int(math.floor((at[0] - origin[0]) / limits[0])), int(math.floor((at[1] - origin[1]) / limits[0]))
    if i < 0 or j < 0 or i >= shape[0] or j >= shape[1]:
        return -1
    nearest, best = -1, limits[4] + 1e-4
    for n in range(first[i * shape[1] + j], first[i * shape[1] + j + 1]):
        if abs(xyz[n, 2] - at[2]) < best:
            nearest, best = n, abs(xyz[n, 2] - at[2])
    return nearest


@njit(cache=True)
def _columns_under(frame: Frame, at: tuple[float, float, float], u: tuple[float, float], back: float) -> tuple[int, int, int, int]:
    """First and last column, along x and along y, that the outline's part before `back` may touch; the last before the first for none."""
    origin, shape, limits = frame
    cell, front, half_width = limits[0], limits[1], limits[2]
    reach_x, reach_y = abs(u[1]) * half_width, abs(u[0]) * half_width
    x0, x1 = at[0] + min(back * u[0], front * u[0]) - reach_x, at[0] + max(back * u[0], front * u[0]) + reach_x
    y0, y1 = at[1] + min(back * u[1], front * u[1]) - reach_y, at[1] + max(back * u[1], front * u[1]) + reach_y
    i0, j0 = int(math.floor((x0 - origin[0]) / cell)), int(math.floor((y0 - origin[1]) / cell))
    i1, j1 = int(math.floor((x1 - origin[0]) / cell)), int(math.floor((y1 - origin[1]) / cell))
    return max(0, i0), min(shape[0] - 1, i1), max(0, j0), min(shape[1] - 1, j1)


@njit(cache=True)
def _is_under(point: Floats, limits: Floats, at: tuple[float, float, float], u: tuple[float, float], back: float) -> bool:
    """Whether a point lies under the outline's part before `back`, on about its level."""
    dx, dy = point[0] - at[0], point[1] - at[1]
    along, across = dx * u[0] + dy * u[1], dy * u[0] - dx * u[1]
    inside = along > back and along <= limits[1] and abs(across) < limits[2] - 1e-6
    return bool(inside and abs(point[2] - at[2]) <= limits[3])


@njit(cache=True)
def _is_blocked(things: Things, frame: Frame, at: tuple[float, float, float], u: tuple[float, float], back: float) -> bool:
    points, first = things
    i0, i1, j0, j1 = _columns_under(frame, at, u, back)
    for i in range(i0, i1 + 1 if j0 <= j1 else i0):
        column = i * frame[1][1]
        for b in range(first[column + j0], first[column + j1 + 1]):
            if _is_under(points[b], frame[2], at, u, back):
                return True
    return False


@njit(cache=True)
def _mark_front(xyz: Floats, first: Ints, frame: Frame, at: tuple[float, float, float], u: tuple[float, float], under: Mask) -> None:
    back = frame[2][1] - 0.5 * frame[2][0]
    i0, i1, j0, j1 = _columns_under(frame, at, u, back)
    for i in range(i0, i1 + 1 if j0 <= j1 else i0):
        column = i * frame[1][1]
        for n in range(first[column + j0], first[column + j1 + 1]):
            if not under[n] and _is_under(xyz[n], frame[2], at, u, back):
                under[n] = True
