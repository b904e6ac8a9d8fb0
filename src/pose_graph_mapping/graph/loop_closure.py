"""Algorithm 2: look for places seen before around the last vertex, match, and tie the graph together.

Called by the mapper after every new vertex (Algorithm 1, line 20). Edges are robust and come only of matches without any doubt.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pose_graph_mapping.config import MappingConfig
from pose_graph_mapping.graph.pose_graph import EdgeKind, PoseGraph
from pose_graph_mapping.registration.cloud import PointCloud
from pose_graph_mapping.registration.matching import RegistrationResult, Verdict
from rigid_geometry import inverse, rotation_angle

Array = NDArray[np.float64]
Match = Callable[[PointCloud, PointCloud, Array, Array | None], RegistrationResult]

_AREAS = 2.0  # times `graph_dist_m`: what the widest match of Algorithm 1 looks at
_LOOP_SIGMAS = 3.0  # of drift, added to `loop_max_dist_m`, and that a match may correct
_LOOP_GROUP_NEIGHBOURS = 2  # nearest neighbours that candidates are grouped by (Alg. 2, line 4)
_LOOP_GROUP_DIST_M = 4.0  # neighbours farther apart never share a group


def candidate_radii(graph: PoseGraph, last_vertex: int, config: MappingConfig) -> Array:
    """(V,) largest straight distance of a loop candidate: what drift may have added to the true one is allowed on top.

    `loop_max_dist_m`, grown by `_LOOP_SIGMAS` of the position of the last vertex relative to each that is worth asking, up to
    `loop_grown_dist_m`.
    """
    positions = graph.poses()[:, :3, 3]
    straight = np.linalg.norm(positions - positions[last_vertex], axis=1)
    radii = np.full(len(graph), config.loop_max_dist_m)
    far = (straight > config.loop_max_dist_m) & (straight <= config.loop_grown_dist_m)
    asked = [int(k) for k in np.flatnonzero(far & (graph.distances_from(last_vertex) >= config.loop_min_dist_m))]
    for k, covariance in zip(asked, graph.relative_covariances(asked, last_vertex), strict=True):
        radii[k] = min(config.loop_max_dist_m + _LOOP_SIGMAS * sigmas(covariance)[0], config.loop_grown_dist_m)
    return radii


def sigmas(covariance: Array) -> tuple[float, float]:
    """Sigmas in metres and radians of a (6, 6) covariance, rotation first, along the directions in which they are largest."""
    return float(np.sqrt(np.linalg.eigvalsh(covariance[3:, 3:])[-1])), float(np.sqrt(np.linalg.eigvalsh(covariance[:3, :3])[-1]))


def find_vertices_in_range(graph: PoseGraph, last_vertex: int, min_dist_m: float, max_dist_m: float | Array) -> list[int]:
    """Vertices at least `min_dist_m` from the last one along edges, and at most `max_dist_m` in a straight line (line 3).

    `max_dist_m` is one distance, or one for every vertex (V,).
    """
    along = graph.distances_from(last_vertex)
    positions = graph.poses()[:, :3, 3]
    straight = np.linalg.norm(positions - positions[last_vertex], axis=1)
    return [int(k) for k in np.flatnonzero((along >= min_dist_m) & (straight <= max_dist_m)) if k != last_vertex]


def add_neighbours(
    graph: PoseGraph, vertex_set: Sequence[int], last_vertex: int, min_dist_m: float, max_dist_m: float | Array
) -> list[int]:
    """The set with the graph neighbours of its members, as long as they too are `min_dist_m` away along edges (line 4).

    A neighbour may lie one more `max_dist_m` away: it widens a group, the match itself starts from the closest member.
    """
    along = graph.distances_from(last_vertex)
    positions = graph.poses()[:, :3, 3]
    near = np.linalg.norm(positions - positions[last_vertex], axis=1) <= 2.0 * max_dist_m
    found = set(vertex_set)
    for vertex_id in vertex_set:
        found.update(k for k in graph.neighbours(vertex_id) if along[k] >= min_dist_m and near[k] and k != last_vertex)
    return sorted(found)


def find_groups(graph: PoseGraph, vertex_set: Sequence[int], neighbours: int, group_dist_m: float) -> list[list[int]]:
    """Connected sets under "is among the k nearest, and nearer than `group_dist_m`" (line 5), ascending, in the order of their first."""
    if not vertex_set:
        return []
    ids = np.array(sorted(vertex_set))
    positions = graph.poses()[ids, :3, 3]
    distance, index = cKDTree(positions).query(positions, k=np.arange(1, min(neighbours + 1, len(ids)) + 1))
    rows, columns = np.nonzero(distance <= group_dist_m)
    joined = coo_array((np.ones(len(rows)), (rows, index[rows, columns])), shape=(len(ids), len(ids)))
    _, label = connected_components(joined, directed=False)
    return [[int(k) for k in ids[label == group]] for group in dict.fromkeys(label.tolist())]


def find_closest_vertex(graph: PoseGraph, group: Sequence[int], last_vertex: int) -> int:
    """The member nearest to the last vertex in a straight line (line 7)."""
    positions = graph.poses()[:, :3, 3]
    return min(group, key=lambda k: (float(np.linalg.norm(positions[k] - positions[last_vertex])), k))


def find_loose_vertex(graph: PoseGraph, last_vertex: int, config: MappingConfig) -> int | None:
    """The nearest vertex of the area around the last one beyond a leg that is known loosely, or None.

    Loose is a leg that is known no better than `loose_sigma_m`: where a match did not hold one direction only odometry does. Loose is
    also one that no match spans, whatever odometry says of itself, once the last leg has one. Loops do not ask vertices that are so near
    along the graph; yet a sweep from a little farther on may see what holds them.
    """
    positions, along = graph.poses()[:, :3, 3], graph.distances_from(last_vertex)
    straight = np.linalg.norm(positions - positions[last_vertex], axis=1)
    near = np.flatnonzero((along <= _AREAS * config.graph_dist_m) & (straight <= config.loop_grown_dist_m))
    spanned, legs = _spanned(graph), [int(k) for k in near[near < last_vertex]]
    hanging = {k for k in legs if not spanned[k] and spanned[last_vertex - 1]}
    held, most_m = _held_alone(graph, config.loose_sigma_m), config.loose_sigma_m
    loose = [k for k in legs if k in hanging or (k not in held and sigmas(graph.relative_covariance(k, k + 1))[0] > most_m)]
    beyond = near[(near <= max(loose, default=-1)) & (near < last_vertex - 1)]
    return int(beyond[np.argmin(straight[beyond])]) if len(beyond) else None


def _held_alone(graph: PoseGraph, sigma_m: float) -> set[int]:
    """The legs that one edge alone holds to `sigma_m`. With all others they are known no worse. Asking the whole graph takes long."""
    return {edge.i for edge in graph.measurements() if edge.j == edge.i + 1 and sigmas(edge.covariance)[0] <= sigma_m}


def _spanned(graph: PoseGraph) -> NDArray[np.bool_]:
    """(V - 1,) of every leg from a vertex to the next, whether a match or a loop leads over it."""
    spanned = np.zeros(max(len(graph) - 1, 0), dtype=np.bool_)
    for i, j, kind in graph.edges():
        if kind is not EdgeKind.ODOMETRY:
            spanned[min(i, j) : max(i, j)] = True
    return spanned


def beyond_correction(T_guess: Array, T_found: Array, covariance: Array, config: MappingConfig) -> str | None:
    """Why a match moves its guess more than the guess's covariance (6, 6) and the usual errors allow; None when it does not."""
    moved = inverse(T_guess) @ T_found
    metres, radians = float(np.linalg.norm(moved[:3, 3])), rotation_angle(moved)
    sigma_m, sigma_rad = sigmas(covariance)
    most_m = max(config.max_correction_m, _LOOP_SIGMAS * sigma_m)
    most_rad = max(config.max_correction_rad, _LOOP_SIGMAS * sigma_rad)
    if metres > most_m or radians > most_rad:
        return f"moves the prediction by {metres:.2f} m, {radians:.2f} rad; allowed are {most_m:.2f} m, {most_rad:.2f} rad"
    return None


