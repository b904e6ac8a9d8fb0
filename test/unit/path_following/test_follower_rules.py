"""Single steps: what the follower does with missing, late or wrong input, and when time does not count."""

import math
from dataclasses import replace

import numpy as np
import pytest
from drive_simulation import Grid, World, drive

from path_following import FollowerConfig, FollowerObservation, FollowerState, PathFollower
from rigid_geometry import transform_from_rpy
from robot_body import RobotBody

FREE = Grid(np.zeros((100, 100), dtype=np.uint8), (-4.0, -4.0))
PATH = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]])


def seen(t: float, x: float = 0.0, **changes: object) -> FollowerObservation:
    values = {"stamp_s": t, "T_map_base": transform_from_rpy([x, 0.0, 0.1]), "costmap": FREE, "twist": (0.0, 0.0)} | changes
    return FollowerObservation(**values)


def following() -> PathFollower:
    follower = PathFollower(FollowerConfig(), RobotBody())
    follower.set_path(PATH, None)
    return follower


def is_still(output) -> bool:
    return output.v == 0.0 and output.w == 0.0


def test_without_a_path_it_stands_and_says_so():
    out = PathFollower(FollowerConfig(), RobotBody()).step(seen(1.0))
    assert is_still(out) and out.state is FollowerState.IDLE and out.reason == "no path yet"


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"T_map_base": None}, "no pose"),
        ({"T_map_base": np.full((4, 4), math.nan)}, "not finite"),
        ({"costmap": None}, "no costmap"),
        ({"T_map_base": transform_from_rpy([40.0, 0.0, 0.0])}, "does not contain"),
        ({"held": True}, "held"),
    ],
)
def test_what_is_missing_stops_the_robot_but_not_the_task(changes, reason):
    follower = following()
    for k in range(20):
        moving = follower.step(seen(1.0 + 0.05 * k))
    assert moving.v > 0.2
    out = follower.step(seen(2.0, **changes))
    assert is_still(out) and reason in out.reason and out.state is FollowerState.FOLLOWING
    assert 0.0 < follower.step(seen(2.05)).v <= 0.8 * 0.05 + 1e-9


@pytest.mark.parametrize("changes", [{"held": True}, {"costmap": None}])
def test_time_in_which_it_may_not_drive_is_no_lack_of_progress(changes):
    follower = following()
    for k in range(100):
        follower.step(seen(1.0 + 0.05 * k))
    for k in range(400):
        follower.step(seen(6.0 + 0.05 * k, **changes))
    assert follower.step(seen(26.05)).state is FollowerState.FOLLOWING


@pytest.mark.parametrize("changes", [{"held": True}, {"costmap": None}])
def test_time_in_which_it_may_not_drive_is_no_waiting(changes):
    walled = np.zeros((100, 100), dtype=np.uint8)
    walled[:, 58:62] = 254  # 0.64 m ahead, from side to side
    blocked, follower = Grid(walled, (-4.0, -4.0)), following()
    assert [follower.step(seen(1.0 + t, costmap=blocked)).state.value for t in (0.0, 0.4)] == ["waiting", "waiting"]
    for k in range(100):
        follower.step(seen(1.45 + 0.05 * k, **{"costmap": blocked, **changes}))
    assert follower.step(seen(6.45, costmap=blocked)).state is FollowerState.WAITING
    assert [follower.step(seen(6.45 + t, costmap=blocked)).state.value for t in (0.5, 1.0, 1.5, 1.6)][-1] == "backing_off"


@pytest.mark.parametrize("later", [500.0, -3.0])
def test_time_that_jumps_is_no_lack_of_progress(later):
    follower = following()
    follower.step(seen(5.0))
    follower.step(seen(5.05))
    out = follower.step(seen(5.05 + later))
    assert out.state is FollowerState.FOLLOWING and out.v >= 0.0
    assert follower.step(seen(5.10 + later)).v > 0.0


def test_clear_stands_with_its_reason_until_the_next_path():
    follower = following()
    for k in range(10):
        follower.step(seen(1.0 + 0.05 * k))
    follower.clear("the map is being corrected")
    out = follower.step(seen(2.0))
    assert is_still(out) and out.state is FollowerState.IDLE and out.reason == "the map is being corrected"
    follower.set_path(PATH, None)
    assert follower.step(seen(2.05)).state is FollowerState.FOLLOWING


def test_robot_far_from_its_path_gives_up_with_the_distance():
    out = following().step(seen(1.0, T_map_base=transform_from_rpy([0.5, 1.5, 0.0])))
    assert out.state is FollowerState.STUCK and "1.50 m from the path" in out.reason


def test_path_of_one_point_where_the_robot_stands_is_reached():
    follower = PathFollower(FollowerConfig(), RobotBody())
    follower.set_path(np.zeros((1, 3)), None)
    assert follower.step(seen(1.0)).state is FollowerState.REACHED


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.zeros(3), np.array([[0.0, math.nan, 0.0]]), np.zeros((2, 4))])
def test_wrong_path_is_refused_and_the_old_one_kept(points):
    follower = following()
    with pytest.raises(ValueError, match="a path is"):
        follower.set_path(points, None)
    assert follower.step(seen(1.0)).state is FollowerState.FOLLOWING


def test_wrong_heading_and_stamp_are_refused():
    with pytest.raises(ValueError, match="goal_yaw"):
        following().set_path(PATH, math.nan)
    with pytest.raises(ValueError, match="stamp_s"):
        following().step(seen(math.nan))


def test_wrong_configuration_lists_every_violation():
    with pytest.raises(ValueError, match=r"goal_tolerance_m.*min_speed_mps"):
        PathFollower(FollowerConfig(goal_tolerance_m=-1.0, min_speed_mps=0.4, max_speed_mps=0.3), RobotBody())


def test_follower_is_no_faster_than_the_robot():
    slow = replace(RobotBody(), max_speed_mps=0.3, max_turn_rate_radps=0.4)
    fastest = []
    for robot in (RobotBody(), slow):
        follower = PathFollower(FollowerConfig(), robot)
        follower.set_path(np.array([[0.0, 0.0, 0.0], [-4.0, 0.0, 0.0]]), None)  # behind it
        outputs = drive(follower, World()).outputs
        fastest.append((max(o.v for o in outputs), max(abs(o.w) for o in outputs)))
    assert fastest[0] == pytest.approx((0.5, 0.9), abs=0.05)
    assert fastest[1][0] <= 0.3 and fastest[1][1] <= 0.4


def test_robot_that_cannot_turn_as_slowly_as_the_follower_wants_is_refused():
    with pytest.raises(ValueError, match="min_turn_rate_radps = 0.25 is above max_turn_rate_radps = 0.2"):
        PathFollower(FollowerConfig(), replace(RobotBody(), max_turn_rate_radps=0.2))


def test_wider_robot_does_not_fit_where_ours_does():
    world = World()
    for side in (-1, 1):
        world.lethal[world.cells(1.5, 9, *sorted((side * 0.48, side * 0.7)))] = True
    ends = []
    for width_m in (RobotBody().width_m, 1.2):
        follower = PathFollower(FollowerConfig(), replace(RobotBody(), width_m=width_m))
        follower.set_path(np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]]), None)
        ends.append(drive(follower, world).last.state.value)
    assert ends[0] == "reached" and ends[1] != "reached"
