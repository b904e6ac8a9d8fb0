"""Ways of straight legs through narrow ground: the robot turns on the spot at their corners, with the end ahead that is nearer."""

import math

import numpy as np
import pytest
from drive_simulation import Robot, World, drive

from path_following import FollowerConfig, FollowerState, PathFollower
from path_following.reference_path import ReferencePath
from robot_body import RobotBody

Corners = list[tuple[float, float]]


def corridor_with_door(corridor_m: float, door_m: float) -> World:
    """A corridor along x, and at x = 0 a door in its wall to a room."""
    world = World(12.0)
    world.lethal[:] = True
    for box in (
        (-4.0, 4.0, -corridor_m / 2, corridor_m / 2),
        (-door_m / 2, door_m / 2, 0.0, 4.0),
        (-2.0, 2.0, corridor_m / 2 + 0.16, 4.0),
    ):
        world.lethal[world.cells(*box)] = False
    return world


def on_legs(corners: Corners, then: Corners = ()) -> tuple[np.ndarray, list[bool]]:
    """Points (K, 3) on straight legs over corners, and on from the last, and where they are straight."""
    points, straight = [], []
    line = [*corners, *then]
    for i, (a, b) in enumerate(zip(line[:-1], line[1:], strict=True)):
        count = math.ceil(math.dist(a, b) / 0.15)
        points += np.linspace(a, b, count, endpoint=False).tolist()
        straight += [i < len(corners) - 1] * count
    xy = np.array([*points, line[-1]])
    return np.column_stack([xy, np.zeros(len(xy))]), [*straight, False]


def follower_on(corners: Corners, then: Corners = ()) -> PathFollower:
    follower = PathFollower(FollowerConfig(), RobotBody())
    points, straight = on_legs(corners, then)
    follower.set_path(points, None, straight)
    return follower


ROBOTS = [Robot(), Robot(delay_s=0.15), Robot(sideways=0.04), Robot(turn_share=0.7)]
INTO_THE_ROOM: Corners = [(-2.0, 0.0), (0.0, 0.0), (0.0, 1.5)]


@pytest.mark.parametrize("robot", ROBOTS, ids=["good", "late", "pulls aside", "turns too little"])
@pytest.mark.parametrize("heading", [0.0, math.pi], ids=["nose first", "rear first"])
@pytest.mark.parametrize("corridor_m, door_m", [(1.44, 0.96), (1.28, 0.8)])
def test_door_beside_a_corridor_is_entered_over_a_corner(corridor_m, door_m, heading, robot):
    follower = follower_on(INTO_THE_ROOM, [(0.0, 2.5)])
    done = drive(follower, corridor_with_door(corridor_m, door_m), (-2.0, 0.02, heading), robot=robot)
    assert done.last.state is FollowerState.REACHED and not done.touched
    assert math.dist(done.poses[-1, :2], (0.0, 2.5)) < 0.3


def test_robot_that_comes_rear_first_goes_on_rear_first_where_that_is_the_smaller_turn():
    """Round a corner of 0.5 rad, in a gap in which it cannot turn round."""
    corners = [(-2.0, 0.0), (0.0, 0.0), (1.5 * math.cos(0.5), 1.5 * math.sin(0.5))]
    world = World(12.0)
    x, y = np.meshgrid(*2 * [(np.arange(len(world.lethal)) + 0.5) * 0.08 - 6.0])
    world.lethal[:] = True
    for dx, dy in ((-1.0, 0.0), (math.cos(0.5), math.sin(0.5))):
        along = np.clip(x * dx + y * dy, 0.0, 4.0)
        world.lethal[np.hypot(x - along * dx, y - along * dy) <= 0.58] = False
    done = drive(follower_on(corners), world, (-2.0, 0.0, math.pi))
    assert done.last.state is FollowerState.REACHED and not done.touched
    assert abs(math.remainder(done.poses[-1, 2] - math.pi - 0.5, 2 * math.pi)) < 0.2


def test_legs_are_stretches_that_meet_at_corners():
    points, straight = on_legs(INTO_THE_ROOM, [(0.0, 2.5)])
    first, second = ReferencePath(points, 0.2, straight).stretches
    assert (first.leads_to_corner, first.from_corner) == (True, False) and (second.leads_to_corner, second.from_corner) == (False, True)
    assert first.heading == pytest.approx(0.0) and second.heading == pytest.approx(math.pi / 2)
    assert first.end == second.begin and first.over < first.end and second.over == second.end
    assert second.begin_xy == pytest.approx((0.0, 0.0))


def test_way_is_driven_to_its_end_where_a_wall_stands_behind_that():
    """The robot turns there: the door leads into a corridor, and on along it."""
    corners = [(0.0, 2.5), (0.0, 0.0)]
    for then in ([(2.0, 0.0)], [(-2.0, 0.0)]):
        done = drive(follower_on(corners, then), corridor_with_door(1.36, 0.96), (0.0, 2.5, -math.pi / 2), robot=Robot(delay_s=0.15))
        assert done.last.state is FollowerState.REACHED and not done.touched