@dataclass(frozen=True)
class LoopClosure:
    """What a search found: the vertex at the other end, the result of the match, and whether it became an edge that the graph kept."""

    closest_vertex: int
    result: RegistrationResult
    closed: bool


def detect_loop_closures(graph: PoseGraph, cloud: Callable[[int], PointCloud], match: Match, config: MappingConfig) -> list[LoopClosure]:
    """Algorithm 2 for the last vertex of `graph`; adds the edges, optimises, and returns one entry a group that was matched, and one for
    a vertex of the area that was loose.

    cloud: of a vertex, in its body frame. Line numbers below are the algorithm's.
    """
    graph.optimise()  # 2
    last = len(graph) - 1
    radii = candidate_radii(graph, last, config)
    vertex_set = find_vertices_in_range(graph, last, config.loop_min_dist_m, radii)  # 3
    vertex_set = add_neighbours(graph, vertex_set, last, config.loop_min_dist_m, radii)  # 4
    found = []
    for group in find_groups(graph, vertex_set, _LOOP_GROUP_NEIGHBOURS, _LOOP_GROUP_DIST_M):  # 5, 6
        closest = find_closest_vertex(graph, group, last)  # 7
        if last - closest > config.loop_min_dist_match:  # 8
            found.append(_try_to_close(graph, cloud, match, config, closest, config.loop_match_success))  # 9 to 21
    loose = find_loose_vertex(graph, last, config)
    if loose is not None and loose not in [loop.closest_vertex for loop in found]:
        found.append(_try_to_close(graph, cloud, match, config, loose, 0.0))  # of the same area: judged as Algorithm 1 does
    return found


def _try_to_close(
    graph: PoseGraph, cloud: Callable[[int], PointCloud], match: Match, config: MappingConfig, closest: int, least_ratio: float
) -> LoopClosure:
    """Lines 9 to 21. Both clouds stay in their own frames: the match itself then returns the edge (lines 17 and 18 in one)."""
    last = len(graph) - 1
    delta_estimate = inverse(graph.pose(closest)) @ graph.pose(last)  # 17
    covariance = graph.relative_covariance(closest, last)
    result = match(cloud(closest), cloud(last), delta_estimate, covariance)  # 9 to 15
    believed = (
        result.verdict is Verdict.ACCEPTED
        and result.match_ratio > least_ratio  # 16
        and beyond_correction(delta_estimate, result.T_reference_reading, covariance, config) is None
    )
    if believed:
        graph.add_edge(closest, last, result.T_reference_reading, result.covariance, EdgeKind.LOOP)  # 18, 19
        graph.optimise()  # 20
    return LoopClosure(closest, result, believed and (closest, last, EdgeKind.LOOP) in graph.edges())
