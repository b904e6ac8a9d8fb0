"""The judge's truth against driving in physics: what it calls reachable is reached, what it calls blocked is not.

Small yards, each with one feature across them. Truth looks at the yard's mesh alone; then the simulated robot drives, by a scripted
controller and without ROS: along truth's own cells to random reachable ones, and straight at random blocked ones. Truth's limits are
those of the robot as specified, so a robot that leans by more than it may climb counts as stopped, even where its wheels hold (with
the simulation's friction of 1 they climb 45 degrees), and so does one that touches what it could scrape over.
"""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from exploration_evaluation import ReachableGround, RobotShape, reachable_ground
from pybullet_simulation import TICK_S, Simulation, SimulationConfig, World
from pybullet_simulation.solids import Solid, box, hull, walls_around
from pybullet_simulation.world import joined

Floats = NDArray[np.float64]

LENGTH, WIDTH, MIDDLE = 9.0, 3.2, 4.0
START = (1.5, 1.6)
SPEED, TURN_RATE, LOOKAHEAD_M, ARRIVED_M = 0.5, 1.2, 0.4, 0.12
LEANING_RAD = RobotShape().max_slope_rad + math.radians(5.0)


def floor(from_x: float = 0.0, to_x: float = LENGTH) -> Solid:
    return box("floor", (from_x, 0, -2.0), (to_x, WIDTH, 0.0))


def step(height: float) -> list[Solid]:
    return [floor(), box("step", (MIDDLE, 0, -0.05), (LENGTH, WIDTH, height))]


def ramp(degrees: float) -> list[Solid]:
    top, run = 0.9, 0.9 / math.tan(math.radians(degrees))
    profile = [(MIDDLE, 0.0), (MIDDLE, -0.05), (MIDDLE + run, -0.05), (MIDDLE + run, top)]
    wedge = hull("ramp", [(x, y, z) for y in (0, WIDTH) for x, z in profile])
    return [floor(), wedge, box("deck", (MIDDLE + run, 0, -0.05), (LENGTH, WIDTH, top))]


def bar(underside: float) -> list[Solid]:
    return [floor(), box("bar", (MIDDLE, 0, underside), (MIDDLE + 0.1, WIDTH, underside + 0.1))]


def gap(width: float) -> list[Solid]:
    low, high = (WIDTH - width) / 2, (WIDTH + width) / 2
    sides = ((0.0, low), (high, WIDTH))
    return [floor(), *(box("side", (MIDDLE, y0, -0.05), (MIDDLE + 0.3, y1, 1.5)) for y0, y1 in sides)]


def pit() -> list[Solid]:
    return [floor(to_x=MIDDLE), box("bottom", (MIDDLE, 0, -2.0), (LENGTH, WIDTH, -1.0))]


OPEN = {"step 0.05": lambda: step(0.05), "ramp 20": lambda: ramp(20), "bar 1.25": lambda: bar(1.25), "gap 1.6": lambda: gap(1.6)}
CLOSED = {
    "step 0.15": lambda: step(0.15),
    "ramp 40": lambda: ramp(40),
    "bar 0.90": lambda: bar(0.90),
    "gap 0.6": lambda: gap(0.6),
    "pit": pit,
}


def yard(solids: list[Solid]) -> World:
    """A walled yard; the robot starts at its near end and looks along x."""
    solids = [*solids, *walls_around((0, 0), (LENGTH, WIDTH), -2.0, 3.0)]
    vertices, triangles = joined(solids)
    extent = np.array([vertices.min(axis=0), vertices.max(axis=0)])
    return World("yard", tuple(solids), (), vertices, triangles, extent, (*START, 0.0), 0.0)


def truth_of(world: World) -> ReachableGround:
    return reachable_ground(world.vertices, world.triangles, (*START, 0.132))


def way_to(ground: ReachableGround, goal: int) -> Floats:
    """Cells of the shortest way from the start to a cell, over reachable ones only."""
    pairs = cKDTree(ground.points[:, :2]).query_pairs(0.15, output_type="ndarray")
    length = np.linalg.norm(ground.points[pairs[:, 0]] - ground.points[pairs[:, 1]], axis=1)
    graph = coo_array((length, (pairs[:, 0], pairs[:, 1])), shape=(len(ground.points),) * 2)
    first = nearest_place(ground, START)
    _, before = dijkstra(graph.tocsr(), directed=False, indices=first, return_predecessors=True)
    cells = [goal]
    while cells[-1] != first:
        cells.append(int(before[cells[-1]]))
    return ground.points[cells[::-1]]


def nearest_place(ground: ReachableGround, xy: tuple[float, float] | Floats) -> int:
    return int(np.argmin(np.linalg.norm(ground.points[:, :2] - np.asarray(xy), axis=1)))


def then_straight(way: Floats, *stops: Floats) -> Floats:
    """A way that goes on straight to each of some more points, in steps of a cell."""
    for stop in stops:
        steps = max(2, round(float(np.linalg.norm(stop - way[-1, :2])) / 0.1) + 1)
        way = np.vstack([way[:, :2], np.linspace(way[-1, :2], stop, steps)[1:]])
    return way


