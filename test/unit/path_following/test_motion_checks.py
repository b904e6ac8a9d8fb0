"""The outline on the grid, arcs and the path's geometry, each against a closed form or brute force."""

import math

import numpy as np
import pytest
from drive_simulation import Grid
from hypothesis import given
from hypothesis import strategies as st
from numba.core.registry import CPUDispatcher

from local_terrain_costmap import CostmapConfig, LocalCostmap, line_layer, obstacle
from path_following import surroundings
from path_following.outline import deepest, is_no_more
from path_following.pursuit import approached, steering_to
from path_following.reference_path import ReferencePath
from path_following.surroundings import Surroundings, Unknown, arc_poses, footprint_lattice, turn_poses
from path_following.trail import Trail
from robot_body import RobotBody

LATTICE = footprint_lattice(0.99, 0.67, 0.05)


def around(*lethal: tuple[float, float], unknown: tuple[float, float] | None = None, trail: Trail | None = None) -> Surroundings:
    cost = np.zeros((125, 125), dtype=np.uint8)
    for x, y in lethal:
        cost[math.floor((y + 5) / 0.08), math.floor((x + 5) / 0.08)] = 254
    if unknown:
        cost[math.floor((unknown[1] + 5) / 0.08), math.floor((unknown[0] + 5) / 0.08)] = 255
    return Surroundings(Grid(cost, (-5.0, -5.0)), LATTICE, LATTICE, trail=trail)


def trail_from(x: float, yaw: float = 0.0) -> Trail:
    """Along x up to the origin."""
    trail = Trail()
    for at in np.arange(x, 0.001, 0.01):
        trail.add((float(at), 0.0, yaw))
    return trail


def test_lattice_covers_the_outline_without_gaps():
    assert np.abs(LATTICE).max(axis=0).tolist() == [0.495, 0.335]
    for axis in range(2):
        assert np.diff(np.unique(LATTICE[:, axis])).max() <= 0.05 + 1e-12


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-math.pi, math.pi), st.floats(-2, 2), st.floats(0.05, 1.5))
def test_arc_is_that_of_small_steps(x, y, yaw, curvature, length):
    end = arc_poses((x, y, yaw), 1.0, curvature, length)[-1]
    steps = 2000
    for _ in range(steps):
        middle = yaw + curvature * length / steps / 2
        x, y, yaw = x + length / steps * math.cos(middle), y + length / steps * math.sin(middle), yaw + curvature * length / steps
    np.testing.assert_allclose(end, [x, y, yaw], atol=1e-6)


def test_backward_arc_leads_back_where_the_forward_one_came_from():
    end = arc_poses((1.0, 2.0, 0.5), 1.0, 0.8, 0.6)[-1]
    np.testing.assert_allclose(arc_poses(tuple(end), -1.0, 0.8, 0.6)[-1], [1.0, 2.0, 0.5], atol=1e-12)


@pytest.mark.parametrize(("x", "free"), [(1.0, False), (1.09, False), (1.25, True)])
def test_way_ahead_is_free_up_to_the_outline(x, free):
    assert around((x, 0.3)).is_free(arc_poses((0.0, 0.0, 0.0), 1.0, 0.0, 0.6), Unknown.ALLOWED) is free


@pytest.mark.parametrize(("y", "free"), [(0.3, False), (0.45, True)])
def test_what_lies_beside_the_way_does_not_block_it(y, free):
    assert around((0.9, y)).is_free(arc_poses((0.0, 0.0, 0.0), 1.0, 0.0, 0.6), Unknown.ALLOWED) is free


def test_turn_sweeps_the_corners():
    corner_only = around((0.0, 0.52))
    assert corner_only.is_free(turn_poses((0.0, 0.0, 0.0), 0.3), Unknown.ALLOWED)
    assert not corner_only.is_free(turn_poses((0.0, 0.0, 0.0), 1.6), Unknown.ALLOWED)
    assert around((0.0, 0.7)).is_free(turn_poses((0.0, 0.0, 0.0), 6.28), Unknown.ALLOWED)


def test_unknown_cells_block_as_much_as_asked():
    ahead = arc_poses((0.0, 0.0, 0.0), 1.0, 0.0, 0.6)
    under_centre, under_side = around(unknown=(0.3, 0.0)), around(unknown=(0.8, 0.25))
    assert [under_centre.is_free(ahead, u) for u in Unknown] == [True, False, False]
    assert [under_side.is_free(ahead, u) for u in Unknown] == [True, True, False]


