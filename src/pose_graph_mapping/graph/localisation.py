"""Where in a known map is the robot? A sweep is matched to one part of the map after the other, without any odometry.

After a restart, when the robot may have been carried elsewhere, and in a finished map. Only a match beyond doubt counts: a robot that does
not know where it is stands still.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pose_graph_mapping.graph.dead_reckoning import levelled
from pose_graph_mapping.graph.loop_closure import Match
from pose_graph_mapping.graph.pose_graph import PoseGraph
from pose_graph_mapping.registration.cloud import PointCloud, merged
from pose_graph_mapping.registration.matching import RegistrationResult, Verdict
from rigid_geometry import inverse, rotation_angle

Array = NDArray[np.float64]

_SPACING_M = 3.0  # distance of the places that are tried; a match searches about as far around each
_AREA_DIST_M = 8.0  # clouds of vertices this near to a place are matched with
_AGREE_M, _AGREE_RAD = 0.3, 0.1  # placements farther apart, or in attitude, contradict each other


@dataclass(frozen=True, eq=False)
class Placement:
    """Outcome of a search.

    result: of the match that placed the sweep, T_reference_reading being T_map_base, or of the one that came nearest to it; vertex_id:
    nearest vertex of the map to that pose; tries: how many places were matched; reason: in words.
    """

    accepted: bool
    result: RegistrationResult
    vertex_id: int
    tries: int
    reason: str


def places(positions: Array, first: int, spacing_m: float) -> list[int]:
    """Indices of positions (V, 3) at least `spacing_m` apart, with every other within it of one of them: `first`, then nearest first."""
    order = np.argsort(np.linalg.norm(positions - positions[first], axis=1), kind="stable")
    chosen: list[int] = []
    for k in order:
        if not chosen or np.linalg.norm(positions[chosen] - positions[k], axis=1).min() >= spacing_m:
            chosen.append(int(k))
    return chosen


def area_around(graph: PoseGraph, clouds: Sequence[PointCloud], vertex_id: int, distance_m: float) -> PointCloud:
    """The clouds of all vertices within `distance_m` of one in a straight line, merged, in the map frame."""
    poses = graph.poses()
    near = np.flatnonzero(np.linalg.norm(poses[:, :3, 3] - poses[vertex_id, :3, 3], axis=1) <= distance_m)
    return merged([clouds[int(k)].transformed(poses[k]) for k in near])


def localise(
    graph: PoseGraph,
    clouds: Sequence[PointCloud],
    sweep: PointCloud,
    match: Match,
    gravity_base: ArrayLike | None = None,
) -> Placement:
    """Find a sweep (base_link) in the map that `graph` and the clouds of its vertices (body frames) make.

    The area around the last vertex comes first, and a match there that is accepted is the place: the robot was most likely not moved. Else
    every part of the map is tried, and the place counts only when all accepted matches agree on it. gravity_base (3,): up in base_link,
    which levels the guesses. ValueError for an empty map or an empty sweep.
    """
    if not len(graph) or not len(sweep):
        raise ValueError(f"{len(sweep)} points of a sweep to be found in a map of {len(graph)} vertices")
    up = None if gravity_base is None else np.asarray(gravity_base, dtype=np.float64)
    found: list[RegistrationResult] = []
    for vertex_id in places(graph.poses()[:, :3, 3], len(graph) - 1, _SPACING_M):
        T_guess = graph.pose(vertex_id) if up is None else levelled(graph.pose(vertex_id), up)
        found.append(match(area_around(graph, clouds, vertex_id, _AREA_DIST_M), sweep, T_guess, None))
        if len(found) == 1 and found[0].verdict is Verdict.ACCEPTED:
            break
    return _judged(graph, found)


def _judged(graph: PoseGraph, found: Sequence[RegistrationResult]) -> Placement:
    """One placement of what was found at the places; two that differ are none."""
    accepted = [r for r in found if r.verdict is Verdict.ACCEPTED]
    best = max(accepted or found, key=lambda r: np.nan_to_num(r.overlap, nan=-1.0))
    beside = int(np.argmin(np.linalg.norm(graph.poses()[:, :3, 3] - best.T_reference_reading[:3, 3], axis=1)))
    if not accepted:
        reason = f"found at none of {len(found)} places of the map; the nearest to it: {best.verdict.value}, {best.reason}"
        return Placement(False, best, beside, len(found), reason)
    doubtful = [T for r in found if r.verdict is Verdict.AMBIGUOUS for T in (r.T_reference_reading, *r.rivals)]
    others = [T for T in (*(r.T_reference_reading for r in accepted), *doubtful) if not _agree(best.T_reference_reading, T)]
    if others:
        (x, y, _), (there_x, there_y, _) = best.T_reference_reading[:3, 3], others[0][:3, 3]
        reason = f"found at places that look alike: x {x:.1f}, y {y:.1f} m and x {there_x:.1f}, y {there_y:.1f} m"
        return Placement(False, dataclasses.replace(best, verdict=Verdict.AMBIGUOUS, reason=reason), beside, len(found), reason)
    return Placement(True, best, beside, len(found), f"found beside vertex {beside}: {best.reason}")


def _agree(T_a: Array, T_b: Array) -> bool:
    motion = inverse(T_a) @ T_b
    return float(np.linalg.norm(motion[:3, 3])) <= _AGREE_M and rotation_angle(motion) <= _AGREE_RAD
