"""Views by a tour over what is open: from where the next sweeps are made, so that all frontiers are seen and the way is short.

Asked by `goals`, which else takes one frontier after the other. Views are made from traversable places of a grid. A tour takes in the
view that shows most for the way that it adds, again and again, and is put in order (`visiting_order`). Its first view is the next goal.
A place that stays although a sweep could see it is looked at from a share of that distance, until that is too near.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from octomap_server_3dnav.exploration.frontier_gain import unknown_area_m2
from octomap_server_3dnav.exploration.frontiers import Frontier
from octomap_server_3dnav.exploration.sight import seen_distances
from octomap_server_3dnav.navigation.planner import PlannerConfig, distances_from, distances_over_ground
from octomap_server_3dnav.terrain.classified_terrain import Terrain, TerrainClass
from rigid_geometry import yaw_of
from rigid_geometry.transforms import Transform
from stage_config import check_ranges, parameter
from visiting_order import best_order

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class TourConfig:
    """Whether goals are views of a tour, where these are made from, and what they show."""

    enabled: bool = parameter(False, "-", "goals are the first views of tours; else one frontier after the other, as in the thesis")
    grid_m: float = parameter(0.5, "m", "grid of the places to look from", low=0.1, high=5.0)
    range_m: float = parameter(6.0, "m", "farthest frontier that a view shows", low=0.5, high=30.0)
    edge_range_m: float = parameter(3.0, "m", "the same for potential cliffs, which are seen from near their edge", low=0.5, high=30.0)
    eye_m: float = parameter(0.9, "m", "height of the laser above the ground", low=0.05, high=5.0)
    nearer: float = parameter(
        0.7, "-", "a place that stays though a sweep could see it is looked at from this share of that distance", low=0.1, high=0.9
    )
    stop_m: float = parameter(3.3, "m", "way that takes as long as a stop: 6.7 s at 0.5 m/s", low=0.0, high=50.0)
    place_m2: float = parameter(3.0, "m2", "what a frontier is worth beside the ground that a view may show", low=0.0, high=100.0)
    ground_range_m: float = parameter(5.0, "m", "ground around a place of which a view may show something", low=0.5, high=30.0)
    latency: float = parameter(0.3, "-", "what it costs that ground waits, beside the time of the whole tour", low=0.0, high=10.0)
    most_views: int = parameter(20, "-", "views of a tour; those that are worth least for their way wait for the next one", low=1, high=50)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self)


@dataclass(frozen=True)
class FirstView:
    """The `node` of a tour's first view, `way_m` away; the frontier that it is named after and how many it shows; and the tour's views."""

    node: int
    way_m: float
    frontier: Frontier
    shown: int
    views: int


class Tour:
    """Tours over the frontiers of a terrain."""

    def __init__(self, config: TourConfig, least_m: float, angle_weight_m_per_rad: float, planner: PlannerConfig) -> None:
        """`least_m`: no view is nearer to floor that was not seen; `angle_weight_m_per_rad`: what it costs to turn to the first view."""
        self._config, self._least_m, self._angle_weight, self._planner = config, least_m, angle_weight_m_per_rad, planner

    def reaches_m(self, frontiers: list[Frontier], terrain: Terrain, vertex_poses: NDArray[np.float64]) -> Floats:
        """(F,) from how near each frontier has to be looked at, after sweeps from (V, 4, 4) poses; 0: no view from nearer is left."""
        c, edges, targets = self._config, _are_edges(frontiers), _targets(frontiers, terrain)
        eyes = vertex_poses[:, :3, 3] + [0.0, 0.0, c.eye_m]
        beside = np.linalg.norm(eyes[:, None] - targets[None], axis=2)
        beside[beside * c.nearer >= self._least_m] = np.inf  # from so near it was looked at, whatever stood between
        nearest = np.minimum(seen_distances(terrain, eyes, targets, edges, c.range_m), beside).min(axis=0)
        reach = np.minimum(np.where(edges, c.edge_range_m, c.range_m), c.nearer * nearest)
        return np.where(reach < self._least_m, 0.0, reach)

    def first_view(self, frontiers: list[Frontier], terrain: Terrain, T_map_base: Transform, reaches_m: Floats) -> FirstView | None:
        """The first view of a tour that shows all frontiers that a view can show from within their reach; None where none can be shown.

        Those that are to be looked at last are shown in passing, and asked for when no other is left.
        """
        nodes = self._places(terrain)
        if not len(nodes) or not frontiers:
            return None
        eyes = terrain.centers(nodes) + [0.0, 0.0, self._config.eye_m]
        shows = seen_distances(terrain, eyes, _targets(frontiers, terrain), _are_edges(frontiers), self._config.range_m) <= reaches_m
        asked = np.array([not f.last for f in frontiers])
        asked = asked if (shows & asked).any() else np.ones_like(asked)
        nodes, shows = nodes[shows.any(axis=1)], shows[shows.any(axis=1)]
        if not len(nodes):
            return None
        ground_m2 = unknown_area_m2(terrain, nodes, self._config.ground_range_m)
        here = distances_over_ground(terrain, self._planner)[nodes] + self._turns(terrain.centers(nodes), T_map_base)
        tour = self._ordered(self._inserted(terrain, nodes, here, (shows, asked, ground_m2)), shows, ground_m2)
        shown = np.flatnonzero(shows[tour[0]])
        named = [k for k in shown if asked[k]] or list(shown)
        return FirstView(int(nodes[tour[0]]), float(here[tour[0]]), frontiers[named[0]], len(shown), len(tour))

    def _places(self, terrain: Terrain) -> Ints:
        """Nodes of a grid where the robot gets to and may turn, away from floor that was not seen."""
        is_open = (terrain.label == TerrainClass.TRAVERSABLE) & terrain.reached & ~terrain.near_kerb
        nodes = np.flatnonzero(is_open & np.isfinite(distances_over_ground(terrain, self._planner)))
        if len(unknown := terrain.frontiers()):
            gap, _ = cKDTree(terrain.centers(unknown)).query(terrain.centers(nodes), distance_upper_bound=self._least_m)
            nodes = nodes[~np.isfinite(gap)]
        step = max(1, round(self._config.grid_m / terrain.resolution))
        at = np.stack([terrain.ix, terrain.iy, terrain.z], axis=1)[nodes].astype(np.int64)
        off = np.abs(2 * (at[:, :2] % step) - step + 1).sum(axis=1)
        order = np.lexsort((nodes, off))
        _, first = np.unique(at[order] // step, axis=0, return_index=True)
        return np.sort(nodes[order[first]])

    def _turns(self, places: NDArray[np.floating], T_map_base: Transform) -> Floats:
        """(C,) metres that turning towards each place costs."""
        off = places[:, :2].astype(np.float64) - T_map_base[:2, 3]
        turn = np.arctan2(off[:, 1], off[:, 0]) - yaw_of(T_map_base)
        return np.asarray(self._angle_weight * np.abs(np.arctan2(np.sin(turn), np.cos(turn))))

    def _inserted(self, terrain: Terrain, nodes: Ints, here: Floats, of: tuple[Mask, Mask, Floats]) -> "_Stops":
        """Views one after the other, each the one that shows most for the way that it adds to the tour."""
        shows, asked, ground_m2 = of
        stops, left, count = _Stops([], [here]), shows.any(axis=0), shows.sum(axis=1)
        while (left & asked).any() and len(stops.views) < self._config.most_views:
            added, place = stops.detours()
            new = shows[:, left].sum(axis=1) * shows[:, left & asked].any(axis=1)
            worth = (self._config.place_m2 + ground_m2 / count) * new
            view = int(np.argmax(worth / (added + self._config.stop_m)))
            stops.insert(int(place[view]), view, distances_from(terrain, int(nodes[view]), self._planner)[nodes])
            left &= ~shows[view]
        return stops

    def _ordered(self, stops: "_Stops", shows: Mask, ground_m2: Floats) -> list[int]:
        """The views in the order of the tour."""
        worth = shows[stops.views].sum(axis=1) * self._config.place_m2 + ground_m2[stops.views]
        weights = np.concatenate([[0.0], self._config.latency * worth / worth.sum()])
        return [stops.views[k - 1] for k in best_order(stops.between(), range(len(stops.views) + 1), weights)[1:]]


@dataclass(frozen=True)
class _Stops:
    """The views of a tour so far, and of the robot and each of them (C,) metres to every place."""

    views: list[int]
    away_m: list[Floats]

    def insert(self, place: int, view: int, away_m: Floats) -> None:
        self.views.insert(place, view)
        self.away_m.insert(place + 1, away_m)

    def detours(self) -> tuple[Floats, Ints]:
        """(C,) metres that each place adds where it fits best into the tour, and (C,) where that is."""
        between = [before + after - before[view] for before, after, view in zip(self.away_m, self.away_m[1:], self.views, strict=False)]
        added = np.array([*between, self.away_m[-1]])
        return added.min(axis=0), added.argmin(axis=0)

    def between(self) -> Floats:
        """(N + 1, N + 1) metres between the robot and the views; back to the robot none."""
        lengths = np.zeros((len(self.away_m), len(self.away_m)))
        lengths[:, 1:] = np.array(self.away_m)[:, self.views]
        return lengths


def _targets(frontiers: list[Frontier], terrain: Terrain) -> Floats:
    """(F, 3) just above the frontiers' middles."""
    return np.array([f.xyz for f in frontiers]).reshape(-1, 3) + [0.0, 0.0, terrain.resolution]


def _are_edges(frontiers: list[Frontier]) -> Mask:
    return np.array([f.potential_cliff for f in frontiers], dtype=np.bool_)
