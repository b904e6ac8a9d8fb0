"""A robot that stands where it cannot turn, as after a slide against a wall, comes free where its outline does."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from drive_simulation import TICK_S, Drive, Grid, Robot, World, drive

from path_following import FollowerConfig, FollowerObservation, FollowerOutput, FollowerState, PathFollower
from path_following.manoeuvres import make_room
from path_following.surroundings import Surroundings, footprint_lattice
from robot_body import RobotBody

BODY = RobotBody()
WALL_Y = -0.08


def wall_below(*, ahead: float = 9.0, behind: float = -9.0) -> World:
    """A wall whose face lies at y = -0.08 m, and walls across it."""
    world = World(20.0)
    world.lethal[world.cells(-10, 10, -0.4, WALL_Y)] = True
    world.lethal[world.cells(ahead, ahead + 0.3, -0.4, 6)] = True
    world.lethal[world.cells(behind - 0.3, behind, -0.4, 6)] = True
    return world


def beside(gap_m: float) -> float:
    """The y of a robot that stands along that wall."""
    return WALL_Y + gap_m + BODY.half_width_m


def off_the_wall(world: World, gap_m: float, yaw: float = 0.0, robot: Robot | None = None):
    """A robot beside the wall that is sent straight off it."""
    follower, y = PathFollower(FollowerConfig(), BODY), beside(gap_m)
    follower.set_path([(0.0, y, 0.0), (0.0, y + 0.8, 0.0)], None)
    return follower, drive(follower, world, (0.0, y, yaw), robot=robot, seconds=60.0)


@pytest.mark.parametrize("robot", [Robot(), Robot(turn_share=1.1)])
@pytest.mark.parametrize(("gap_m", "yaw"), [(0.02, 0.0), (0.04, 0.0), (0.04, 0.05), (0.04, -0.05)])
def test_robot_beside_a_wall_ends_where_it_can_turn_and_touches_nothing(gap_m, yaw, robot):
    follower, run = off_the_wall(wall_below(), gap_m, yaw, robot)
    assert run.last.state is FollowerState.BLOCKED and "backing_off" in run.states()
    assert not run.touched and run.poses[-1][1] >= WALL_Y + BODY.turning_radius_m
    x, y, yaw = run.poses[-1]
    follower.set_path([(x, y, 0.0), (x, y + 1.5, 0.0)], None)
    assert drive(follower, wall_below(), (x, y, yaw)).last.state is FollowerState.REACHED


def deepest_in_the_wall(run: Drive) -> float:
    """How deep a corner came into it, metres."""
    corners = np.array([(x, y) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]) * (BODY.length_m, BODY.width_m)
    return max(WALL_Y - float((y + corners @ [math.sin(yaw), math.cos(yaw)]).min()) for _, y, yaw in run.poses)


@pytest.mark.parametrize("gap_m", [0.0, -0.01, -0.02, -0.03])
def test_robot_whose_side_lies_in_a_wall_turns_no_corner_deep_into_it(gap_m):
    _, run = off_the_wall(wall_below(), gap_m)
    assert run.last.state is FollowerState.BLOCKED and deepest_in_the_wall(run) < 0.06
    assert gap_m == 0.0 or run.poses[-1][1] >= WALL_Y + BODY.turning_radius_m  # and it comes free


@pytest.mark.parametrize("behind", [0, 253])
def test_robot_whose_side_lies_in_a_wall_of_one_cell_turns_no_corner_through_it(behind):
    """Behind its front the costmap has what was not seen for inscribed."""
    cost = np.zeros((125, 125), dtype=np.uint8)
    cost[:61], cost[60] = behind, 254  # up to y = -0.12
    outline = footprint_lattice(BODY.length_m, BODY.width_m, 0.05)
    around, y = Surroundings(Grid(cost, (-5.0, -5.0)), outline, outline), -0.12 - 0.01 + BODY.half_width_m
    assert around.is_free_turn((0.0, y, 0.0), 0.05, drifting=False)
    assert not around.is_free_turn((0.0, y, 0.0), 0.3, drifting=False) and not around.is_free_turn((0.0, y, 0.0), -0.3, drifting=False)


def test_between_two_walls_it_goes_to_and_fro():
    _, run = off_the_wall(wall_below(ahead=1.0, behind=-1.0), 0.04, 0.05)
    assert not run.touched and run.poses[-1][1] >= WALL_Y + BODY.turning_radius_m
    forward = [output.v > 0 for output in run.outputs if output.v]
    assert len(set(forward)) == 2


def test_robot_that_does_not_move_gives_up():
    _, run = off_the_wall(wall_below(), 0.04, robot=Robot(speed_share=0.0, spins=True))
    assert run.last.state is FollowerState.BLOCKED and len(run.outputs) * TICK_S < 10.0


@dataclass
class Held:
    """A follower that somebody holds for 80 s, as for a sweep, half a second after it has begun to back off."""

    follower: PathFollower
    ticks: int = 0

    def step(self, observation: FollowerObservation) -> FollowerOutput:
        self.ticks += self.follower.state is FollowerState.BACKING_OFF
        return self.follower.step(replace(observation, held=10 <= self.ticks < 1610))


def straight_back():
    world, x = World(20.0), np.linspace(0.0, 4.0, 41)
    world.lethal[world.cells(1.2, 1.5, -4.0, 4.0)] = True
    return world, (0.0, 0.0, 0.0), (np.column_stack([x, 0 * x]), None)


def off_a_wall():
    y = beside(0.04)
    return wall_below(), (0.0, y, 0.0), ([(0.0, y), (0.0, y + 0.8)], None)


def out_of_a_passage():
    world, x = World(20.0), np.linspace(0.0, 5.0, 51)
    world.lethal[world.cells(3.5, 3.8, -4.0, 4.0)] = True
    return world, (0.0, 0.0, 0.0), (np.column_stack([x, 0 * x]), None, (x > 0.5) & (x < 4.5))


@pytest.mark.parametrize("case", [straight_back, off_a_wall, out_of_a_passage])
def test_time_in_which_somebody_holds_the_robot_does_not_end_its_recovery(case):
    ends = []
    for held in (False, True):
        world, start, path = case()
        follower = PathFollower(FollowerConfig(), BODY)
        follower.set_path(*path)
        run = drive(Held(follower) if held else follower, world, start, robot=Robot(speed_share=1.0, turn_share=1.0), seconds=180.0)
        assert run.last.state is FollowerState.BLOCKED and "backing_off" in run.states()
        ends.append(run.poses[-1, :2])
    assert ends[1] == pytest.approx(ends[0], abs=0.2)


def surroundings_of(world: World) -> Surroundings:
    lattice = footprint_lattice(BODY.length_m, BODY.width_m, 0.05)
    return Surroundings(world.grid(), lattice, lattice)


def test_robot_that_is_shut_in_is_told_no_way():
    world = World(20.0)
    world.lethal[:] = True
    world.lethal[world.cells(-0.64, 0.64, -0.4, 0.4)] = False
    around = surroundings_of(world)
    assert not around.has_room((0.0, 0.0, 0.0)) and around.way_to_room((0.0, 0.0, 0.0)) == []


def test_no_way_leads_over_what_is_not_known():
    world, pose = wall_below(), (0.0, beside(0.04), 0.0)
    assert surroundings_of(world).way_to_room(pose)
    world.unknown[world.cells(-10, 10, 0.8, 10)] = True  # nearer than the robot is wide off the wall
    assert surroundings_of(world).way_to_room(pose) == []


def test_way_leads_to_where_it_says():
    world, pose = wall_below(), (0.0, beside(0.04), 0.0)
    around, (x, y, yaw) = surroundings_of(world), pose
    for metres, curvature in around.way_to_room(pose):
        for _ in range(100):
            yaw += curvature * metres / 100
            x, y = x + math.cos(yaw) * metres / 100, y + math.sin(yaw) * metres / 100
    assert around.has_room((x, y, yaw)) and not world.touches(x, y, yaw)
    assert y == pytest.approx(WALL_Y + BODY.turning_radius_m, abs=0.25) and np.isfinite([x, yaw]).all()


@pytest.mark.parametrize(("known_from", "has_room"), [(-9.0, True), (-0.60, True), (-0.52, False)])
def test_room_is_not_made_over_ground_that_nobody_saw(known_from: float, has_room: bool) -> None:
    """Its centre stays on known ground in all three, its rear does not: an edge may be there."""
    cost = np.zeros((125, 125), dtype=np.uint8)
    for x, y in ((0.45, 0.5), (0.6, 0.0)):  # one bars the turn, one the way ahead
        cost[math.floor((y + 5) / 0.08), math.floor((x + 5) / 0.08)] = 254
    cost[:, np.arange(125) * 0.08 - 4.96 < known_from] = 255
    outline = footprint_lattice(BODY.length_m, BODY.width_m, 0.05)
    arc = make_room(FollowerConfig(), Surroundings(Grid(cost, (-5.0, -5.0)), outline, outline), (0.0, 0.0, 0.0), 1.5, drifting=False)
    assert (arc is not None) == has_room
