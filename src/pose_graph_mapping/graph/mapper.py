"""Algorithm 1: every sweep becomes a vertex, placed by a match against the area around the last one.

Between sweep assembly and fused odometry on one side, terrain and planning on the other. The matcher is passed in, so that a service
call, a registration of this package or a fake can stand there.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pose_graph_mapping.config import MappingConfig
from pose_graph_mapping.graph.dead_reckoning import gravity_sigma, levelled, odometry_covariance
from pose_graph_mapping.graph.light_clouds import Counts, LightClouds
from pose_graph_mapping.graph.localisation import Placement
from pose_graph_mapping.graph.loop_closure import LoopClosure, Match, beyond_correction, detect_loop_closures, sigmas
from pose_graph_mapping.graph.mapping_update import MappingUpdate
from pose_graph_mapping.graph.pose_graph import Edge, EdgeKind, PoseGraph, unit_up
from pose_graph_mapping.registration.cloud import PointCloud, merged, voxel_downsample
from pose_graph_mapping.registration.matching import RegistrationResult, Verdict
from pose_graph_mapping.registration.seen_through import Gone
from rigid_geometry import JUMP_BACK_S, as_transform, inverse

Array = NDArray[np.float64]

__all__ = ["MappingUpdate", "PoseGraphMapper", "empty_graph", "levelled", "odometry_covariance"]
_MIN_SWEEP_POINTS = 200  # sweeps with fewer finite points are an error


@dataclass(frozen=True, eq=False)
class _Placed:
    """The pose of a new vertex, with the match that gave it."""

    T_map_base: Array
    result: RegistrationResult
    used: bool
    tries: int


def empty_graph(config: MappingConfig) -> PoseGraph:
    """A graph that judges edges and gravity as `config` says."""
    return PoseGraph(config.outlier_chi2, config.gravity_bias_sigma_rad)


def evenly(ids: list[int], most: int) -> list[int]:
    """At most so many of them, from the first to the last."""
    return ids if len(ids) <= most else [ids[k] for k in np.linspace(0, len(ids) - 1, most).round().astype(int)]


def check_sweep(stamp_s: float, known_s: Sequence[float], sweep: PointCloud) -> None:
    """ValueError for a stamp that is none, one of those known already, or late, and for too few points."""
    if not np.isfinite(stamp_s):
        raise ValueError(f"the stamp of a sweep is a finite time, not {stamp_s}")
    if stamp_s in known_s:
        raise ValueError(f"the sweep of {stamp_s:.3f} s is in the map already")
    if known_s and known_s[-1] - JUMP_BACK_S < stamp_s < known_s[-1]:
        raise ValueError(f"the sweep of {stamp_s:.3f} s is late: it came after that of {known_s[-1]:.3f} s")
    if len(sweep) < _MIN_SWEEP_POINTS:
        raise ValueError(f"a sweep of {len(sweep)} finite points ({sweep.dropped} dropped), {_MIN_SWEEP_POINTS} wanted")


class PoseGraphMapper:
    """Graph-based mapping (thesis 5.4): owns the graph and a light cloud of every vertex, and forgets of these what has gone."""

    def __init__(self, config: MappingConfig, match: Match) -> None:
        problems = config.validate()
        if problems:
            raise ValueError("; ".join(problems))
        self._config, self._match = config, match
        self.graph = empty_graph(config)
        self._clouds = LightClouds(config)
        self._stamps_s: list[float] = []
        self._T_odom_last = np.eye(4)
        self._old_last_vertex_estimate = np.eye(4)

    @property
    def stamps_s(self) -> tuple[float, ...]:
        """The stamp of every vertex, seconds."""
        return tuple(self._stamps_s)

    def kept(self) -> tuple[tuple[float, ...], Array]:
        """Stamps and (V, 4, 4) poses after which those of the next sweep come."""
        return self.stamps_s, self.graph.poses()

    def add_sweep(
        self,
        stamp_s: float,
        points_base: ArrayLike,
        origins_base: ArrayLike,
        T_odom_base: ArrayLike,
        gravity_base: ArrayLike | None = None,
        gravity_sigma_rad: float | None = None,
        placement: Placement | None = None,
    ) -> MappingUpdate:
        """Algorithm 1 for one sweep; line numbers in the code are its.

        points_base, origins_base (N, 3) at the stamp; T_odom_base (4, 4); gravity_base (3,): up as the resting IMU measured it; placement:
        where the sweep was found in the map (`localise`), which then stands in for odometry. Stamps may go back by half a second or
        more, as a clock does that is set. ValueError for one that is late, or in the map already, too few finite points, or
        anything that is no transform, direction or accepted placement. A sweep that ends in an error, be it the matcher's, leaves
        mapper and graph as they were.
        """
        sweep = PointCloud.of_finite(points_base, origins_base)
        T_odom_base = as_transform(T_odom_base)
        up = None if gravity_base is None or not self._config.use_gravity else unit_up(gravity_base)
        check_sweep(stamp_s, self._stamps_s, sweep)
        if gravity_sigma_rad is not None and not gravity_sigma_rad > 0.0:
            raise ValueError(f"gravity_sigma_rad must be positive, not {gravity_sigma_rad}")
        cloud = voxel_downsample(sweep, self._config.vertex_voxel_m)
        with self._whole():
            if placement is not None:
                placed: _Placed | None = self._localised_vertex(placement)
            elif len(self.graph):
                placed = self._next_vertex(cloud, T_odom_base)
            else:
                placed = self._first_vertex(T_odom_base, up)
            self._clouds.add(cloud)
            self._stamps_s.append(float(stamp_s))
            if up is not None:
                last = len(self.graph) - 1
                self.graph.add_gravity(last, up, gravity_sigma(gravity_sigma_rad, self._stamps_s, last, self._config))
            self._old_last_vertex_estimate = self.graph.pose(len(self.graph) - 1)  # 4, 19
            self._T_odom_last = T_odom_base  # 5
            loops = detect_loop_closures(self.graph, self._clouds.cloud, self._match, self._config)  # 20
            self._look_through(len(self.graph) - 1)
        return self._update(placed, loops)

    @contextlib.contextmanager
    def _whole(self) -> Iterator[None]:
        """What is done inside is done wholly, or not at all: a vertex without its sweep could not be saved."""
        clouds, stamps_s = self._clouds.copy(), list(self._stamps_s)
        last = self._T_odom_last, self._old_last_vertex_estimate
        try:
            with self.graph.whole():
                yield
        except BaseException:
            self._clouds, self._stamps_s = clouds, stamps_s
            self._T_odom_last, self._old_last_vertex_estimate = last
            raise

    def solve(self) -> tuple[Edge, ...]:
        """Solve the whole graph again and judge every match and loop; the edges that were left out by it. For the end of a session."""
        return self.graph.solve()

    def restore(
        self,
        graph: PoseGraph,
        clouds: Sequence[PointCloud],
        stamps_s: Sequence[float],
        T_odom_last: Array,
        looked_through: Sequence[Counts] = (),
    ) -> None:
        """Go on with the graph and the light clouds (body frames) of an earlier session; T_odom_last (4, 4): odometry of its last sweep.

        looked_through: as that session had it; sweeps beyond it look through the others anew.
        """
        if not 0 < len(graph) == len(clouds) == len(stamps_s):
            raise ValueError(f"{len(clouds)} clouds and {len(stamps_s)} stamps for {len(graph)} vertices, of which one is wanted at least")
        self.graph, self._stamps_s = graph, [float(s) for s in stamps_s]
        self._clouds = LightClouds(self._config, clouds, looked_through)
        self._T_odom_last = as_transform(T_odom_last)
        self._old_last_vertex_estimate = graph.pose(len(graph) - 1)
        for vertex_id in range(len(looked_through), len(graph)):
            self._look_through(vertex_id)

    def vertex_clouds(self) -> tuple[PointCloud, ...]:
        """The light cloud of every vertex, in its body frame, without what has gone."""
        return tuple(map(self._clouds.cloud, range(len(self._clouds))))

    def gone(self) -> Gone:
        """What later sweeps looked through."""
        return self._clouds.gone()

    def looked_through(self) -> tuple[Counts, ...]:
        """Of every point of every vertex's cloud, by how many later sweeps it was looked through."""
        return self._clouds.counts()

    def _look_through(self, vertex_id: int) -> None:
        """Counts which points of the older sweeps around a vertex that one looks through; odometry alone does not place it well enough."""
        held = any(kind is not EdgeKind.ODOMETRY and vertex_id == j for _, j, kind in self.graph.edges())
        if not held or not self._config.gone_sweeps:
            return
        near = self._near(vertex_id, self._config.graph_dist_m, self._config.loose_sigma_m)
        T_vertex_map = inverse(self.graph.pose(vertex_id))
        self._clouds.look_through(vertex_id, {k: T_vertex_map @ self.graph.pose(k) for k in near if k < vertex_id})

    def finish_cloud(self) -> None:
        """Estimates the normals of the last sweep's cloud, which the next matches need; for whoever has time before the next sweep."""
        self._clouds.finish_last()

    def area_cloud(self, distance_m: float, most_sigma_m: float = math.inf) -> PointCloud:
        """The clouds of all vertices within `distance_m` of the last one along the graph, merged, in the map frame.

        Of more than `area_most_sweeps` evenly many. Without those that are known beside it no better than `most_sigma_m`: with them the
        area shows one wall in two places.
        """
        near = self._near(len(self.graph) - 1, distance_m, most_sigma_m)
        return merged([self._clouds.cloud(k).transformed(self.graph.pose(k)) for k in near])

    def _near(self, vertex_id: int, distance_m: float, most_sigma_m: float) -> list[int]:
        near = evenly([int(k) for k in np.flatnonzero(self.graph.distances_from(vertex_id) <= distance_m)], self._config.area_most_sweeps)
        if math.isfinite(most_sigma_m):
            self.graph.optimise()
            known = self.graph.relative_covariances(near, vertex_id)
            near = [k for k, covariance in zip(near, known, strict=True) if k == vertex_id or sigmas(covariance)[0] <= most_sigma_m]
        return near

    def surroundings(self) -> PointCloud:
        """The area that the next sweep is matched to first: in the map frame, without what is known loosely."""
        return self.area_cloud(self._config.graph_dist_m, self._config.loose_sigma_m)

    def map_cloud(self) -> PointCloud:
        """The light clouds of all vertices in the map frame; ValueError before the first sweep."""
        return merged([cloud.transformed(T) for cloud, T in zip(self.vertex_clouds(), self.graph.poses(), strict=True)])

    def T_map_odom(self) -> Array:
        """(4, 4) correction of the odometry frame by the last vertex; ValueError before the first sweep (lines 21 to 23)."""
        return self.graph.pose(len(self.graph) - 1) @ inverse(self._T_odom_last)

    def _first_vertex(self, T_odom_base: Array, up: Array | None) -> _Placed | None:
        """Lines 2 to 6, levelled where gravity is known: a tilted first pose tilts the whole map."""
        self.graph.add_vertex(T_odom_base if up is None else levelled(T_odom_base, up))  # 3
        return None

    def _localised_vertex(self, placement: Placement) -> _Placed:
        """A vertex that hangs on the one it was found beside: odometry does not know how the robot came here."""
        if not placement.accepted:
            raise ValueError(f"a sweep that was not found in the map: {placement.reason}")
        result, beside = placement.result, placement.vertex_id
        T_map_base = as_transform(result.T_reference_reading)
        T_beside_base = inverse(self.graph.pose(beside)) @ T_map_base
        self.graph.add_edge(beside, self.graph.add_vertex(T_map_base), T_beside_base, result.covariance, EdgeKind.MATCH)
        return _Placed(T_map_base, result, True, placement.tries)

    def _next_vertex(self, cloud: PointCloud, T_odom_base: Array) -> _Placed:
        """Lines 8 to 18, with an odometry edge whatever the match says: it holds what the match leaves open."""
        last = len(self.graph) - 1
        relative_odom = inverse(self._T_odom_last) @ T_odom_base  # 8, 10
        # 11 to 13. The correction takes the last vertex from where it was placed to where it is now. As printed, line 12 applies it to the
        # estimate that has it already; it belongs to the old one.
        last_vertex_lc_corr = inverse(self._old_last_vertex_estimate) @ self.graph.pose(last)
        trans_curr_pc = as_transform(self._old_last_vertex_estimate @ last_vertex_lc_corr @ relative_odom)
        grown = odometry_covariance(relative_odom, self._config)
        placed = self._matched(cloud, trans_curr_pc, grown)  # 9, 14 to 17
        current = self.graph.add_vertex(placed.T_map_base)  # 18
        self.graph.add_edge(last, current, relative_odom, grown, EdgeKind.ODOMETRY)
        if placed.used:
            T_last_current = inverse(self.graph.pose(last)) @ placed.T_map_base
            self.graph.add_edge(last, current, T_last_current, placed.result.covariance, EdgeKind.MATCH)
        return placed

    def _matched(self, cloud: PointCloud, T_predicted: Array, covariance: Array) -> _Placed:
        """Lines 9 and 14 to 17: up to three tries, each against another reference, until one is not refused.

        The first leaves out what hangs loosely beside the last sweep; the last takes everything, for that may be what matches.
        The cloud stays in the body frame and the prediction is the guess, which is lines 14 and 17 in one: the match returns T_map_base.
        A sweep that nothing matches keeps the prediction.
        """
        attempts, loose_m = list[RegistrationResult](), self._config.loose_sigma_m
        for factor, most_sigma_m in ((1.0, loose_m), (0.0, math.inf), (2.0, math.inf))[: self._config.num_icp_tries]:  # 15
            area = self.area_cloud(factor * self._config.graph_dist_m, most_sigma_m)  # 9
            attempts.append(self._plausible(self._match(area, cloud, T_predicted, covariance), T_predicted, covariance))  # 16
            if attempts[-1].usable:
                return _Placed(as_transform(attempts[-1].T_reference_reading), attempts[-1], True, len(attempts))
        return _Placed(T_predicted, attempts[0], False, len(attempts))

    def _plausible(self, result: RegistrationResult, T_predicted: Array, covariance: Array) -> RegistrationResult:
        """The result, refused when it moves the prediction too far: only the prior can reject a symmetry."""
        reason = beyond_correction(T_predicted, result.T_reference_reading, covariance, self._config)
        if not result.usable or reason is None:
            return result
        return dataclasses.replace(result, verdict=Verdict.REFUSED, reason=reason)

    def _update(self, placed: _Placed | None, loops: Sequence[LoopClosure]) -> MappingUpdate:
        poses = self.graph.poses()
        return MappingUpdate(
            vertex_id=len(poses) - 1,
            vertex_poses=poses,
            T_map_odom=self.T_map_odom(),
            result=None if placed is None else placed.result,
            match_used=placed is not None and placed.used,
            tries=0 if placed is None else placed.tries,
            loop_closures=sum(loop.closed for loop in loops),
        )
