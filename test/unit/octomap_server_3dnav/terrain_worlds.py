"""Small worlds of voxels for the terrain tests: height functions to dense grids, poses, and pictures of labels as text."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.exploration.decide import Explorer
from octomap_server_3dnav.exploration.decision import Decision, TerrainWithin
from octomap_server_3dnav.exploration.observation import Observation, SweepOutcome
from octomap_server_3dnav.navigation.passages import TerrainSettings, navigable_terrain
from octomap_server_3dnav.navigation.planner import Path, PlannerConfig, plan_path
from octomap_server_3dnav.octree.column_runs import ColumnRuns, VoxelState
from octomap_server_3dnav.terrain.classified_terrain import Terrain, TerrainClass
from octomap_server_3dnav.terrain.config import TerrainConfig
from robot_body import RobotBody

RESOLUTION = 0.08
BELOW = 8  # voxel layers of the grids under height 0
LETTERS = {None: " ", TerrainClass.TRAVERSABLE: ".", TerrainClass.OBSTACLE: "#", TerrainClass.CLIFF: "v"}
LETTERS |= {TerrainClass.INFLATION: "o", TerrainClass.FRONTIER: "?", TerrainClass.POTENTIAL_CLIFF: "!"}

UNKNOWN, FREE, OCCUPIED = (np.uint8(s) for s in VoxelState)


def grid_of_heights(height: Callable[[NDArray, NDArray], NDArray], nx: int, ny: int, top_m: float = 3.0) -> NDArray[np.uint8]:
    """Dense states of a surface of height(x, y) in metres at the columns' centres: free above, unknown below; unknown where it is NaN."""
    x, y = (np.arange(nx) + 0.5) * RESOLUTION, (np.arange(ny) + 0.5) * RESOLUTION
    h = np.broadcast_to(height(x[:, None], y[None, :]), (nx, ny))
    k = np.arange(math.ceil(top_m / RESOLUTION) + BELOW) - BELOW
    voxel = np.where(np.isnan(h), 32000, np.floor(h / RESOLUTION))[:, :, None]
    return np.where(k > voxel, FREE, np.where(k == voxel, OCCUPIED, UNKNOWN))


def runs_of(states: NDArray[np.uint8]) -> ColumnRuns:
    """Column runs of a grid whose layer BELOW starts at z = 0."""
    return ColumnRuns.from_dense(states, (0, 0, -BELOW), RESOLUTION)


def pose(x: float, y: float, ground: float = 0.0, yaw: float = 0.0) -> NDArray[np.float64]:
    """T_map_base of a level robot whose wheels stand at height `ground`."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, ground + RobotBody().base_height_m], [0, 0, 0, 1.0]])


def robot_with(turning_m: float, passage_m: float, **changes: float) -> RobotBody:
    """A robot that turns within a radius, and drives straight where its middle line is so far from all that it keeps off."""
    width_m = 2.0 * min(passage_m, turning_m)
    length_m = math.sqrt(max(0.0, 4.0 * turning_m**2 - width_m**2))
    exact = {"track_m": width_m, "wheel_width_m": 0.0, "straying_m": 0.0, "straying_rad": 0.0}
    return replace(RobotBody(), length_m=length_m, width_m=width_m, **exact, **changes)


def terrain_of(
    states: NDArray[np.uint8],
    T_map_base: NDArray[np.float64],
    radius_m: float | None = None,
    robot: RobotBody | None = None,
    **config: object,
) -> Terrain:
    """The classified terrain of a grid, with its passages."""
    settings = TerrainSettings(robot or RobotBody(), TerrainConfig(**config))  # type: ignore[arg-type]
    return navigable_terrain(runs_of(states), T_map_base, settings, radius_m)


def label_at(terrain: Terrain, x: float, y: float, z: float, reach: float = 0.2) -> TerrainClass | None:
    """Label of the node of the column at a point nearest to height z, None when there is none within `reach`."""
    there = np.flatnonzero((terrain.ix == math.floor(x / terrain.resolution)) & (terrain.iy == math.floor(y / terrain.resolution)))
    gaps = np.abs((terrain.z[there] + 0.5) * terrain.resolution - z)
    return TerrainClass(terrain.label[there[np.argmin(gaps)]]) if gaps.size and gaps.min() <= reach else None


def drawn(terrain: Terrain, y_voxel: int, first: int, last: int) -> str:
    """Labels along x of one row, the topmost node of every column."""
    text = ""
    for ix in range(first, last + 1):
        there = np.flatnonzero((terrain.ix == ix) & (terrain.iy == y_voxel))
        text += LETTERS[TerrainClass(terrain.label[there[np.argmax(terrain.z[there])]]) if there.size else None]
    return text


def label_set(terrain: Terrain) -> set[tuple[int, int, int, int]]:
    """All (ix, iy, z, label)."""
    return set(zip(terrain.ix.tolist(), terrain.iy.tolist(), terrain.z.tolist(), terrain.label.tolist(), strict=True))


def decide(
    explorer: Explorer,
    world: ColumnRuns | TerrainWithin,
    T_map_base: NDArray[np.float64],
    drive_failure: str = "",
    earlier: Sequence[NDArray[np.float64]] = (),
) -> Decision:
    """What is decided after a sweep at a goal, or at where the drive to it failed, and `earlier` sweeps.

    `world`: a known one, or its terrain by radius.
    """

    def terrain_within(radius_m: float | None) -> Terrain:
        if isinstance(world, ColumnRuns):
            return navigable_terrain(world, T_map_base, explorer.terrain_settings, radius_m)
        return world(radius_m)

    return explorer.step(Observation(SweepOutcome.MATCHED, np.array([*earlier, T_map_base]), terrain_within, drive_failure=drive_failure))


def room(nx: int = 90, ny: int = 90, height: Callable[[NDArray, NDArray], NDArray] = lambda x, y: 0.04 + 0 * x * y) -> NDArray[np.uint8]:
    """A walled world whose solid ground reaches down, so that its steps have sides."""
    states = grid_of_heights(height, nx, ny, top_m=3.6)
    layer, top = np.arange(states.shape[2]), (states == OCCUPIED).argmax(axis=2)
    states[(layer <= top[:, :, None]) & (layer >= BELOW)] = OCCUPIED
    for edge in (np.s_[0], np.s_[-1]):
        states[edge, :, BELOW:] = OCCUPIED
        states[:, edge, BELOW:] = OCCUPIED
    return states


def opening(states: NDArray[np.uint8], first: int = 30, last: int = 50) -> NDArray[np.uint8]:
    """The same with a part of its wall at the end of x that nobody has seen."""
    states[-1, first:last] = UNKNOWN
    return states


def way(terrain: Terrain, x: float, y: float) -> Path | None:
    """The path to the surface at a place on level ground; None where there is none."""
    node = terrain.surface_near((x, y, 0.04))
    return None if node is None else plan_path(terrain, node, PlannerConfig())