def test_touched_cell_may_be_left_but_not_run_over():
    touching = around((0.45, 0.0))
    assert touching.is_free(arc_poses((0.0, 0.0, 0.0), -1.0, 0.0, 0.5), Unknown.ALLOWED)
    both = around((0.45, 0.0), (-0.7, 0.0), (-0.7, 0.1), (-0.7, 0.2), (-0.7, -0.1))
    assert not both.is_free(arc_poses((0.0, 0.0, 0.0), -1.0, 0.0, 0.5), Unknown.ALLOWED)


def test_inscribed_cells_may_be_left_but_not_entered():
    cost = np.zeros((125, 125), dtype=np.uint8)
    cost[:, 63:70] = 253
    grid = Surroundings(Grid(cost, (-5.0, -5.0)), LATTICE, LATTICE)
    out, into = arc_poses((0.1, 0.0, math.pi), 1.0, 0.0, 0.6), arc_poses((-0.3, 0.0, 0.0), 1.0, 0.0, 0.6)
    assert grid.is_free(out, Unknown.ALLOWED) and not grid.is_free(into, Unknown.ALLOWED)


@given(st.floats(0.1, 3.0), st.floats(-1.5, 1.5))
def test_pursuit_arc_passes_through_its_target(distance, bearing):
    target = distance * np.array([math.cos(bearing), math.sin(bearing)])
    steering = steering_to((0.0, 0.0, 0.0), target)
    assert steering.heading_error == pytest.approx(bearing)
    if distance >= 0.2 and abs(steering.curvature) > 1e-6:
        length = 2 * bearing / steering.curvature
        np.testing.assert_allclose(arc_poses((0.0, 0.0, 0.0), 1.0, steering.curvature, length)[-1, :2], target, atol=1e-9)


def test_steps_of_a_grid_are_smoothed_and_ends_kept():
    xy = np.vstack([[0.0, 0.0], np.cumsum(np.tile([[0.08, 0.0], [0.0, 0.08]], (30, 1)), axis=0)])
    path = ReferencePath(xy, 0.2)
    np.testing.assert_allclose(path.xy[[0, -1]], xy[[0, -1]])
    middle = path.xy[8:-8]
    assert np.abs(middle[:, 0] - middle[:, 1] - 0.04).max() < 0.02


def test_projection_agrees_with_dense_sampling():
    rng = np.random.default_rng(4)
    path = ReferencePath(np.cumsum(rng.normal(0.05, 0.1, (40, 2)), axis=0), 0.2)
    at = np.linspace(0.0, path.length, 20000)
    samples = path.points_at(at)
    for xy in rng.uniform(-0.5, 3.0, (50, 2)):
        nearest = np.linalg.norm(samples - xy, axis=1).min()
        assert abs(path.project(xy, 0.0, path.length).off_path) == pytest.approx(nearest, abs=1e-3)


def test_projection_stays_on_its_level_where_the_path_crosses_itself():
    path = ReferencePath(np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 2.0], [2.0, -2.0]]), 0.0)
    crossing = np.array([2.0, 0.05])
    assert path.project(crossing, 1.0, 3.0).s == pytest.approx(2.0, abs=0.1)
    assert path.project(crossing, 9.0, 11.0).s == pytest.approx(9.95, abs=0.1)


def test_side_of_the_path_is_positive_on_the_left():
    path = ReferencePath(np.array([[0.0, 0.0], [2.0, 0.0]]), 0.2)
    assert path.project(np.array([1.0, 0.3]), 0.0, 2.0).off_path == pytest.approx(0.3)
    assert path.project(np.array([1.0, -0.3]), 0.0, 2.0).off_path == pytest.approx(-0.3)


@given(st.floats(-1, 1), st.floats(-1, 1))
def test_approach_never_overshoots_and_keeps_its_limits(value, wanted):
    new = approached(value, wanted, 0.1, 0.3)
    assert min(value, wanted) - 1e-12 <= new <= max(value, wanted) + 1e-12
    assert abs(new - value) <= 0.3 + 1e-12


def signatures() -> dict[str, set[object]]:
    kernels = [
        kernel for module in (surroundings, obstacle, line_layer) for kernel in vars(module).values() if isinstance(kernel, CPUDispatcher)
    ]
    inner = deepest, is_no_more  # other kernels alone call them
    return {kernel.__name__: set(kernel.signatures) for kernel in kernels if kernel not in inner}


