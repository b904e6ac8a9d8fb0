"""The way against the shortest one: how long the robot had to drive over true ground to sweep where it did, in that order.

The ground of `truth` is taken as a graph over the places of the robot's centre. A place is joined to those in 32 directions,
over the cells between them: a way is at most 1.3 % longer than over a plane without cells, 0.5 % on average, so that a
ratio to it is too low by as much. A robot that passes closer to things than it needs to turn may be shorter still.
Where there is no room to turn the robot drives straight, and a leg from or to such a place is as long as the line.
"""

from itertools import pairwise, product

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from exploration_evaluation.truth import ReachableGround

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

# Straight lines from cell to cell, as steps along the first and the second axis; with both axes and signs, 32 directions.
_LINES = ("0", "01", "010", "0010", "01010")
_JOIN_M = 0.36  # a robot in the middle of things is nearer to them than it may turn: by its radii's difference, and a cell
_STRAIGHT_M = 2.8  # no leg where there is no room to turn is longer: the robot sweeps before
_LEAST_WAY_M = 0.5
_BELOW_M, _ABOVE_M = -0.1, 0.5  # a place's height above its ground


def shortest_length(ground: ReachableGround, places: ArrayLike) -> float:
    """Metres of the shortest way over the ground through (S, 3) places, world frame, in their order.

    A place is a point of the robot, at most half a metre above the ground. ValueError for fewer than two, and for one that is not
    over reachable ground, nor so near to it or to the places before and behind that the robot may have been there without room to turn.
    """
    at = np.asarray(places, dtype=np.float64)
    if at.ndim != 2 or at.shape[1] != 3 or len(at) < 2 or not np.isfinite(at).all():
        raise ValueError(f"a way leads through two finite places or more of shape (S, 3), not {at.shape}")
    graph, on_ground, is_on = _joined(ground, at)
    length, first = 0.0, len(ground.points)
    for k, (a, b) in enumerate(pairwise(on_ground)):
        straight_m = float(np.linalg.norm(b - a))
        if not is_on[k : k + 2].all() and straight_m > _STRAIGHT_M:
            off = k + int(is_on[k])
            raise ValueError(f"place {off} of the way, {at[off].round(2).tolist()}, is not on reachable ground")
        length += _leg(graph, first + k, straight_m) if is_on[k : k + 2].all() else straight_m
    return length


def path_ratio(driven_m: float, shortest_m: float) -> float:
    """Metres driven to those of the shortest way through the same places; ValueError for a shortest way of next to nothing."""
    if not shortest_m >= _LEAST_WAY_M:
        raise ValueError(f"a way of {shortest_m:.2f} m is too short to compare one with; {_LEAST_WAY_M} m are not")
    return driven_m / shortest_m


def _leg(graph: csr_array, place: int, straight_m: float) -> float:
    """From a place to the next: the search goes as far as it must, for most legs are short and the ground is wide."""
    limit = 1.5 * straight_m + 1.0
    while limit < 1e4:
        length = dijkstra(graph, indices=place, limit=limit)[place + 1]
        if np.isfinite(length):
            return float(length)
        limit *= 3.0
    raise ValueError("two places of a way over reachable ground are not connected")


def _joined(ground: ReachableGround, places: Floats) -> tuple[csr_array, Floats, Mask]:
    """The graph over the ground's points and, as its last nodes, the places; the (S, 3) places, let down on the ground; and which of them
    are on it."""
    tree = cKDTree(ground.points[:, :2])
    on_ground, is_on = places.copy(), np.zeros(len(places), dtype=np.bool_)
    ends, joins = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    for k, place in enumerate(places):
        near = np.array(tree.query_ball_point(place[:2], _JOIN_M), dtype=np.int64)
        height = place[2] - ground.points[near, 2]
        near = near[(height > _BELOW_M) & (height < _ABOVE_M)]
        if not len(near):
            continue
        is_on[k] = True
        on_ground[k, 2] = ground.points[near[np.argmin(np.linalg.norm(ground.points[near, :2] - place[:2], axis=1))], 2]
        ends.append(np.full(len(near), len(ground.points) + k))
        joins.append(near)
    direct = np.flatnonzero(np.linalg.norm(np.diff(on_ground, axis=0), axis=1) <= _JOIN_M) + len(ground.points)
    to_places = np.column_stack([np.concatenate(joins), np.concatenate(ends)])
    pairs = np.vstack([_edges(ground.links), to_places, np.column_stack([direct, direct + 1])])
    return _graph(np.vstack([ground.points, on_ground]), pairs), on_ground, is_on


def _graph(points: Floats, pairs: Ints) -> csr_array:
    a, b = pairs.T
    # A length of zero would be no edge to scipy.
    length = np.maximum(np.linalg.norm(points[a] - points[b], axis=1), 1e-9)
    both = (np.concatenate([a, b]), np.concatenate([b, a]))
    return coo_array((np.concatenate([length, length]), both), shape=(len(points), len(points))).tocsr()


def _edges(links: Ints) -> Ints:
    """(E, 2) pairs of points that a straight line over linked cells joins, each pair once, from (M, 4) links."""
    keys = [np.empty(0, dtype=np.int64)]
    for line, swapped, signs in product(_LINES, (False, True), product((0, 1), repeat=2)):
        end = np.arange(len(links))
        for step in line:
            axis = (step == "1") != swapped
            end = np.where(end >= 0, links[end, 2 * axis + signs[axis]], -1)
        start = np.flatnonzero(end >= 0)
        keys.append(np.minimum(start, end[start]) * len(links) + np.maximum(start, end[start]))
    ordered = np.sort(np.concatenate(keys))
    return np.column_stack(np.divmod(ordered[np.diff(ordered, prepend=-1) > 0], max(1, len(links))))
