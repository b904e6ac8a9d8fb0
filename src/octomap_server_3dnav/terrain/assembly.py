"""A `Terrain` out of what was judged of a scene: its nodes anew from 0, and what lies beside them (thesis 5.5).

Last step of `classify`.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.columns import indices_of
from octomap_server_3dnav.octree.lean_kernels import Index
from octomap_server_3dnav.terrain.beside import EDGE
from octomap_server_3dnav.terrain.classified_terrain import (
    FRONTIER,
    INFLATION,
    OBSTACLE,
    POTENTIAL_CLIFF,
    TRAVERSABLE,
    UNREACHED,
    Barriers,
    Terrain,
)
from octomap_server_3dnav.terrain.config import Limits
from octomap_server_3dnav.terrain.judgement import Departure
from octomap_server_3dnav.terrain.scene import Scene


class Judged(NamedTuple):
    """What is known of the (N,) nodes of a scene, and the barriers (B,) and frontier edges (E, 5) beside them."""

    label: NDArray[np.uint8]
    near_kerb: NDArray[np.bool_]
    distance: NDArray[np.float32]
    cost: NDArray[np.float32]
    barriers: Barriers
    edges: NDArray[np.int64]
    start: int | None
    departure: Departure


class _Beside(NamedTuple):
    """Voxels beside the nodes, obstacles first: column and z (M, 2), class (M,), the node that each was seen from (M,), and which of them
    each frontier edge leads to (E,)."""

    voxels: NDArray[np.int64]
    label: NDArray[np.uint8]
    seen_from: NDArray[np.int64]
    of_edge: NDArray[np.int64]


def _unique_obstacles(barriers: Barriers) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(M, 2) column and z of the obstacle voxels, and (M,) a node that each was seen from."""
    stands = np.flatnonzero(barriers.column >= 0)
    _, first = np.unique((barriers.column[stands] << 16) + barriers.voxel[stands], return_index=True)
    which = stands[first]
    return np.stack([barriers.column[which], barriers.voxel[which]], axis=1), barriers.node[which]