def test_nothing_that_a_driving_robot_asks_compiles_what_was_not_compiled_beforehand():
    surroundings.compile_kernels()
    obstacle.compile_kernels()
    line_layer.compile_kernels()
    before, costmap, pose = signatures(), LocalCostmap(CostmapConfig(), RobotBody()), (0.2, 0.1, 0.3)
    costmap.add_scan([[1.0, 0.2], [1.1, 0.2]], [[2.0, 1.0]], (0.0, 0.0))
    singles = np.array([[1.0, 0.2, 0.5], [1.1, 0.2, 0.5]], np.float32)
    costmap.add_line(1.0, singles, singles[:, ::-1], np.tile(np.eye(4), (2, 1, 1))[1, :3, 3])  # as a LineSource has them
    there = Surroundings(costmap.master(), LATTICE, LATTICE)
    assert there.cost_under(pose) >= 0 and there.mean_cost(turn_poses(pose, 1.0)) >= 0.0
    assert there.is_free_turn(pose, 1.0, drifting=True) in (True, False) and there.is_clear(arc_poses(pose, 1.0, 0.2, 0.5)) in (True, False)
    assert signatures() == before and all(before.values())


def test_back_the_way_it_came_the_robot_may_graze_a_cell_of_an_edge():
    back, edge = arc_poses((0.0, 0.0, 0.0), -1.0, 0.0, 0.8), (-0.8, 0.34)
    assert not around(edge).is_clear(back)
    assert around(edge, trail=trail_from(-1.0)).is_clear(back)
    assert not around(edge, trail=trail_from(-0.1)).is_clear(back)  # it was not so far back
    assert not around(edge, trail=trail_from(-1.0, yaw=0.2)).is_clear(back)  # nor turned so
    beside = [(x, 0.34) for x in np.arange(-1.6, -0.6, 0.08)]
    assert not around(*beside, trail=trail_from(-1.0)).is_clear(back)  # a wall along it
    behind = [(-0.8, y) for y in np.arange(-0.3, 0.31, 0.08)]
    assert not around(*behind, trail=trail_from(-1.0)).is_clear(back)  # something that came since


def test_back_the_way_it_came_the_robot_grazes_no_more_than_it_did_there():
    """It came past the edge 2.5 cm beside the line along which it would go back; the edge's cell begins 28 cm beside 0."""
    grazing, passing, edge = -0.045, -0.07, (-0.8, 0.34)
    came, passed = Trail(), Trail()
    for at in np.arange(-1.0, 0.001, 0.01):
        came.add((float(at), grazing + 0.01, 0.0))
        passed.add((float(at), passing, 0.0))
    back = arc_poses((0.0, grazing, 0.0), -1.0, 0.0, 0.8)
    assert around(edge).is_clear(arc_poses((0.0, passing, 0.0), -1.0, 0.0, 0.8))
    assert around(edge, trail=came).is_clear(back)
    assert not around(edge, trail=passed).is_clear(back)


def test_robot_whose_corner_grazes_something_turns_away_from_it_and_no_deeper_into_it():
    there, grazing = around((0.47, 0.39), (0.39, 0.39)), (0.0, 0.0, 0.06)
    assert there.is_free_turn(grazing, -0.2, drifting=False)
    assert not there.is_free_turn(grazing, 0.15, drifting=False)


def holds(trail: Trail, *poses: tuple[float, float, float]) -> list[bool]:
    return [len(there) > 0 for there in trail.like(np.array(poses))]


def test_trail_ends_where_the_robot_was_carried_away():
    trail = trail_from(-1.0)
    assert holds(trail, (-0.5, 0.02, 0.03), (-0.5, 0.05, 0.0), (-0.5, 0.0, 0.1), (-1.5, 0.0, 0.0)) == [True, False, False, False]
    trail.add((0.5, 0.0, 0.0))
    assert holds(trail, (-0.5, 0.0, 0.0), (0.5, 0.0, 2 * math.pi)) == [False, True]


def test_trail_goes_along_where_the_map_is_corrected():
    trail = trail_from(-1.0)
    trail.carry_to((0.02, 0.08, 0.1))
    behind = (0.02 - 0.5 * math.cos(0.1), 0.08 - 0.5 * math.sin(0.1), 0.1)
    assert holds(trail, behind, (-0.5, 0.0, 0.0)) == [True, False]
    trail.carry_to((2.0, 0.0, 0.0))
    assert holds(trail, behind, (2.0, 0.0, 0.0)) == [False, False]
