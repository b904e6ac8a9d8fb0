"""Localisation only: sweeps are placed in a finished map, whose graph and clouds stay as they are.

`FinishedMap` answers what `PoseGraphMapper` answers, so that the mapping node need not know which of them it has.
"""

from __future__ import annotations

import dataclasses

import gtsam
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pose_graph_mapping.config import MappingConfig
from pose_graph_mapping.graph.dead_reckoning import odometry_covariance
from pose_graph_mapping.graph.localisation import Placement, places
from pose_graph_mapping.graph.loop_closure import Match, beyond_correction
from pose_graph_mapping.graph.mapper import PoseGraphMapper, check_sweep
from pose_graph_mapping.graph.mapping_update import MappingUpdate
from pose_graph_mapping.graph.pose_graph import Edge
from pose_graph_mapping.registration.cloud import PointCloud, merged, voxel_downsample
from pose_graph_mapping.registration.matching import RegistrationResult, Verdict
from pose_graph_mapping.registration.seen_through import Gone
from rigid_geometry import as_transform, inverse

Array = NDArray[np.float64]

_SPACING_M = 1.0  # of the sweeps that one is matched to; a robot that has moved by less is matched to the same


@dataclasses.dataclass(frozen=True, eq=False)
class Placed:
    """Where a sweep was found, by its match or by odometry, the odometry there, and how well that is known."""

    stamp_s: float
    T_map_base: Array
    T_odom_base: Array
    covariance: Array
    matched: bool


@dataclasses.dataclass(eq=False)
class Visits:
    """The first and the newest sweep that were placed: all that a localisation knows beside its map."""

    first: Placed | None = None
    last: Placed | None = None

    def add(self, placed: Placed) -> None:
        """One more."""
        self.first, self.last = self.first or placed, placed

    def all(self) -> tuple[Placed, ...]:
        """In the order of time."""
        found = (self.first,) if self.first is self.last else (self.first, self.last)
        return tuple(p for p in found if p is not None)


