"""A decision beforehand, in a small world: afterwards no sweep waits for the compiler or the disk."""

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.exploration.decide import Explorer
from octomap_server_3dnav.exploration.frontiers import FrontierConfig
from octomap_server_3dnav.exploration.lookouts import find_lookouts
from octomap_server_3dnav.exploration.observation import Observation, SweepOutcome
from octomap_server_3dnav.navigation.headroom import with_seen_headroom
from octomap_server_3dnav.navigation.local_grid import project
from octomap_server_3dnav.navigation.passages import TerrainSettings, navigable_terrain
from octomap_server_3dnav.navigation.standing import with_standing
from octomap_server_3dnav.octree.column_runs import ColumnRuns, VoxelState
from octomap_server_3dnav.octree.surface_heights import HitHeights, SurfaceHeights
from octomap_server_3dnav.terrain.classified_terrain import Terrain

_SETTINGS, _FREE, _OCCUPIED, _UNKNOWN = TerrainSettings(), VoxelState.FREE, VoxelState.OCCUPIED, VoxelState.UNKNOWN


def compile_kernels() -> None:
    """Compiles every kernel of the terrain analysis and the planner for the types that `Explorer.step` passes."""
    states = np.zeros((64, 64, 24), dtype=np.uint8)
    states[:, :, 4], states[:, :, 5:] = _OCCUPIED, _FREE
    states[:, 0, 4:] = _OCCUPIED  # a wall, a drop that was seen, a hole to bridge, and three sides that go on
    states[:, 60:, 1:5] = _FREE
    states[40, 30, 4] = _UNKNOWN
    around = _decide(states, 2.5, None)
    with_standing(project(around, around.robot_xyz[:2], 5.0), around, _SETTINGS.robot)
    states[32, :27, 4:], states[32, 38:, 4:] = _OCCUPIED, _OCCUPIED  # a narrow door
    heights = SurfaceHeights(0.08)
    heights.add(HitHeights.of((np.argwhere(states == _OCCUPIED) + 0.5) * 0.08, 0.08))
    _decide(states, 1.2, heights)
    states[32:, :27, 4:], states[32:, 38:, 4:], states[52:, 27:38] = _OCCUPIED, _OCCUPIED, _UNKNOWN  # a dead end
    dead_end = navigable_terrain(ColumnRuns.from_dense(states), _pose(1.2), _SETTINGS, None)
    find_lookouts(dead_end, FrontierConfig(least_lookout_gain_m2=0.0), _SETTINGS)
    with_seen_headroom(dead_end, _SETTINGS)


def _pose(x: float) -> NDArray[np.float64]:
    T_map_base = np.eye(4)
    T_map_base[:3, 3] = x, 2.5, 0.08 * 5 + _SETTINGS.robot.base_height_m
    return T_map_base


def _decide(states: NDArray[np.uint8], x: float, heights: SurfaceHeights | None) -> Terrain:
    """Decides once for a robot at x in a grid of voxels; the terrain around it."""
    runs, T_map_base = ColumnRuns.from_dense(states), _pose(x)

    def terrain_within(radius_m: float | None) -> Terrain:
        return navigable_terrain(runs, T_map_base, _SETTINGS, radius_m, heights)

    Explorer().step(Observation(SweepOutcome.MATCHED, T_map_base[None], terrain_within))
    return terrain_within(None)