@dataclass(frozen=True)
class Drive:
    """How a drive ended: nearest distance to the goal, the largest x on the way, and what stopped it (None: nothing)."""

    left_m: float
    farthest_x: float
    trouble: str | None

    @property
    def arrived(self) -> bool:
        return self.left_m <= ARRIVED_M and self.trouble is None


def drive(world: World, way: Floats, seed: int, turn_at_goal: bool = False) -> Drive:
    """Follows (N, 2+) points until the last one, or until something is touched, the robot leans too far, or it gets no farther."""
    simulation = Simulation(SimulationConfig(), world, seed)
    try:
        return _driven(simulation, way[:, :2], turn_at_goal)
    finally:
        simulation.close()


def _driven(simulation: Simulation, way: Floats, turn_at_goal: bool) -> Drive:
    length = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
    left, farthest, turned = math.inf, -math.inf, 0.0
    for _ in range(round((length / SPEED * 2.0 + 12.0) / TICK_S)):
        pose = simulation.T_world_base
        left, farthest = min(left, float(np.linalg.norm(way[-1] - pose[:2, 3]))), max(farthest, float(pose[0, 3]))
        there = left <= ARRIVED_M
        if there and (not turn_at_goal or turned > 2.0 * math.pi):
            return Drive(left, farthest, None)
        v, w = (0.0, TURN_RATE) if there else _command(pose, way)
        turned += abs(w) * TICK_S * there
        data = simulation.tick(v, w)
        if data.contacts:
            return Drive(left, farthest, f"touched with {data.contacts[0].link}")
        if math.acos(min(1.0, data.truth.T_world_base[2, 2])) > LEANING_RAD:
            return Drive(left, farthest, "leaned too far")
    return Drive(left, farthest, "got no farther")


def _command(pose: Floats, way: Floats) -> tuple[float, float]:
    """Towards the first point of the way's rest that lies beyond the lookahead; on the spot while it is not ahead."""
    away = np.linalg.norm(way - pose[:2, 3], axis=1)
    rest = np.flatnonzero((np.arange(len(way)) >= np.argmin(away)) & (away > LOOKAHEAD_M))
    to = way[rest[0] if len(rest) else -1] - pose[:2, 3]
    error = math.remainder(math.atan2(to[1], to[0]) - math.atan2(pose[1, 0], pose[0, 0]), 2.0 * math.pi)
    turn = max(-TURN_RATE, min(TURN_RATE, 2.5 * error))
    return (SPEED if abs(error) < 0.35 else 0.0), turn


@pytest.mark.parametrize("name", OPEN)
def test_cells_that_truth_calls_reachable_are_reached_beyond_the_feature_too(name: str) -> None:
    world, rng = yard(OPEN[name]()), np.random.default_rng(5)
    ground = truth_of(world)
    beyond = np.flatnonzero(ground.points[:, 0] > MIDDLE + 1.0)
    assert len(beyond), "truth does not reach beyond the feature"
    for goal in (*rng.choice(beyond, 2, replace=False), rng.choice(len(ground.points))):
        end = drive(world, way_to(ground, int(goal)), int(goal), turn_at_goal=True)
        assert end.arrived, f"{ground.points[goal].round(2)}: {end}"


@pytest.mark.parametrize("name", CLOSED)
def test_cells_that_truth_calls_blocked_are_not_reached_straight_ahead(name: str) -> None:
    world, rng = yard(CLOSED[name]()), np.random.default_rng(6)
    ground = truth_of(world)
    for _ in range(3):
        goal = rng.uniform((MIDDLE + 0.6, 0.7), (LENGTH - 0.7, WIDTH - 0.7))
        assert np.linalg.norm(ground.points[:, :2] - goal, axis=1).min() > 0.5, "truth reaches beyond the feature"
        way = then_straight(way_to(ground, nearest_place(ground, (2.5, goal[1]))), goal)
        end = drive(world, way, int(1000 * goal[0]))
        assert not end.arrived, f"{goal.round(2)}: {end}"
        assert end.farthest_x > MIDDLE - 0.8, f"it never came to the feature: {end}"


def test_places_beside_a_wall_that_truth_leaves_out_are_too_narrow_to_turn_on() -> None:
    world, rng = yard([floor()]), np.random.default_rng(7)
    ground = truth_of(world)
    for x in rng.uniform(2.0, LENGTH - 1.0, 3):
        goal = np.array([x, rng.choice([0.42, WIDTH - 0.42])])
        assert np.linalg.norm(ground.points[:, :2] - goal, axis=1).min() > 0.1
        before = ground.points[nearest_place(ground, (x - 1.2, goal[1]))]
        beside = np.array([before[0] + 0.6, goal[1]])
        end = drive(world, then_straight(way_to(ground, nearest_place(ground, before[:2])), beside, goal), 1, turn_at_goal=True)
        assert end.trouble is not None and "touched" in end.trouble, f"{goal.round(2)}: {end}"
