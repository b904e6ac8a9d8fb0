"""A `Terrain` out of what was judged of a scene: its nodes anew from 0, and what lies beside them (thesis 5.5).

Last step of `terrain.classify`.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.navigation.passages import Passage
from octomap_server_3dnav.navigation.straight_lines import KeptOff
from octomap_server_3dnav.terrain.barriers import distinct_rows
from octomap_server_3dnav.terrain.classified_terrain import Terrain, TerrainClass
from octomap_server_3dnav.terrain.config import Limits
from octomap_server_3dnav.terrain.judgement import Departure
from octomap_server_3dnav.terrain.kernels import INFLATION, SEES_EDGE, TRAVERSABLE, UNREACHED
from octomap_server_3dnav.terrain.scene import Scene
from octomap_server_3dnav.terrain.surface_columns import ground_voxel, indices_of


class Judged(NamedTuple):
    """What is known of the (N,) nodes of a scene, the obstacles (M, 3) and frontier edges (E, 5) beside them, and the ways over them.

    `beside_reached` (E,): edges seen from ground that is reached, whatever the ground beside doubtful floor is.
    """

    label: NDArray[np.uint8]
    narrow: NDArray[np.bool_]
    near_kerb: NDArray[np.bool_]
    cost: NDArray[np.float32]
    obstacles: NDArray[np.int64]
    edges: NDArray[np.int64]
    beside_reached: NDArray[np.bool_]
    start: int | None
    departure: Departure
    passages: list[Passage]
    kept_off: KeptOff


class _Beside(NamedTuple):
    """Voxels beside the nodes: column and z (B, 2), class (B,), and whether they are seen from reached ground (B,)."""

    voxels: NDArray[np.int64]
    label: NDArray[np.uint8]
    reached: NDArray[np.bool_]


def _unique_frontiers(edges: NDArray[np.int64], step: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(F, 2) column and z of the frontier voxels, one a column and level, and (E,) which one each edge leads to."""
    order = np.argsort((edges[:, 0] << 16) + edges[:, 1], kind="stable")
    column, z = edges[order, 0], edges[order, 1]
    new = np.r_[True, (np.diff(column) != 0) | (np.diff(z) > step + 1)] if order.size else np.zeros(0, dtype=bool)
    group = np.empty(order.size, dtype=np.int64)
    group[order] = np.cumsum(new) - 1
    highest = np.r_[new[1:], True] if order.size else new
    return np.stack([column[highest], z[highest]], axis=1), group


def _obstacles_and_frontiers(judged: Judged, step: int) -> tuple[_Beside, int, NDArray[np.int64]]:
    """The obstacles and after them the frontiers, how many obstacles these are, and (E,) which frontier each edge leads to."""
    edges = judged.edges
    obstacles = distinct_rows(judged.obstacles, 1, 1)[:, :2]
    frontiers, frontier_of_edge = _unique_frontiers(edges, step)
    of_edge, voxels = frontier_of_edge + len(obstacles), np.concatenate([obstacles, frontiers])
    label, reached = np.full(len(voxels), TerrainClass.OBSTACLE, dtype=np.uint8), np.zeros(len(voxels), dtype=bool)
    label[len(obstacles) :] = TerrainClass.FRONTIER
    label[of_edge[edges[:, 4] == SEES_EDGE]] = TerrainClass.POTENTIAL_CLIFF
    reached[of_edge[judged.beside_reached | judged.departure.reached[edges[:, 2]]]] = True
    return _Beside(voxels, label, reached), len(obstacles), of_edge


@njit(cache=True)
def _number_nodes(label: Any) -> Any:
    """(K,) the nodes that the flood reached, and (N + 1,) the number of every node among them, -1 for the others and at the end."""
    node, number = np.empty(np.count_nonzero(label != UNREACHED), np.int64), np.full(label.size + 1, -1, np.int32)
    n = 0
    for s in range(label.size):
        if label[s] != UNREACHED:
            node[n], number[s] = s, n
            n += 1
    return node, number


