"""Driving along kerbs and edges that voxels alone would call ground: the costmap knows them as the classification does (issue 37, 3)."""

import math

import numpy as np
import pytest
from drive_simulation import RESOLUTION, World, drive

from local_terrain_costmap import INSCRIBED, LETHAL, CostmapConfig, CostmapView, LocalCostmap
from octomap_server_3dnav.navigation.local_grid import project
from octomap_server_3dnav.octree.column_runs import ColumnRuns, VoxelState
from octomap_server_3dnav.octree.surface_heights import HitHeights, SurfaceHeights
from octomap_server_3dnav.terrain.classify import TerrainConfig, classify
from path_following import FollowerConfig, FollowerState, PathFollower
from rigid_geometry import transform_from_rpy
from robot_body import RobotBody

HALF_M, KERB_Y, LOW_M, STEP_M = 4.0, 0.4, 0.02, 0.13  # both treads lie in neighbouring voxels, a step that voxels call none
CELLS = round(2 * HALF_M / RESOLUTION)


def heights_of(kerb: float) -> tuple[float, float]:
    """Heights of the ground this side of the kerb and beyond it: `kerb` +1 up, -1 down."""
    return (LOW_M, LOW_M + STEP_M) if kerb > 0 else (LOW_M + STEP_M, LOW_M)


def street(kerb: float) -> tuple[ColumnRuns, SurfaceHeights]:
    """A level place with a kerb along x at y = `KERB_Y`, up or down, as dense laser lines leave it in the map."""
    here, beyond = heights_of(kerb)
    at = np.arange(-HALF_M + 0.01, HALF_M, 0.02)
    x, y = (v.ravel() for v in np.meshgrid(at, at))
    ground = np.column_stack([x, y, np.where(y < KERB_Y, here, beyond)])
    face = np.array([(x, KERB_Y, z) for x in at for z in np.arange(LOW_M, LOW_M + STEP_M, 0.02)])
    hits = np.concatenate([ground, face])
    states = np.full((CELLS, CELLS, 30), VoxelState.FREE, dtype=np.uint8)
    states[:, :, :4] = VoxelState.UNKNOWN
    ix, iy, iz = np.floor(hits / RESOLUTION).astype(int).T
    states[ix + CELLS // 2, iy + CELLS // 2, iz + 4] = VoxelState.OCCUPIED
    measured = SurfaceHeights(RESOLUTION)
    measured.add(HitHeights.of(hits, RESOLUTION))
    return ColumnRuns.from_dense(states, (-CELLS // 2, -CELLS // 2, -4), RESOLUTION), measured


class Street(World):
    """The truth: the outline must not come beyond the kerb. The costmap: made of the classified grid."""

    def __init__(self, kerb: float, measured: bool = True) -> None:
        self.size = 2 * HALF_M
        self.__post_init__()
        self.lethal[:, :] = (np.arange(CELLS) + 0.5)[:, None] * RESOLUTION - HALF_M > KERB_Y
        runs, heights = street(kerb)
        T_map_base = transform_from_rpy((-2.5, -0.5, heights_of(kerb)[0] + 0.132))
        terrain = classify(runs, T_map_base, TerrainConfig(), RobotBody(), None, heights if measured else None)
        self.terrain_grid = project(terrain, (0.0, 0.0), self.size)
        costmap, g = LocalCostmap(CostmapConfig(size_m=self.size), RobotBody()), self.terrain_grid
        costmap.set_terrain(g.cost, g.origin_xy, g.resolution, g.height, g.distance)
        self.view = costmap.master()

    def grid(self) -> CostmapView:
        return self.view


def along(y: float) -> np.ndarray:
    """A path along the kerb."""
    return np.array([(x, y, 0.0) for x in np.arange(-2.5, 2.6, 0.1)])


@pytest.mark.parametrize("kerb", [1.0, -1.0])
def test_voxels_alone_would_call_the_kerb_ground(kerb):
    assert not (Street(kerb, measured=False).view.cost >= INSCRIBED).any()
    lethal = np.flatnonzero(Street(kerb).view.cost[:, CELLS // 2] == LETHAL)
    assert lethal.size and abs((lethal.mean() + 0.5) * RESOLUTION - HALF_M - KERB_Y) < RESOLUTION


@pytest.mark.parametrize("kerb", [1.0, -1.0])
@pytest.mark.parametrize("gap_m", [0.15, 0.25, 0.32])
def test_robot_whose_path_leads_too_near_to_the_kerb_does_not_touch_it(kerb, gap_m):
    follower, world = PathFollower(FollowerConfig(), RobotBody()), Street(kerb)
    follower.set_path(along(KERB_Y - gap_m), None)
    assert not drive(follower, world, (-2.5, KERB_Y - 0.6, 0.0)).touched


@pytest.mark.parametrize("kerb", [1.0, -1.0])
def test_robot_drives_along_the_kerb_half_a_metre_off(kerb):
    follower, world = PathFollower(FollowerConfig(), RobotBody()), Street(kerb)
    follower.set_path(along(KERB_Y - 0.5), 0.0)
    result = drive(follower, world, (-2.5, KERB_Y - 0.5, 0.0))
    assert result.last.state is FollowerState.REACHED and not result.touched


@pytest.mark.parametrize("kerb", [1.0, -1.0])
def test_cells_cost_inscribed_up_to_half_the_robot_s_width_from_the_kerb_itself(kerb):
    world = Street(kerb)
    column = world.view.cost[:, CELLS // 2]
    away = KERB_Y - ((np.arange(CELLS) + 0.5) * RESOLUTION - HALF_M)
    exact = world.terrain_grid.distance[:, CELLS // 2]
    here = (away > 0.1) & (away < 0.8)
    np.testing.assert_allclose(exact[here], away[here], atol=0.05)
    np.testing.assert_array_equal(column[here] >= INSCRIBED, exact[here] <= RobotBody().half_width_m)
    assert math.isclose(float(exact[here].min()), float(away[here].min()), abs_tol=0.05)