class FinishedMap:
    """Places each sweep by a match against the clouds around where odometry has it; the first by a search of the whole map."""

    def __init__(self, mapper: PoseGraphMapper, config: MappingConfig, match: Match, visits: Visits | None = None) -> None:
        """The map of `mapper`, which nothing is added to; `visits` of a localisation that goes on here."""
        self._mapper, self._config, self._match = mapper, config, match
        self.graph = mapper.graph
        self._poses, self._clouds = mapper.graph.poses(), mapper.vertex_clouds()
        self.visits = Visits() if visits is None else visits
        self._area: tuple[Array, PointCloud] | None = None  # around where

    @property
    def vertex_poses(self) -> Array:
        """Those of the newest update."""
        return np.concatenate([self._poses, *(p.T_map_base[None] for p in self.visits.all())])

    @property
    def stamps_s(self) -> tuple[float, ...]:
        """Of all vertex_poses of the newest update."""
        return (*self._mapper.stamps_s, *(p.stamp_s for p in self.visits.all()))

    def kept(self) -> tuple[tuple[float, ...], Array]:
        """Stamps and poses of the map, and of the first sweep that was made here: after these those of the next come."""
        first = [] if self.visits.first is None else [self.visits.first]
        poses = np.concatenate([self._poses, *(p.T_map_base[None] for p in first)])
        return (*self._mapper.stamps_s, *(p.stamp_s for p in first)), poses

    def add_sweep(
        self,
        stamp_s: float,
        points_base: ArrayLike,
        origins_base: ArrayLike,
        T_odom_base: ArrayLike,
        _gravity_base: ArrayLike | None = None,
        _gravity_sigma_rad: float | None = None,
        placement: Placement | None = None,
    ) -> MappingUpdate:
        """Where a sweep was made; nothing becomes of it. Arguments and errors as of `PoseGraphMapper.add_sweep`.

        vertex_poses of the answer are those of the map, then where the first sweep was made here, then where this one was.
        """
        sweep, T_odom = PointCloud.of_finite(points_base, origins_base), as_transform(T_odom_base)
        check_sweep(stamp_s, [p.stamp_s for p in self.visits.all()], sweep)
        if placement is not None:
            result, T_map_base = placement.result, as_transform(placement.result.T_reference_reading)
        elif self.visits.last is not None:
            result, T_map_base = self._matched(voxel_downsample(sweep, self._config.vertex_voxel_m), T_odom)
        else:
            raise ValueError("the first sweep in a finished map is looked for in all of it")
        covariance = result.covariance if placement is not None else self._known(result, T_odom)
        self.visits.add(Placed(float(stamp_s), T_map_base, T_odom, covariance, result.usable))
        return self._update(result, placement.tries if placement else 1)

    def surroundings(self) -> PointCloud:
        """The map's clouds around where the robot was found last, in map; ValueError before it was."""
        if self.visits.last is None:
            raise ValueError("the robot was not found in the map yet")
        return self._around(self.visits.last.T_map_base)

    def vertex_clouds(self) -> tuple[PointCloud, ...]:
        """The light cloud of every vertex, in its body frame."""
        return self._clouds

    def map_cloud(self) -> PointCloud:
        """All of them in the map frame."""
        return self._mapper.map_cloud()

    def gone(self) -> Gone:
        """What later sweeps of the map looked through."""
        return self._mapper.gone()

    def finish_cloud(self) -> None:
        """Nothing is left to do."""

    def solve(self) -> tuple[Edge, ...]:
        """The graph stays as it is."""
        return ()

    def _matched(self, cloud: PointCloud, T_odom_base: Array) -> tuple[RegistrationResult, Array]:
        """The match, and where the robot is: by it where it can be used, else by odometry."""
        last = self.visits.last
        assert last is not None
        T_guess, grown = last.T_map_base @ inverse(last.T_odom_base) @ T_odom_base, self._grown(T_odom_base)
        result = self._match(self._around(T_guess), cloud, T_guess, grown)
        if result.usable and (why := beyond_correction(T_guess, result.T_reference_reading, grown, self._config)):
            result = dataclasses.replace(result, verdict=Verdict.REFUSED, reason=why)
        return result, as_transform(result.T_reference_reading) if result.usable else T_guess

    def _grown(self, T_odom_base: Array) -> Array:
        """How well the pose is known after the way since the last sweep."""
        last = self.visits.last
        assert last is not None
        way = inverse(last.T_odom_base) @ T_odom_base
        carried = np.asarray(gtsam.Pose3(inverse(way)).AdjointMap())
        return np.asarray(carried @ last.covariance @ carried.T) + odometry_covariance(way, self._config)

    def _known(self, result: RegistrationResult, T_odom_base: Array) -> Array:
        """(6, 6) of where the robot is: a match holds some directions, and what it leaves open odometry still knows."""
        grown = self._grown(T_odom_base)
        if not result.usable:
            return grown
        known = grown - grown @ np.linalg.solve(grown + result.covariance, grown)
        return np.asarray(0.5 * (known + known.T))

    def _around(self, T_map_base: Array) -> PointCloud:
        """The clouds of vertices within graph_dist_m, of those near each other one: a place that was visited often costs no more."""
        here = T_map_base[:3, 3]
        if self._area is None or np.linalg.norm(self._area[0] - here) > _SPACING_M:
            gaps = np.linalg.norm(self._poses[:, :3, 3] - here, axis=1)
            near = np.flatnonzero(gaps <= max(self._config.graph_dist_m, gaps.min()))
            chosen = near[places(self._poses[near, :3, 3], int(np.argmin(gaps[near])), _SPACING_M)]
            self._area = here.copy(), merged([self._clouds[k].transformed(self._poses[k]) for k in chosen.tolist()])
        return self._area[1]

    def _update(self, result: RegistrationResult, tries: int) -> MappingUpdate:
        poses, last = self.vertex_poses, self.visits.last
        assert last is not None
        return MappingUpdate(
            vertex_id=len(poses) - 1,
            vertex_poses=poses,
            T_map_odom=last.T_map_base @ inverse(last.T_odom_base),
            result=result,
            match_used=result.usable,
            tries=tries,
            loop_closures=0,
        )


Mapper = PoseGraphMapper | FinishedMap
