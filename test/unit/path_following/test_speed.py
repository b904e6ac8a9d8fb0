"""How fast the follower drives: slower near obstacles, in tight bends, off its heading and towards its goal."""

import numpy as np
import pytest
from drive_simulation import World, drive

from path_following import FollowerConfig, PathFollower
from path_following.pursuit import Steering, regulated_speed
from robot_body import RobotBody

CONFIG = FollowerConfig()
AHEAD = Steering(0.0, 0.0)


@pytest.mark.parametrize(("cost", "share"), [(0, 1.0), (126, 0.7), (252, 0.4), (253, 0.4), (254, 0.4)])
def test_the_nearer_an_obstacle_the_slower(cost: int, share: float) -> None:
    assert regulated_speed(CONFIG, AHEAD, cost, 10.0) == pytest.approx(share * CONFIG.max_speed_mps)


def test_unknown_cost_says_nothing_of_an_obstacle() -> None:
    assert regulated_speed(CONFIG, AHEAD, 255, 10.0) == CONFIG.max_speed_mps


def test_tight_bend_wrong_heading_and_near_goal_slow_down() -> None:
    speeds = [regulated_speed(CONFIG, *how) for how in ((Steering(0.0, 2.0), 0, 10.0), (Steering(1.0, 0.0), 0, 10.0), (AHEAD, 0, 0.2))]
    assert speeds == pytest.approx([0.5 / 1.8, 0.5 * np.cos(1.0), 0.8 * 0.2 + 0.05])
    assert regulated_speed(CONFIG, AHEAD, 0, 0.0) == CONFIG.min_speed_mps


@pytest.mark.parametrize("left", [-0.15, 0.2, -0.3, 0.4])
def test_turn_is_braked_so_late_that_the_robot_stands_where_it_ends(left: float) -> None:
    rate = CONFIG.turn_rate_within(left)
    assert rate * CONFIG.reaction_s + rate**2 / (2.0 * CONFIG.max_turn_acceleration_radps2) == pytest.approx(abs(left), rel=0.1)


def test_turn_is_never_slower_than_what_moves_the_robot_nor_faster_than_its_drive() -> None:
    assert (CONFIG.turn_rate_within(0.01), CONFIG.turn_rate_within(3.0)) == (CONFIG.min_turn_rate_radps, CONFIG.max_turn_rate_radps)


def test_robot_drives_slower_between_walls_than_in_the_open() -> None:
    fastest = []
    for walls in (False, True):
        world = World()
        for y in ((-1.2, -0.56), (0.56, 1.2)):
            world.lethal[world.cells(-9, 9, *y)] = walls
        follower = PathFollower(CONFIG, RobotBody())
        follower.set_path(np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0]]), None)
        run = drive(follower, world)
        assert run.last.state.value == "reached" and not run.touched
        fastest.append(max(o.v for o in run.outputs))
    assert fastest[0] == pytest.approx(0.5) and fastest[1] < 0.42
