"""Straight through where the robot fits but cannot turn: doors of 0.9 m and more, entered in line, and out again when they are blocked."""

import math

import numpy as np
import pytest
from drive_simulation import Drive, Robot, World, drive

from path_following import FollowerConfig, FollowerState, PathFollower
from path_following.reference_path import ReferencePath
from robot_body import RobotBody

RUN_UP_M, NARROW_M = 0.8, 0.7  # of a wall at x = 0, 0.16 m thick


def world_with_door(width: float, y: float = 0.0) -> World:
    world = World(12.0)
    world.lethal[world.cells(-0.08, 0.08, -6.0, 6.0)] = True
    world.lethal[world.cells(-0.08, 0.08, y - width / 2, y + width / 2)] = False
    return world


def through_the_door(before: tuple[float, float], after: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """A path (K, 3) over two places, straight from one run-up's beginning to the other's end, and where it is straight."""
    ends = [(-NARROW_M - RUN_UP_M, 0.0), (NARROW_M + RUN_UP_M, 0.0)]
    points, straight = [], []
    for a, b, is_straight in ((before, ends[0], False), (*ends, True), (ends[1], after, False)):
        count = max(2, math.ceil(math.dist(a, b) / 0.15))
        points += np.linspace(a, b, count, endpoint=False).tolist()
        straight += [is_straight] * count
    xy = np.array([*points, after])
    return np.column_stack([xy, np.zeros(len(xy))]), np.array([*straight, False])


def follower_on(before: tuple[float, float], after: tuple[float, float], goal_yaw: float | None = None) -> PathFollower:
    follower = PathFollower(FollowerConfig(), RobotBody())
    points, straight = through_the_door(before, after)
    follower.set_path(points, goal_yaw, straight)
    return follower


ROBOTS = [Robot(), Robot(sideways=0.04), Robot(turn_share=0.7), Robot(slide_m_per_rad=0.05)]


@pytest.mark.parametrize("robot", ROBOTS, ids=["good", "pulls aside", "turns too little", "slides when it turns"])
@pytest.mark.parametrize("start", [(-3.0, 0.0, 0.0), (-1.4, 2.0, -1.6), (-1.2, -2.0, 3.0), (-2.5, 1.5, 1.0)], ids=str)
@pytest.mark.parametrize("width", [0.8, 0.88, 0.96])
def test_door_is_entered_in_line_and_passed_without_a_touch(width, start, robot):
    done = drive(follower_on(start[:2], (2.5, 1.0)), world_with_door(width), start, robot=robot)
    assert done.last.state is FollowerState.REACHED and not done.touched
    inside = np.abs(done.poses[:, 0]) < 0.6
    assert np.abs(done.poses[inside, 2]).max() < 0.15 and np.abs(done.poses[inside, 1]).max() < 0.04
    speeds = np.hypot(*np.diff(done.poses[:, :2], axis=0).T) / 0.05
    assert speeds[inside[1:]].max() <= 0.26


@pytest.mark.parametrize("robot", ROBOTS[:3], ids=["good", "pulls aside", "turns too little"])
@pytest.mark.parametrize("before", [(-1.4, 1.0), (-1.4, -2.0), (-3.0, 0.5)], ids=str)
def test_path_to_a_passage_is_driven_to_its_very_end(before, robot):
    points, straight = through_the_door(before, (2.5, 1.0))
    entry = int(straight.argmax()) + 1
    follower = PathFollower(FollowerConfig(), RobotBody())
    follower.set_path(points[:entry], 0.0, straight[:entry])
    heading = math.atan2(*(points[entry - 1] - points[0])[1::-1])
    done = drive(follower, world_with_door(0.88), (*before, heading), robot=robot)
    assert done.last.state is FollowerState.REACHED
    assert math.dist(done.poses[-1, :2], points[entry - 1, :2]) < 0.035
    follower.set_path(points[:entry], 0.0)
    assert math.dist(drive(follower, world_with_door(0.88), (*before, heading)).poses[-1, :2], points[entry - 1, :2]) > 0.045


def test_robot_that_stands_in_the_door_turned_away_drives_out_backward_to_the_end_of_its_line():
    points, straight = through_the_door((0.1, 0.0), (2.5, 1.0))
    follower = PathFollower(FollowerConfig(), RobotBody())
    follower.set_path(points[straight.argmax() :][4:], None, straight[straight.argmax() :][4:])
    done = drive(follower, world_with_door(0.88), (-0.5, 0.02, math.pi))
    assert done.last.state is FollowerState.REACHED and not done.touched
    assert min(out.v for out in done.outputs) < -0.1
    inside = done.poses[:, 0] < NARROW_M + RUN_UP_M - 0.1
    assert np.abs(np.abs(done.poses[inside, 2]) - math.pi).max() < 0.2


def test_robot_whose_path_begins_in_the_line_backs_to_its_end_although_the_costmap_shows_room_to_turn():
    follower, x = PathFollower(FollowerConfig(), RobotBody()), np.linspace(0.0, 2.0, 15)
    follower.set_path(np.column_stack([x, 0 * x, 0 * x]), None, x < 2.0)
    done = drive(follower, World(12.0), (0.0, 0.02, math.pi))
    assert done.last.state is FollowerState.REACHED and done.poses[-1, 0] > 1.9
    assert np.abs(np.abs(done.poses[:, 2]) - math.pi).max() < 0.2


@pytest.mark.parametrize("heading", [math.pi, -math.pi + 0.02])
def test_heading_that_wraps_is_no_turn_on_which_the_robot_slides(heading):
    world, follower = world_with_door(0.88), PathFollower(FollowerConfig(), RobotBody())
    world.lethal[world.cells(-6.0, 6.0, -6.0, -0.44)] = world.lethal[world.cells(-6.0, 6.0, 0.44, 6.0)] = True
    x = np.linspace(-0.4, 2.0, 17)
    follower.set_path(np.column_stack([x, 0 * x, 0 * x]), None, x < 2.0)
    done = drive(follower, world, (-0.4, 0.03, heading), robot=Robot(slope_rad=0.2))
    assert done.last.state is FollowerState.REACHED and not done.touched
    assert np.abs(done.poses[done.poses[:, 0] > 1.2, 1]).max() < 0.01


@pytest.mark.parametrize("way", [0.0, math.pi], ids=["forward", "backward"])
def test_robot_beside_the_line_gets_back_to_it_where_its_corners_may_not_swing_far(way):
    world, follower = world_with_door(0.88), PathFollower(FollowerConfig(), RobotBody())
    world.lethal[world.cells(-6.0, 6.0, -6.0, -0.4)] = world.lethal[world.cells(-6.0, 6.0, 0.4, 6.0)] = True
    x = np.linspace(-0.4, 3.0, 23)
    follower.set_path(np.column_stack([x, 0 * x, 0 * x]), None, x < 3.0)
    done = drive(follower, world, (-0.4, 0.04, way + 0.01))
    assert done.last.state is FollowerState.REACHED and not done.touched
    assert np.abs(done.poses[done.poses[:, 0] > 1.2, 1]).max() < 0.02


def test_door_that_is_blocked_while_the_robot_is_in_it_is_left_the_way_it_came():
    world, follower = world_with_door(0.88), follower_on((-3.0, 0.0), (2.5, 1.0))

    def block(t: float) -> None:
        world.lethal[world.cells(1.0, 1.3, -1.0, 1.0)] |= t > 13.0

    done = drive(follower, world, (-3.0, 0.0, 0.0), each_tick=block)
    assert done.poses[:, 0].max() > -0.4
    assert done.last.state is FollowerState.BLOCKED and not done.touched
    assert done.poses[-1, 0] < -1.1
    assert "backing_off" in done.states()


def test_robot_on_a_narrow_ramp_whose_edges_turn_out_to_graze_it_gets_out_the_way_it_came():
    """As on `ramp` 1 of 7a61683: from above, the cells of the edge lie a finger's breadth farther in than from below."""
    world, follower = world_with_door(0.88), follower_on((-3.0, 0.0), (2.5, 1.0))

    def see_edges(t: float) -> None:
        world.lethal[world.cells(1.0, 1.3, -1.0, 1.0)] |= t > 13.0
        for x in (-0.9, -0.4, 0.1):
            world.lethal[world.cells(x, x + 0.08, 0.3, 0.36)] |= t > 13.0

    done = drive(follower, world, (-3.0, 0.0, 0.0), each_tick=see_edges)
    assert done.poses[:, 0].max() > -0.4 and done.last.state is FollowerState.BLOCKED
    assert done.poses[-1, 0] < -1.3


def test_passage_that_is_not_free_is_not_entered():
    world = world_with_door(0.88)
    world.lethal[world.cells(0.5, 0.6, -0.3, 0.3)] = True
    done = drive(follower_on((-3.0, 0.0), (2.5, 1.0)), world, (-3.0, 0.0, 0.0))
    assert done.last.state in (FollowerState.BLOCKED, FollowerState.STUCK) and not done.touched
    assert done.poses[:, 0].max() < -0.4


def through_towards(wall_x: float, delay_s: float) -> Drive:
    """A passage that ends at 4 m, on a path that leads on straight; a wall across it at an x in metres."""
    world, x = World(16.0), np.linspace(0.0, 6.0, 76)
    world.lethal[world.cells(wall_x, wall_x + 0.16, -3.0, 3.0)] = True
    follower = PathFollower(FollowerConfig(passage_speed_mps=0.45), RobotBody())
    follower.set_path(np.column_stack([x, 0 * x, 0 * x]), None, (x >= 0.5) & (x < 3.95))
    return drive(follower, world, robot=Robot(speed_share=1.0, delay_s=delay_s, deceleration_mps2=1.5), seconds=30.0)


@pytest.mark.parametrize("delay_s", [0.0, 0.1, 0.2])
@pytest.mark.parametrize("wall_x", [4.56, 4.64])
def test_robot_brakes_for_what_lies_just_beyond_a_passage(wall_x, delay_s):
    done = through_towards(wall_x, delay_s)
    assert done.last.state is FollowerState.BLOCKED
    assert 3.9 < done.poses[:, 0].max() < wall_x - RobotBody().half_length_m


def test_robot_does_not_brake_where_a_passage_ends_and_the_way_goes_on():
    done = through_towards(7.0, 0.2)
    at_end = np.abs(done.poses[:, 0] - 4.0) < 0.5
    assert min(out.v for out, is_there in zip(done.outputs, at_end, strict=True) if is_there) > 0.44
    assert done.last.state is FollowerState.REACHED


def test_straight_stretches_stay_straight_when_the_path_is_smoothed():
    points, straight = through_the_door((-1.5, 2.0), (1.5, -2.0))
    path = ReferencePath(points, 0.2, straight)
    (stretch,) = path.stretches
    assert path.points_at(np.array([stretch.begin, stretch.end])) == pytest.approx(np.array([[-1.5, 0.0], [1.5, 0.0]]), abs=0.03)
    along = path.points_at(np.linspace(stretch.begin, stretch.end, 30))
    assert np.abs(along[:, 1]).max() < 0.02
    assert stretch.heading == pytest.approx(0.0, abs=0.01)


def test_path_without_passages_is_what_it_was():
    points, _ = through_the_door((-1.5, 2.0), (1.5, -2.0))
    assert not ReferencePath(points, 0.2).stretches
    assert np.array_equal(ReferencePath(points, 0.2).xy, ReferencePath(points, 0.2, [False] * len(points)).xy)
    with pytest.raises(ValueError, match="straight"):
        ReferencePath(points, 0.2, [True])
