"""The way against the shortest one: how long the robot had to drive over true ground to sweep where it did, in that order.

A lower bound, so that no robot is found to have driven less. The centre may pass wherever the body's side just fits between things, with
or without room to turn, and a cell nearer. Such cells are taken as a graph, each joined to those in 40 directions; ways along these are
at most 0.5 % longer than over a plane without cells, and the length is divided by that. A leg is at least as long as the straight line.
"""

import math
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from exploration_evaluation.truth import ON_GROUND_M, ReachableGround

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

# Straight lines from cell to cell, as steps along the first and the second axis; with both axes and signs, 40 directions.
_LINES = ("0", "01", "010", "0010", "001000", "01010")
_STRETCH = 1.0 / math.cos(0.5 * math.atan2(1, 5))  # midway between two directions that lie farthest apart
_JOIN_M = 0.3
_AT_ENDS_M = 0.02  # by which a way is longer because a place is joined to cells beside its line
_LEAST_WAY_M = 0.5
_AT_A_TIME = 32  # sources of ways, so that their distances to all cells fit into memory


def shortest_legs(ground: ReachableGround, places: ArrayLike) -> Floats:
    """(S - 1,) metres that the shortest way over the ground has at least from each of (S, 3) places, world frame, to the next.

    A place is a point of the ground below the robot, to `ON_GROUND_M`; from and to one that is over no ground to pass, the straight
    line is all that is known. ValueError for fewer than two.
    """
    at = np.asarray(places, dtype=np.float64)
    if at.ndim != 2 or at.shape[1] != 3 or len(at) < 2 or not np.isfinite(at).all():
        raise ValueError(f"a way leads through two finite places or more, and the robot stood at {len(at)}")
    graph, is_on = _joined(ground, at)
    legs = np.linalg.norm(np.diff(at, axis=0), axis=1)
    for k in np.flatnonzero(is_on[:-1] & is_on[1:]):
        legs[k] = max(legs[k], _leg(graph, len(ground.way_points) + int(k), float(legs[k])) / _STRETCH - _AT_ENDS_M)
    return np.asarray(legs)


def path_ratio(driven_m: float, shortest_m: float) -> float:
    """Metres driven to those of the shortest way through the same places; ValueError for a shortest way of next to nothing."""
    if not shortest_m >= _LEAST_WAY_M:
        raise ValueError(f"a way of {shortest_m:.2f} m is too short to compare one with; {_LEAST_WAY_M} m are not")
    return driven_m / shortest_m


def lengths_between(ground: ReachableGround, points: Ints, reach_m: float) -> Floats:
    """(P, P) metres of the shortest way between any two of (P,) way points, inf where none leads.

    Longer ways than the reach lead over others of the points: up to a percent too long where these are a third of the reach apart.
    """
    graph = _graph(ground.way_points, _edges(ground.way_links))
    near = [dijkstra(graph, indices=some, limit=reach_m)[:, points] for some in np.array_split(points, max(1, len(points) // _AT_A_TIME))]
    lengths = np.vstack(near)
    row, column = np.nonzero(np.isfinite(lengths) & ~np.eye(len(points), dtype=np.bool_))
    joined = coo_array((np.maximum(lengths[row, column], 1e-9), (row, column)), shape=lengths.shape).tocsr()
    return np.asarray(dijkstra(joined))


def _leg(graph: csr_array, place: int, straight_m: float) -> float:
    """From a place to the next, along the graph; the straight line where that is not joined. Most legs are short and the ground is wide."""
    limit = 1.5 * straight_m + 1.0
    while limit < 1e4:
        length = dijkstra(graph, indices=place, limit=limit)[place + 1]
        if np.isfinite(length):
            return float(length)
        limit *= 3.0
    return straight_m


def _joined(ground: ReachableGround, places: Floats) -> tuple[csr_array, Mask]:
    """The graph over the ground and, as its last nodes, (S, 3) places that are let down on it; and which of them are on it."""
    tree = cKDTree(ground.way_points[:, :2])
    on_ground, is_on = places.copy(), np.zeros(len(places), dtype=np.bool_)
    ends, joins = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    for k, place in enumerate(places):
        near = np.array(tree.query_ball_point(place[:2], _JOIN_M), dtype=np.int64)
        near = near[np.abs(place[2] - ground.way_points[near, 2]) < ON_GROUND_M]
        if not len(near):
            continue
        is_on[k] = True
        on_ground[k, 2] = ground.way_points[near[np.argmin(np.linalg.norm(ground.way_points[near, :2] - place[:2], axis=1))], 2]
        ends.append(np.full(len(near), len(ground.way_points) + k))
        joins.append(near)
    direct = np.flatnonzero(np.linalg.norm(np.diff(on_ground, axis=0), axis=1) <= _JOIN_M) + len(ground.way_points)
    to_places = np.column_stack([np.concatenate(joins), np.concatenate(ends)])
    pairs = np.vstack([_edges(ground.way_links), to_places, np.column_stack([direct, direct + 1])])
    return _graph(np.vstack([ground.way_points, on_ground]), pairs), is_on


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
