"""The shortest way of the outline out of where there is no room to turn, by arcs forward and backward: beside a wall, as after a slide.

A hybrid A* (Dolgov et al. 2010) without a heuristic: what it looks for is near. Asked by `surroundings`, on one costmap.
"""

import heapq
import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from path_following.outline import DEEPER_M, beneath, deepest, is_no_more

_STEP_M = 0.2
_CURVATURES = (0.0, 0.15, -0.15, 0.5, -0.5, 1.5, -1.5)  # 1/m: beside a wall only gentle arcs keep the rear corner off it
_LOOKS = 3  # poses of an arc at which the outline is looked at
_TURNED_BACK_M = 0.3  # of way is a change between forward and backward worth
_CELL_M, _SIDE, _HEADINGS = 0.1, 50, 240  # of the places that count as one: the gentlest arc ends at another heading
_MOST = 20_000  # nodes

MOVES = np.array([(sign * _STEP_M, curvature) for sign in (1.0, -1.0) for curvature in _CURVATURES])


@njit(cache=True)
def _cell_of(pose: NDArray[np.float64], start: NDArray[np.float64], count: int) -> tuple[int, int, int]:
    """The place among those that count as one, around `start`, of `count` headings; negative outside."""
    i, j = math.floor((pose[0] - start[0]) / _CELL_M + _SIDE / 2), math.floor((pose[1] - start[1]) / _CELL_M + _SIDE / 2)
    if min(i, j) < 0 or max(i, j) >= _SIDE:
        return -1, -1, -1
    return i, j, int(math.floor(pose[2] / (2.0 * math.pi) * count)) % count


@njit(cache=True)
def _drive(
    cost: NDArray[np.uint8],
    corner: NDArray[np.float64],
    footprint: NDArray[np.float64],
    aside: NDArray[np.float64],
    move: NDArray[np.float64],
    pose: NDArray[np.float64],
    touched: NDArray[np.float64],
) -> bool:
    """Whether one of `MOVES` touches no more than before; moves `pose` (3,).

    `touched` (3,): the fewest lethal and unknown points beneath so far, which are lowered, and how deep a lethal one may lie, m.
    """
    for _ in range(_LOOKS):
        travelled = move[0] / _LOOKS
        turned = move[1] * travelled
        middle = pose[2] + 0.5 * turned
        slid = aside[int(math.floor(middle / (2.0 * math.pi) * aside.size)) % aside.size] * abs(turned)
        pose[0] += travelled * math.cos(middle) - slid * math.sin(middle)
        pose[1] += travelled * math.sin(middle) + slid * math.cos(middle)
        pose[2] += turned
        here = beneath(cost, corner, footprint, pose)
        for k in range(2):
            if not is_no_more(here[k], touched[k]):
                return False
            touched[k] = min(touched[k], here[k])
        if here[0] > 0 and deepest(cost, corner, footprint, pose) > touched[2]:
            return False
    return True


@njit(cache=True)
def _moves_to(node: int, before: NDArray[np.int64], by: NDArray[np.int64]) -> NDArray[np.int64]:
    """(K,) the moves from the start to a node."""
    way = [by[node] for _ in range(0)]
    while before[node] >= 0:
        way.append(by[node])
        node = before[node]
    return np.array(way[::-1], np.int64)


@njit(cache=True)
def free_way(
    cost: NDArray[np.uint8],
    corner: NDArray[np.float64],
    footprint: NDArray[np.float64],
    room: NDArray[np.float64],
    start: NDArray[np.float64],
    aside: NDArray[np.float64],
) -> NDArray[np.int64]:
    """(K,) int64 indices into `MOVES` from `start` (3,) x, y, yaw in map to where nothing lies in `room`; none where there is no such way.

    `corner` (3,): x, y of the costmap's corner and its resolution, m. `footprint` and `room` (P, 2) are points of base_link. `aside` (H,):
    metres that the robot slides to its left for every radian, by its heading. Touched may be no more than before, and no deeper.
    """
    at, touched = np.empty((_MOST, 3)), np.empty((_MOST, 3))
    before, by, count = np.full(_MOST, -1, np.int64), np.full(_MOST, -1, np.int64), 1
    at[0], touched[0, 2] = start, deepest(cost, corner, footprint, start) + DEEPER_M
    touched[0, 0], touched[0, 1] = beneath(cost, corner, footprint, start)
    closed = np.zeros((_SIDE, _SIDE, aside.size), np.bool_)
    heap = [(0.0, 0)]
    while len(heap) > 0:
        total, node = heapq.heappop(heap)
        cell = _cell_of(at[node], start, aside.size)
        if cell[0] < 0 or closed[cell]:
            continue
        closed[cell] = True
        if node > 0 and max(beneath(cost, corner, room, at[node])) == 0:
            return _moves_to(node, before, by)
        for move in range(MOVES.shape[0]):
            if count == _MOST:
                return np.empty(0, np.int64)
            at[count], touched[count] = at[node], touched[node]
            if _drive(cost, corner, footprint, aside, MOVES[move], at[count], touched[count]):
                is_back = by[node] >= 0 and MOVES[by[node], 0] * MOVES[move, 0] < 0.0
                before[count], by[count] = node, move
                heapq.heappush(heap, (total + _STEP_M + (_TURNED_BACK_M if is_back else 0.0), count))
                count += 1
    return np.empty(0, np.int64)


def headings() -> NDArray[np.float64]:
    """(H,) rad, the middles of the headings that `aside` of `free_way` is given for."""
    return np.asarray((np.arange(_HEADINGS) + 0.5) * (2.0 * math.pi / _HEADINGS))
