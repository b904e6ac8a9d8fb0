"""Compiling the kernels beforehand: afterwards no decision may wait for the compiler."""

import numpy as np
import pytest
from numba.core.registry import CPUDispatcher
from terrain_worlds import BELOW, OCCUPIED, RESOLUTION, grid_of_heights, pose, runs_of

from octomap_server_3dnav import exploration, frontiers, passages, path_search, planner, surface_columns, surface_graph, terrain_kernels
from octomap_server_3dnav.column_runs import VoxelState
from octomap_server_3dnav.octree import OctreeMap

MODULES = (surface_columns, surface_graph, terrain_kernels, passages, frontiers, path_search, planner)


def signatures():
    """Argument types that every kernel is compiled for, by name."""
    kernels = {f"{m.__name__}.{name}": k for m in MODULES for name, k in vars(m).items() if isinstance(k, CPUDispatcher)}
    return {name: set(kernel.signatures) for name, kernel in kernels.items()}


def busy_world():
    """Walls, a drop, a hole, unknown floor, and the robot in the inflation."""
    states = grid_of_heights(lambda x, y: np.where(x < 6.0, 0.04, -0.4) + 0 * y, 90, 60)
    states[20, :, BELOW:] = OCCUPIED
    states[40:42, 20:22] = VoxelState.UNKNOWN
    states[50:60, 40:] = VoxelState.UNKNOWN
    states[30, 50, BELOW:] = OCCUPIED
    return states


def octree_runs():
    """Column runs of a tree: those that the node hands over."""
    tree, origin = OctreeMap(RESOLUTION), np.array([1.0, 1.0, 1.0])
    x, y = np.meshgrid(np.arange(0.04, 4.0, 0.06), np.arange(0.04, 4.0, 0.06))
    points = np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.04)], axis=1).astype(np.float32)
    tree.insert_sweep(points, np.broadcast_to(origin, points.shape).astype(np.float32), 12.0)
    return tree.column_runs()


@pytest.mark.parametrize("runs, here", [(runs_of(busy_world()), pose(22.5 * RESOLUTION, 2.4)), (octree_runs(), pose(2.0, 2.0))])
def test_no_decision_compiles_what_was_not_compiled_beforehand(runs, here):
    exploration.compile_kernels()
    before = signatures()
    planner_of_goals = exploration.ExplorationPlanner()
    decision = planner_of_goals.decide(runs, here)
    assert decision.kind is exploration.DecisionKind.GOAL
    planner_of_goals.still_valid(decision.terrain, decision.path, decision.frontier)
    assert signatures() == before