@njit(cache=True)
def _column_starts(start: Any, number: Any) -> Any:
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
def _drivable_neighbours(label: Any, graph: Any, node: Any, number: Any, more: Any) -> Any:
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


@njit(cache=True)
def _voxels(node: Any, label: Any, surfaces: Any, near: Any, beside: Any, ny: Any, key: Any) -> Any:
    """ix, iy and z of the kept nodes, ascending by column, where their ground lies, and after them of what is `beside` (B, 2)."""
    size = node.size + len(beside)
    ix, iy, z = np.empty(size, np.int32), np.empty(size, np.int32), np.empty(size, np.int16)
    ix[: node.size], iy[: node.size] = indices_of(surfaces.column[node], ny, key)
    for i in range(node.size):
        s = node[i]
        z[i] = surfaces.z[s]
        if label[s] == TRAVERSABLE or label[s] == INFLATION:
            z[i] = ground_voxel(s, near, surfaces)
    for b in range(len(beside)):
        i = node.size + b
        ix[i], iy[i], z[i] = key[0] + beside[b, 0] // ny, key[1] + beside[b, 0] % ny, beside[b, 1]
    return ix, iy, z


@njit(cache=True)
def _properties(node: Any, label: Any, narrow: Any, near_kerb: Any, cost: Any, reached: Any, bridged: Any, more: Any) -> Any:
    """The same of the kept nodes, and in `more` rows what they are of that is no ground."""
    size = node.size + more
    out_label, out_cost = np.empty(size, np.uint8), np.full(size, np.inf, np.float32)
    out_narrow, out_kerb = np.zeros(size, np.bool_), np.zeros(size, np.bool_)
    out_reached, out_bridged = np.zeros(size, np.bool_), np.zeros(size, np.bool_)
    for i in range(node.size):
        s = node[i]
        out_label[i], out_cost[i], out_narrow[i], out_kerb[i] = label[s], cost[s], narrow[s], near_kerb[s]
        out_reached[i], out_bridged[i] = reached[s], bridged[s]
    return out_label, out_narrow, out_kerb, out_cost, out_reached, out_bridged


def assemble(scene: Scene, judged: Judged, limits: Limits, radius_m: float | None, robot: NDArray[np.float64]) -> Terrain:
    """The terrain of `radius_m` around the robot (3,), or of the whole map when it is None."""
    surfaces, departure = scene.surfaces, judged.departure
    node, number = _number_nodes(judged.label)
    beside, obstacles, beside_of_edge = _obstacles_and_frontiers(judged, limits.step)
    neighbours = _drivable_neighbours(judged.label, scene.links.graph, node, number, len(beside.voxels))
    neighbours[node.size + beside_of_edge, (judged.edges[:, 3] + 2) % 4] = number[judged.edges[:, 2]]
    ix, iy, z = _voxels(node, judged.label, surfaces, scene.links.near, beside.voxels, scene.columns.ny, scene.key)
    label, narrow, near_kerb, cost, reached, bridged = _properties(
        node, *judged[:4], departure.reached, surfaces.bridged, len(beside.voxels)
    )
    label[node.size :], reached[node.size :] = beside.label, beside.reached
    return Terrain(
        resolution=limits.resolution,
        ix=ix,
        iy=iy,
        z=z,
        label=label,
        bridged=bridged,
        reached=reached,
        near_kerb=near_kerb,
        narrow=narrow,
        cost=cost,
        neighbours=neighbours,
        start=None if judged.start is None else int(number[judged.start]),
        departure=None if departure.node is None else int(number[departure.node]),
        radius_m=radius_m,
        robot_xyz=(float(robot[0]), float(robot[1]), float(robot[2])),
        surface_count=int(node.size),
        window_key=scene.key,
        column_start=_column_starts(surfaces.start, number),
        columns=scene.columns,
        passages=tuple(Passage((int(number[p.nodes[0]]), int(number[p.nodes[1]])), p.line) for p in judged.passages),
        kept_off=judged.kept_off,
    )