def _unique_frontiers(edges: NDArray[np.int64], step: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(F, 2) column and z of the frontier voxels, one a column and level, and (E,) which one each edge leads to."""
    order = np.argsort((edges[:, 0] << 16) + edges[:, 1], kind="stable")
    column, z = edges[order, 0], edges[order, 1]
    new = np.r_[True, (np.diff(column) != 0) | (np.diff(z) > step + 1)] if order.size else np.zeros(0, dtype=bool)
    group = np.empty(order.size, dtype=np.int64)
    group[order] = np.cumsum(new) - 1
    highest = np.r_[new[1:], True] if order.size else new
    return np.stack([column[highest], z[highest]], axis=1), group


def _what_is_beside(judged: Judged, step: int) -> _Beside:
    """The obstacles and after them the frontiers."""
    edges = judged.edges
    obstacles, from_node = _unique_obstacles(judged.barriers)
    frontiers, of_edge = _unique_frontiers(edges, step)
    of_edge = of_edge + len(obstacles)
    label = np.full(len(obstacles) + len(frontiers), OBSTACLE, dtype=np.uint8)
    label[len(obstacles) :] = FRONTIER
    label[of_edge[edges[:, 4] == EDGE]] = POTENTIAL_CLIFF
    seen_from = np.empty(label.size, dtype=np.int64)
    seen_from[: len(obstacles)], seen_from[of_edge] = from_node, edges[:, 2]
    return _Beside(np.concatenate([obstacles, frontiers]), label, seen_from, of_edge)


@njit(cache=True)
def _number_nodes(label: NDArray[np.uint8]) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """(K,) the nodes that the flood reached, and (N + 1,) the number of every node among them, -1 for the others and at the end."""
    node, number = np.empty(np.count_nonzero(label != UNREACHED), np.int64), np.full(label.size + 1, -1, np.int32)
    n = 0
    for s in range(label.size):
        if label[s] != UNREACHED:
            node[n], number[s] = s, n
            n += 1
    return node, number


@njit(cache=True)
def _column_starts(start: NDArray[np.int32], number: NDArray[np.int32]) -> NDArray[np.int64]:
    """(C + 1,) int64 number of the first kept node of each column or after it."""
    out = np.empty(start.size, np.int64)
    following = np.int64(number.max()) + 1
    s = number.size - 1
    for c in range(start.size - 1, -1, -1):
        while s > start[c]:
            s -= 1
            if number[s] >= 0:
                following = np.int64(number[s])
        out[c] = following
    return out


@njit(cache=True)
def _drivable_neighbours(
    label: NDArray[np.uint8], graph: NDArray[np.int32], node: NDArray[np.int64], number: NDArray[np.int32], more: Index
) -> NDArray[np.int32]:
    """(K + more, 4) int32 neighbours of the kept nodes by their new numbers, -1 unless both are drivable; -1 in the `more` rows."""
    out = np.full((node.size + more, 4), -1, np.int32)
    for i in range(node.size):
        s = node[i]
        if label[s] == TRAVERSABLE or label[s] == INFLATION:
            for k in range(4):
                n = graph[s, k]
                if n >= 0 and (label[n] == TRAVERSABLE or label[n] == INFLATION):
                    out[i, k] = number[n]
    return out


def _with(values: NDArray, node: NDArray[np.int64], beside: NDArray) -> NDArray:
    """Values of the kept nodes, and after them those of what lies beside."""
    return np.concatenate([values[node], np.asarray(beside).astype(values.dtype)])


def assemble(scene: Scene, judged: Judged, limits: Limits, radius_m: float | None, robot: NDArray[np.float64]) -> Terrain:
    """The terrain of `radius_m` around the robot (3,), or of the whole map when it is None."""
    surfaces, departure = scene.surfaces, judged.departure
    node, number = _number_nodes(judged.label)
    beside = _what_is_beside(judged, limits.step)
    more, none = len(beside.voxels), np.zeros(len(beside.voxels), dtype=bool)
    neighbours = _drivable_neighbours(judged.label, scene.links.graph, node, number, more)
    neighbours[node.size + beside.of_edge, (judged.edges[:, 3] + 2) % 4] = number[judged.edges[:, 2]]
    reached = none.copy()
    reached[beside.of_edge[departure.reached[judged.edges[:, 2]]]] = True
    ix, iy = indices_of(surfaces.column[node], scene.columns.ny, scene.key)
    x, y = np.divmod(beside.voxels[:, 0], scene.columns.ny)
    return Terrain(
        resolution=limits.resolution,
        ix=np.concatenate([ix, (scene.key[0] + x).astype(np.int32)]),
        iy=np.concatenate([iy, (scene.key[1] + y).astype(np.int32)]),
        z=_with(surfaces.z, node, beside.voxels[:, 1]),
        label=_with(judged.label, node, beside.label),
        reached=_with(departure.reached, node, reached),
        near_kerb=_with(judged.near_kerb, node, none),
        distance_m=_with(judged.distance * np.float32(limits.resolution), node, np.full(more, np.nan)),
        cost=_with(judged.cost, node, np.full(more, np.inf)),
        neighbours=neighbours,
        seen_from=np.concatenate([np.full(node.size, -1, dtype=np.int32), number[beside.seen_from]]),
        start=None if judged.start is None else int(number[judged.start]),
        departure=None if departure.node is None else int(number[departure.node]),
        radius_m=radius_m,
        robot_xyz=(float(robot[0]), float(robot[1]), float(robot[2])),
        surface_count=int(node.size),
        window_key=scene.key,
        column_start=_column_starts(surfaces.start, number),
        columns=scene.columns,
        barriers=judged.barriers._replace(node=number[judged.barriers.node].astype(np.int64)),
        narrow=np.zeros(node.size + more, dtype=bool),
    )
