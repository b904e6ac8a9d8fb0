"""Whether a profile's classification of a shape is what the shape expects: one sentence for every expectation that it misses."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml
from numpy.typing import NDArray
from shape import Expectation, Expected, Shape
from shape_sweeps import PLACEMENTS, Placement, map_of

from explore_command.parameters import read_profile
from octomap_server_3dnav.exploration.frontiers import Frontier, FrontierConfig, find_frontiers
from octomap_server_3dnav.navigation.passages import TerrainSettings, navigable_terrain
from octomap_server_3dnav.navigation.planner import Path as Way
from octomap_server_3dnav.navigation.planner import PlannerConfig, nearest_traversable, plan_path
from octomap_server_3dnav.navigation.straight_lines import PassageConfig
from octomap_server_3dnav.octree.map_builder import MapConfig
from octomap_server_3dnav.octree.octree import SensorModel
from octomap_server_3dnav.terrain.classify import Terrain, TerrainClass, TerrainConfig
from rigid_geometry import inverse, transform_points
from robot_body import RobotBody
from stage_config import load_config

Array = NDArray[np.float64]
C = TypeVar("C")

CONFIG = Path(__file__).resolve().parents[3] / "config"
NODE = "octomap_server_3dnav_node"
SAMPLE_M = 0.07  # less than a voxel
SHARE = 0.95  # of a region that is ground: the laser's lines leave a hole now and then
SLICE_M = 0.25  # all along a box: in nearly all slices of this length
SLICES = 0.8
LEVEL_M = 0.12  # a voxel lies so much higher or lower than what it stands for
END_M = 0.35  # a path ends so near to where it is to lead


@dataclass(frozen=True, eq=False)
class Profile:
    """What octomap_server_3dnav_node is given: the shipped values and over them a profile's."""

    name: str
    values: dict[str, Any]

    def config(self, cls: type[C], section: str = "") -> C:
        """One of its configurations; ConfigError for values that are none."""
        own = {path.rpartition("/")[2]: v for path, v in self.values.items() if path.rpartition("/")[0] == section}
        return load_config(cls, own)

    @property
    def settings(self) -> TerrainSettings:
        """What its terrains are made for."""
        return TerrainSettings(RobotBody(), self.config(TerrainConfig, "terrain"), self.config(PassageConfig, "passages"))


@lru_cache
def profile(name: str) -> Profile:
    """A profile of `config/profiles`; ValueError for none."""
    shipped = yaml.safe_load((CONFIG / "octomap_server_3dnav.yaml").read_text(encoding="utf-8"))
    flat: dict[str, Any] = {}
    for key, value in shipped.items():
        flat |= {f"{key}/{inner}": v for inner, v in value.items()} if isinstance(value, dict) else {key: value}
    return Profile(name, flat | read_profile(name).get(NODE, {}))


@dataclass(frozen=True, eq=False)
class View:
    """A classified shape: its nodes (N, 3) in the shape's frame, and how to ask for more."""

    terrain: Terrain
    placement: Placement
    nodes: Array
    frontiers: list[Frontier]
    planner: PlannerConfig

    def in_box(self, low: Array, high: Array) -> NDArray[np.bool_]:
        """(N,) nodes in a box of the shape's frame, whose heights are those of the ground."""
        pad = np.array([0.0, 0.0, LEVEL_M])
        return np.asarray(((self.nodes >= low - pad) & (self.nodes <= high + pad)).all(axis=1))

    def path_to(self, end: Array) -> Array | None:
        """(K, 3) in the shape's frame, from the robot to the reached ground at a point; None where there is none."""
        x, y, z = transform_points(self.placement.T_map_shape, end[None])[0].astype(float)
        node = nearest_traversable(self.terrain, (x, y, z), END_M)
        found = None if node is None else plan_path(self.terrain, node, self.planner)
        return None if found is None else np.asarray(transform_points(inverse(self.placement.T_map_shape), found.points), np.float64)


def view_of(shape: Shape, of: Profile, placement: Placement) -> View:
    """A shape as a profile classifies it, as a whole."""
    builder, T_map_base = map_of(shape, placement, of.config(MapConfig), of.config(SensorModel, "sensor_model"))
    runs = builder.runs_around(T_map_base, None)
    terrain = navigable_terrain(runs, T_map_base, of.settings, None, builder.heights)
    nodes = np.asarray(transform_points(inverse(placement.T_map_shape), terrain.centers().astype(np.float64)), np.float64)
    ways = of.config(PlannerConfig, "planner")
    return View(terrain, placement, nodes, find_frontiers(terrain, T_map_base, of.config(FrontierConfig, "frontier"), ways), ways)


def misses(shape: Shape, of: Profile) -> list[str]:
    """What is wrong, wherever the shape lies in the grid; empty when all is right."""
    views = (view_of(shape, of, placement) for placement in PLACEMENTS)
    return [f"{view.placement.name}: {e}: {text}" for view in views for e in shape.expectations if (text := miss(view, e, shape))]


def miss(view: View, asked: Expectation, shape: Shape) -> str | None:
    """What there is in place of what is asked, None when it is there."""
    low, high = np.array(asked.low), np.array(asked.high)
    return _JUDGES[asked.kind](view, low, high, shape)


