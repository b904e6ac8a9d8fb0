"""Compiling the kernels beforehand: afterwards no decision may wait for the compiler."""

import sys

import numpy as np
import pytest
from numba.core.registry import CPUDispatcher
from terrain_worlds import BELOW, OCCUPIED, RESOLUTION, decide, grid_of_heights, pose, runs_of

from octomap_server_3dnav.exploration.decide import Explorer
from octomap_server_3dnav.exploration.decision import DecisionKind
from octomap_server_3dnav.exploration.first_decision import compile_kernels
from octomap_server_3dnav.exploration.plan_validity import validity_in
from octomap_server_3dnav.navigation.local_grid import project
from octomap_server_3dnav.navigation.passages import TerrainSettings, navigable_terrain
from octomap_server_3dnav.navigation.standing import with_standing
from octomap_server_3dnav.octree.column_runs import VoxelState
from octomap_server_3dnav.octree.map_builder import Beams, MapBuilder, MapConfig
from octomap_server_3dnav.octree.octree import OctreeMap, SensorModel
from robot_body import RobotBody


def signatures():
    """Argument types that every kernel of the package is compiled for, by name."""
    modules = [m for name, m in list(sys.modules.items()) if name.startswith("octomap_server_3dnav.")]
    kernels = {f"{m.__name__}.{name}": k for m in modules for name, k in vars(m).items() if isinstance(k, CPUDispatcher)}
    return {name: set(kernel.signatures) for name, kernel in kernels.items()}


def busy_world():
    """Walls, a drop, a hole, unknown floor, and the robot in the inflation."""
    states = grid_of_heights(lambda x, y: np.where(x < 6.0, 0.04, -0.4) + 0 * y, 90, 60)
    states[20, :, BELOW:] = OCCUPIED
    states[40:42, 20:22] = VoxelState.UNKNOWN
    states[50:60, 40:] = VoxelState.UNKNOWN
    states[30, 50, BELOW:] = OCCUPIED
    return states


def floor_seen_from_above():
    """Points (N, 3) on a floor of 4 x 4 m, and where their beams began."""
    x, y = np.meshgrid(np.arange(0.04, 4.0, 0.06), np.arange(0.04, 4.0, 0.06))
    points = np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.04)], axis=1).astype(np.float32)
    return points, np.broadcast_to(np.ones(3, dtype=np.float32), points.shape).copy()


def octree_runs():
    """Column runs of a tree, as of a file."""
    tree = OctreeMap(RESOLUTION)
    tree.insert_sweep(*floor_seen_from_above(), 12.0)
    return tree.column_runs()


@pytest.mark.parametrize("runs, here", [(runs_of(busy_world()), pose(22.5 * RESOLUTION, 2.4)), (octree_runs(), pose(2.0, 2.0))])
def test_no_decision_compiles_what_was_not_compiled_beforehand(runs, here):
    compile_kernels()
    before = signatures()
    decision = decide(Explorer(), runs, here)
    assert decision.kind is DecisionKind.GOAL
    validity_in(decision.terrain, decision, 6)
    grid = project(decision.terrain, decision.terrain.robot_xyz[:2], 12.0)
    with_standing(grid, decision.terrain, RobotBody())
    assert signatures() == before


def test_no_sweep_compiles_what_was_not_compiled_beforehand():
    """The columns and heights that the node classifies."""
    compile_kernels()
    before = signatures()
    builder, here = MapBuilder(MapConfig(), SensorModel(), RobotBody()), pose(2.0, 2.0)
    nothing = np.zeros((0, 3), dtype=np.float32)
    builder.add_sweep(Beams(*floor_seen_from_above(), nothing, nothing), 0, np.eye(4)[None])
    decision = decide(
        Explorer(),
        lambda radius_m: navigable_terrain(builder.runs_around(here, radius_m), here, TerrainSettings(), radius_m, builder.heights),
        here,
    )
    assert decision.kind is DecisionKind.GOAL
    assert signatures() == before
