"""Views by a tour over what is open: from where the next sweeps are made, so that all frontiers are seen and the way is short.

Beside `goals`, which else takes one frontier after the other. Candidates are traversable places of a grid. A tour is made by inserting the view
that shows most for the way that it adds, and ordered anew (`visiting_order`). Its first view is the next goal. A place that stays although a
sweep could see it is looked at from a share of that distance, until that is too near.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from octomap_server_3dnav.exploration.config import ExplorationConfig
from octomap_server_3dnav.exploration.frontier_gain import unknown_area_m2
from octomap_server_3dnav.exploration.frontiers import Frontier
from octomap_server_3dnav.exploration.sight import seen_distances
from octomap_server_3dnav.navigation.planner import PlannerConfig, distances_from, distances_over_ground
from octomap_server_3dnav.terrain.classified_terrain import Terrain, TerrainClass
from rigid_geometry import angle_difference, transform_points, yaw_of
from rigid_geometry.transforms import Transform
from visiting_order import best_order

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class TourConfig:
    """Where views are made from, what they show, and what a stop costs."""

    enabled: bool = False
    grid_m: float = 0.5
    range_m: float = 6.0
    edge_range_m: float = 2.0
    eye_m: float = 0.9
    stop_m: float = 3.3
    latency: float = 0.3
    place_m2: float = 1.0
    most_views: int = 10
    shrink: float = 0.6
    arrive: bool = True
    gain_share: float = 0.0
    area_weight: float = 1.0
    gain_range_m: float = 4.0


@dataclass(frozen=True)
class Views:
    """A tour's first view: the `node` to sweep from, the frontier that it shows most of, how many it shows and how many views follow."""

    node: int
    frontier: Frontier
    shown: int
    views: int
    way_m: float