def _shares(view: View, low: Array, high: Array) -> dict[str, float]:
    """Share of the ground of a box that is of each class, what was not reached apart, and "nothing" for the rest."""
    xy = np.stack(np.meshgrid(*(np.arange(a + SAMPLE_M / 2, b, SAMPLE_M) for a, b in zip(low[:2], high[:2], strict=True))), axis=-1)
    points = np.concatenate([xy.reshape(-1, 2), np.zeros((xy.size // 2, 1))], axis=1)
    asked = _columns(np.floor(transform_points(view.placement.T_map_shape, points)[:, :2] / view.terrain.resolution))
    terrain, pad = view.terrain, np.array([view.terrain.resolution, view.terrain.resolution, 0.0])
    inside, columns = view.in_box(low - pad, high + pad), _columns(np.stack([terrain.ix, terrain.iy], axis=1))
    shares = {"nothing": 1.0 - float(np.isin(asked, columns[inside]).mean())}
    for kind in TerrainClass:
        of_kind = inside & (terrain.label == kind)
        if kind is TerrainClass.TRAVERSABLE:
            shares["cut off"] = float(np.isin(asked, columns[of_kind & ~terrain.reached]).mean())
            of_kind &= terrain.reached
        shares[kind.name.lower()] = float(np.isin(asked, columns[of_kind]).mean())
    return shares


def _columns(indices: NDArray[Any]) -> NDArray[np.int64]:
    """(N,) one number for each (N, 2) column."""
    return np.asarray(indices[:, 0].astype(np.int64) * 2**20 + indices[:, 1].astype(np.int64))


def _told(shares: dict[str, float]) -> str:
    return ", ".join(f"{name} {100 * share:.0f} %" for name, share in sorted(shares.items(), key=lambda s: -s[1]) if share > 0)


def _not_reached(view: View, low: Array, high: Array, _: Shape) -> str | None:
    shares = _shares(view, low, high)
    return None if shares["traversable"] >= SHARE else _told(shares)


def _driven(view: View, low: Array, high: Array, _: Shape) -> str | None:
    drivable = view.in_box(low, high) & (view.terrain.label == TerrainClass.TRAVERSABLE)
    return f"{np.count_nonzero(drivable)} traversable voxels" if drivable.any() else None


def _not_all_along(kind: TerrainClass) -> Callable[[View, Array, Array, Shape], str | None]:
    def judge(view: View, low: Array, high: Array, shape: Shape) -> str | None:
        axis = int(np.argmax((high - low)[:2]))
        there = view.in_box(low, high) & (view.terrain.label == kind)
        slices = math.ceil((high - low)[axis] / SLICE_M - 1e-9)
        held = np.unique(np.clip((view.nodes[there, axis] - low[axis]) / SLICE_M, 0, slices - 1).astype(int)).size
        lacking = (
            None if held >= SLICES * slices else f"{kind.name.lower()} in {held} of {slices} slices; {_told(_shares(view, low, high))}"
        )
        return _driven(view, low, high, shape) or lacking

    return judge


def _any_cliff(view: View, low: Array, high: Array, _: Shape) -> str | None:
    count = np.count_nonzero(view.in_box(low, high) & (view.terrain.label == TerrainClass.CLIFF))
    return f"{count} cliff voxels" if count else None


def _frontiers_in(view: View, low: Array, high: Array) -> int:
    inside = view.in_box(low, high)
    return sum(bool(inside[list(f.voxels)].any()) for f in view.frontiers)


def _no_frontier(view: View, low: Array, high: Array, _: Shape) -> str | None:
    return None if _frontiers_in(view, low, high) else f"none; {_told(_shares(view, low, high))}"


def _any_frontier(view: View, low: Array, high: Array, _: Shape) -> str | None:
    count = _frontiers_in(view, low, high)
    return f"{count} frontiers" if count else None


def _no_way(view: View, end: Array, _: Array, shape: Shape) -> str | None:
    """Also a way that leads over what must not be driven on is none."""
    way = view.path_to(end)
    if way is None:
        return "there is none"
    for e in shape.expectations:
        if e.kind in (Expected.NOT_TRAVERSABLE, Expected.OBSTACLE, Expected.CLIFF):
            pad = np.array([0.0, 0.0, LEVEL_M])
            if ((way >= np.array(e.low) - pad) & (way <= np.array(e.high) + pad)).all(axis=1).any():
                return f"leads over what is {e}"
    return None


def _way(view: View, end: Array, _: Array, shape: Shape) -> str | None:
    way = view.path_to(end)
    return None if way is None else f"there is one of {Way(way).length_m:.1f} m"


_JUDGES: dict[Expected, Callable[[View, Array, Array, Shape], str | None]] = {
    Expected.TRAVERSABLE: _not_reached,
    Expected.OBSTACLE: _not_all_along(TerrainClass.OBSTACLE),
    Expected.CLIFF: _not_all_along(TerrainClass.CLIFF),
    Expected.NOT_TRAVERSABLE: _driven,
    Expected.NO_CLIFF: _any_cliff,
    Expected.FRONTIER: _no_frontier,
    Expected.NO_FRONTIER: _any_frontier,
    Expected.PATH: _no_way,
    Expected.NO_PATH: _way,
}