class Tour:
    """Tours over the frontiers of one terrain."""

    def __init__(self, config: TourConfig, exploration: ExplorationConfig, planner: PlannerConfig, angle_weight: float) -> None:
        self._config, self._exploration, self._planner, self._angle_weight = config, exploration, planner, angle_weight

    def reaches_m(self, frontiers: list[Frontier], terrain: Terrain, poses: NDArray[np.float64]) -> Floats:
        """(F,) from how near each frontier has to be looked at, after the sweeps from (V, 4, 4) poses that could see it; 0: it was seen from
        so near that no other look will change it."""
        c = self._config
        eyes = np.array([transform_points(T, np.array([[0.0, 0.0, c.eye_m - 0.13]]))[0] for T in poses])
        nearest = seen_distances(terrain, eyes, _targets(terrain, frontiers), c.range_m).min(axis=0)
        widest = np.where([f.potential_cliff for f in frontiers], c.edge_range_m, c.range_m)
        reach = np.minimum(widest, c.shrink * nearest)
        return np.where(reach < self._exploration.min_trim_m, 0.0, reach)

    def first_view(self, frontiers: list[Frontier], terrain: Terrain, T_map_base: Transform, reaches_m: Floats) -> Views | None:
        """The first view of a tour that sees all frontiers that can be seen; None where none can."""
        nodes = self._candidates(terrain)
        if not len(nodes) or not frontiers:
            return None
        eyes = terrain.centers(nodes) + [0.0, 0.0, self._config.eye_m]
        sees = seen_distances(terrain, eyes, _targets(terrain, frontiers), self._config.range_m) <= reaches_m
        worth = np.array([self._config.place_m2 + self._config.gain_share * f.gain_m2 for f in frontiers])
        is_asked = np.array([not f.last for f in frontiers])
        if not (sees & is_asked).any():
            is_asked[:] = True
        if not sees.any():
            return None
        useful = sees.any(axis=1)
        nodes, sees = nodes[useful], sees[useful]
        area = self._config.area_weight * unknown_area_m2(terrain, nodes, self._config.gain_range_m) if self._config.area_weight else np.zeros(len(nodes))
        return self._tour(frontiers, terrain, T_map_base, (nodes, sees, worth, is_asked, area))

    def _candidates(self, terrain: Terrain) -> Ints:
        """Traversable nodes of a grid that the robot reaches and may turn at, away from floor that was not seen."""
        is_open = (terrain.label == TerrainClass.TRAVERSABLE) & terrain.reached & ~terrain.near_kerb
        nodes = np.flatnonzero(is_open)
        nodes = nodes[np.isfinite(distances_over_ground(terrain, self._planner)[nodes])]
        if not len(nodes):
            return nodes
        unknown = terrain.frontiers()
        if len(unknown):
            gap = cKDTree(terrain.centers(unknown)).query(terrain.centers(nodes), distance_upper_bound=self._exploration.min_trim_m)[0]
            nodes = nodes[~np.isfinite(gap)]
        step = max(1, round(self._config.grid_m / terrain.resolution))
        at = np.stack([terrain.ix, terrain.iy, terrain.z], axis=1)[nodes].astype(np.int64)
        off = (np.abs(2 * (at[:, :2] % step) - step + 1)).sum(axis=1)
        order = np.lexsort((nodes, off))
        _, first = np.unique(at[order] // step, axis=0, return_index=True)
        return np.sort(nodes[order[first]])

    def _tour(
        self, frontiers: list[Frontier], terrain: Terrain, T_map_base: Transform, of: tuple[Ints, Mask, Floats, Mask]
    ) -> Views:
        nodes, sees, worth, is_asked, area = of
        all_of = (sees * worth).sum(axis=1)
        here = distances_over_ground(terrain, self._planner)[nodes] + self._turns(terrain, T_map_base, nodes)
        away = [here]  # of the stops, the robot first: (C,) metres to every candidate
        stops: list[int] = []
        left = sees.any(axis=0)
        while (left & is_asked).any() and len(stops) < self._config.most_views:
            added, place = _detours(away, stops)
            value = (sees[:, left] * worth[left]).sum(axis=1)
            value = value + area * value / all_of
            value[~(sees[:, left & is_asked]).any(axis=1)] = 0.0
            view = int(np.argmax(value / (added + self._config.stop_m)))
            if not value[view] > 0 or not np.isfinite(added[view]):
                break
            stops.insert(int(place[view]), view)
            away.insert(int(place[view]) + 1, distances_from(terrain, int(nodes[view]), self._planner)[nodes])
            left &= ~sees[view]
        order = self._ordered(away, stops, sees, worth, area)
        first = stops[order[0]]
        shown = np.flatnonzero(sees[first] & (is_asked if (sees[first] & is_asked).any() else True))
        best = frontiers[int(shown[np.argmax(worth[shown])])]
        return Views(int(nodes[first]), best, len(shown), len(stops), float(here[first]))

    def _turns(self, terrain: Terrain, T_map_base: Transform, nodes: Ints) -> Floats:
        """(C,) metres that turning towards each costs."""
        off = terrain.centers(nodes)[:, :2].astype(np.float64) - T_map_base[:2, 3]
        turn = np.arctan2(off[:, 1], off[:, 0]) - yaw_of(T_map_base)
        return np.asarray(self._angle_weight * np.abs(np.arctan2(np.sin(turn), np.cos(turn))))

    def _ordered(self, away: list[Floats], stops: list[int], sees: Mask, worth: Floats, area: Floats) -> list[int]:
        """The stops in the order of the tour, by their index."""
        between = np.zeros((len(stops) + 1, len(stops) + 1))
        between[:, 1:] = np.array(away)[:, stops]
        between = np.where(np.isfinite(between), between, 1e4)
        weights = np.zeros(len(stops) + 1)
        value = (sees[stops] * worth).sum(axis=1) + area[stops]
        weights[1:] = self._config.latency * value / value.sum()
        return [k - 1 for k in best_order(between, range(len(stops) + 1), weights)[1:]]


def _detours(away: list[Floats], stops: list[int]) -> tuple[Floats, Ints]:
    """(C,) metres that each candidate adds where it fits best into a tour, and (C,) where that is."""
    rows = [away[k] + away[k + 1] - away[k][stops[k]] for k in range(len(stops))]
    added = np.array([*rows, away[-1]])
    return np.nan_to_num(added, nan=np.inf).min(axis=0), np.nan_to_num(added, nan=np.inf).argmin(axis=0)


def _targets(terrain: Terrain, frontiers: list[Frontier]) -> Floats:
    return np.array([f.xyz for f in frontiers]).reshape(-1, 3) + [0.0, 0.0, terrain.resolution]
