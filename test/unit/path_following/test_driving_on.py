"""A robot that maps while it drives: no faster than the known ground allows, onto new paths without a stop, braking for what appears."""

import math

import numpy as np
import pytest
from drive_simulation import RESOLUTION, Drive, Robot, World, drive

from local_terrain_costmap import CostmapConfig, CostmapView, LocalCostmap
from path_following import FollowerConfig, FollowerObservation, FollowerState, PathFollower
from path_following.surroundings import Surroundings, Unknown, arc_poses, footprint_lattice
from robot_body import RobotBody

HALF_LENGTH_M = RobotBody().half_length_m
LATE = Robot(speed_share=1.0, delay_s=0.35, deceleration_mps2=1.5)


def line(*corners: tuple[float, float]) -> np.ndarray:
    """(K, 3) points every 8 cm along straight pieces."""
    pieces = [np.linspace(a, b, max(2, round(math.dist(a, b) / RESOLUTION) + 1))[:-1] for a, b in zip(corners, corners[1:], strict=False)]
    xy = np.vstack([*pieces, [corners[-1]]])
    return np.column_stack([xy, np.zeros(len(xy))])


def on_path(path: np.ndarray, goal_yaw: float | None = None, **changes: float) -> PathFollower:
    follower = PathFollower(FollowerConfig(**{"known_ahead_m": 0.5, **changes}), RobotBody())
    follower.set_path(path, goal_yaw)
    return follower


def unknown_from(x: float) -> World:
    world = World()
    world.unknown[world.cells(x, 10.0, -10.0, 10.0)] = True
    return world


def known_ahead_while_driving(run: Drive, border: float) -> list[tuple[float, float]]:
    return [(out.v, border - x) for out, (x, *_) in zip(run.outputs, run.poses, strict=True)]


def speeds_under_way(run: Drive, end: tuple[float, float]) -> list[float]:
    """From a second on, as long as the end is farther than a metre."""
    return [out.v for out, pose in list(zip(run.outputs, run.poses, strict=True))[20:] if math.dist(pose[:2], end) > 1.0]


# --- no faster than the known ground ahead allows ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("max_speed", [0.5, 1.0])
def test_robot_stops_before_unknown_ground_though_it_reacts_late_and_says_what_is_missing(max_speed: float) -> None:
    run = drive(on_path(line((0, 0), (8, 0)), max_speed_mps=max_speed), unknown_from(4.0), robot=LATE, seconds=12.0)
    assert max(o.v for o in run.outputs) == pytest.approx(max_speed)
    assert 4.0 - HALF_LENGTH_M - 0.1 < run.poses[:, 0].max() < 4.0 - HALF_LENGTH_M
    awaiting = [o for o in run.outputs if o.state is FollowerState.AWAITING_GROUND]
    assert awaiting[-1].v == 0.0 and "m of known ground ahead" in awaiting[0].reason


@pytest.mark.parametrize("max_speed, least_m", [(0.5, 0.78), (1.0, 1.23)])
def test_full_speed_is_driven_only_where_the_ground_is_known_far_enough(max_speed: float, least_m: float) -> None:
    run = drive(on_path(line((0, 0), (8, 0)), max_speed_mps=max_speed), unknown_from(5.04), seconds=15.0)
    at_full_speed = [known for v, known in known_ahead_while_driving(run, 5.04) if v > 0.99 * max_speed]
    assert len(at_full_speed) > 20 and min(at_full_speed) >= least_m


def test_ground_that_becomes_known_in_time_is_driven_on_without_a_stop() -> None:
    world = unknown_from(3.0)

    def seen(t: float) -> None:
        world.unknown[world.cells(-10.0, 3.0 + max(0.0, 0.6 * (t - 3.0)), -10.0, 10.0)] = False

    run = drive(on_path(line((0, 0), (7, 0))), world, each_tick=seen)
    assert run.last.state is FollowerState.REACHED
    assert min(speeds_under_way(run, (7, 0))) > 0.2


def test_robot_that_stands_before_unknown_ground_goes_on_when_a_sweep_shows_it() -> None:
    world = unknown_from(3.0)

    def seen(t: float) -> None:
        world.unknown[:] &= t < 10.0

    run = drive(on_path(line((0, 0), (5, 0))), world, each_tick=seen)
    assert run.states() == ["following", "awaiting_ground", "following", "reached"]


def test_robot_that_nobody_shows_the_ground_to_is_blocked_in_the_end() -> None:
    run = drive(on_path(line((0, 0), (5, 0))), unknown_from(3.0))
    assert run.states() == ["following", "awaiting_ground", "blocked"] and "m of known ground ahead" in run.last.reason


@pytest.mark.parametrize("known_ahead_m", [0.5, 2.0])
def test_plan_that_ends_before_unknown_ground_is_driven_as_if_nothing_were_asked(known_ahead_m: float) -> None:
    for end in (line((0, 0), (3.5, 0)), line((0, 0), (2, 0), (3.4, 1.4)), line((0, 0), (-2, 0))):
        runs = [drive(on_path(end, 0.3, known_ahead_m=asked), unknown_from(3.8)) for asked in (known_ahead_m, 0.0)]
        assert runs[0].last.state is FollowerState.REACHED and runs[0].outputs == runs[1].outputs


@pytest.mark.parametrize("width_m, stands", [(0.08, False), (0.32, True)])
@pytest.mark.parametrize("beside_m", [0.0, 0.28, -0.28])
def test_gap_that_a_wheel_rolls_over_is_ground_and_a_longer_one_under_the_middle_or_a_wheel_is_none(
    width_m: float, stands: bool, beside_m: float
) -> None:
    world = World()
    world.unknown[world.cells(2.0, 2.0 + width_m, beside_m - 0.08, beside_m + 0.08)] = True
    run = drive(on_path(line((0, 0), (4, 0))), world)
    assert ("awaiting_ground" in run.states()) is stands


def test_ground_beside_the_wheels_need_not_be_known() -> None:
    world = World()
    for y0, y1 in ((-3.0, -0.48), (0.48, 3.0)):
        world.unknown[world.cells(1.0, 6.0, y0, y1)] = True
    assert drive(on_path(line((0, 0), (4, 0))), world).states() == ["following", "reached"]


class Trench(World):
    """Unseen ground under the left wheels from x = 2 to 4 m, also right beside a wall, as the costmap inflates it."""

    def __init__(self, wall_y: float | None) -> None:
        super().__init__(16.0)
        self.unknown[self.cells(2.0, 4.0, 0.24, 0.56)] = True
        if wall_y is not None:
            self.lethal[self.cells(1.5, 4.5, wall_y, wall_y + 0.08)] = True
            self.unknown[self.cells(1.5, 4.5, wall_y + 0.08, 8.0)] = True

    def grid(self) -> CostmapView:
        costmap = LocalCostmap(CostmapConfig(size_m=self.size), RobotBody())
        costmap.set_terrain(np.where(self.lethal, 100, np.where(self.unknown, -1, 0)), (-8.0, -8.0), RESOLUTION)
        return costmap.master()


@pytest.mark.parametrize("wall_y", [None, 0.56])
def test_unseen_ground_under_a_wheel_is_not_driven_on_beside_a_wall_either(wall_y: float | None) -> None:
    run = drive(on_path(line((-2, 0), (6, 0))), Trench(wall_y), (-2.0, 0.0, 0.0))
    assert run.last.state is FollowerState.BLOCKED and "m of known ground ahead" in run.last.reason
    assert run.poses[:, 0].max() < 2.0 - 0.256  # where its front wheels touch the ground


def test_way_along_a_wall_is_driven_though_nothing_is_known_behind_its_front() -> None:
    world = Trench(0.48)
    world.unknown[world.cells(1.5, 4.5, 0.0, 0.56)] = False
    run = drive(on_path(line((-2, 0), (6, 0))), world, (-2.0, 0.0, 0.0))
    assert run.states() == ["following", "reached"] and not run.touched


def test_robot_backs_over_no_unseen_ground_beside_a_wall() -> None:
    lattice = footprint_lattice(0.99, 0.67, 0.05)
    for wall_y in (None, 0.56):
        around = Surroundings(Trench(wall_y).grid(), lattice, lattice)
        assert not around.is_free(arc_poses((5.0, 0.0, 0.0), -1.0, 0.0, 1.5), Unknown.NOT_UNDER_THE_FOOTPRINT)


def test_unknown_ground_in_a_passage_slows_the_robot_too() -> None:
    world = unknown_from(3.0)
    follower = PathFollower(FollowerConfig(known_ahead_m=0.5, passage_look_m=0.3), RobotBody())
    path = line((0, 0), (5, 0))
    follower.set_path(path, None, [True] * len(path))
    run = drive(follower, world, seconds=20.0)
    assert run.last.state is FollowerState.BLOCKED and run.poses[:, 0].max() < 3.0 - HALF_LENGTH_M


def test_time_in_which_a_sweep_holds_the_robot_is_no_waiting_for_ground() -> None:
    grid, follower, states = unknown_from(0.5).grid(), on_path(line((0, 0), (5, 0)), ground_patience_s=1.0), []
    for k in range(300):
        held = 10 <= k < 280
        out = follower.step(FollowerObservation(1.0 + 0.05 * k, np.eye(4), grid, (0.0, 0.0), held))
        states.append(out.state.value)
    assert 288 <= states.count("awaiting_ground") <= 292 and states[-1] == "blocked"


def test_way_to_a_stop_is_as_long_as_the_speed_that_it_allows() -> None:
    config = FollowerConfig()
    for speed in (0.1, 0.5, 1.0):
        assert config.speed_within(config.stopping_m(speed), speed) == pytest.approx(speed)
    assert config.speed_within(-1.0, 0.0) == 0.0 and config.speed_within(0.2, 0.5) == 0.0 and math.isinf(config.speed_within(math.inf, 0.5))


# --- new paths without a stop -----------------------------------------------------------------------------------------------------------


def replaced(new: np.ndarray, at_s: float, goal_yaw: float | None = None, **robot: float) -> Drive:
    """A drive along x whose path is replaced at a time."""
    follower = on_path(line((0, 0), (6, 0)))
    done = []

    def plan(t: float) -> None:
        if t >= at_s and not done:
            done.append(follower.set_path(new, goal_yaw))

    return drive(follower, World(), robot=Robot(**{"speed_share": 1.0, "turn_share": 1.0, **robot}), each_tick=plan)


@pytest.mark.parametrize("behind_m", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("aside_m", [0.0, 0.1])
def test_new_path_that_begins_where_the_robot_was_is_gone_over_to_at_full_speed(behind_m: float, aside_m: float) -> None:
    x = 2.0  # where it is by then, nearly
    run = replaced(line((x - behind_m, aside_m), (6, aside_m)), 1.0 + x / 0.5 + 0.35)
    assert run.states() == ["following", "reached"]
    assert min(speeds_under_way(run, (6, aside_m))) > 0.45
    assert np.abs(np.diff([o.w for o in run.outputs])).max() <= 3.0 * 0.05 + 1e-9


def test_new_path_that_bends_less_than_the_usual_limit_is_taken_in_a_bend() -> None:
    run = replaced(line((1.84, 0.0), (4.84, 1.7)), 5.0)
    assert run.states() == ["following", "reached"] and min(o.v for o in run.outputs[20:60]) > 0.1


def test_new_path_the_other_way_is_turned_to_on_the_spot() -> None:
    run = replaced(line((2.0, 0.0), (-2.0, 0.0)), 5.0)
    assert run.states() == ["following", "turning_to_path", "following", "reached"]


def test_new_path_far_from_the_robot_is_not_driven() -> None:
    run = replaced(line((2.0, 3.0), (6.0, 3.0)), 5.0)
    assert run.last.state is FollowerState.STUCK and "from the path" in run.last.reason


@pytest.mark.parametrize("behind_m", [1.5, 3.0])
def test_new_path_that_was_decided_late_is_gone_over_to_where_the_robot_is_beside_it(behind_m: float) -> None:
    run = replaced(line((3.2 - behind_m, 0.0), (6, 0)), 7.0)
    assert run.states() == ["following", "reached"]
    assert min(speeds_under_way(run, (6, 0))) > 0.45


@pytest.mark.parametrize("behind_m", [1.6, 2.5])
def test_new_path_that_was_decided_late_and_leads_elsewhere_is_driven_from_where_the_robot_came(behind_m: float) -> None:
    run = replaced(line((3.2 - behind_m, 0.0), (3.2 - behind_m, 4.0)), 7.0)
    assert run.states()[-1] == "reached" and "stuck" not in run.states()
    assert math.dist(run.poses[-1][:2], (3.2 - behind_m, 4.0)) < 0.2


def test_standing_robot_begins_a_new_path_as_it_always_did() -> None:
    first = drive(on_path(line((0, 0), (2, 0))), World()).outputs
    follower = on_path(line((0, 0), (0, 9)))
    follower.set_path(line((0, 0), (2, 0)), None)
    assert drive(follower, World()).outputs == first


def test_robot_that_gets_nowhere_is_stuck_however_often_its_path_is_replaced() -> None:
    follower = on_path(line((0, 0), (4, 0)))

    def plan(t: float) -> None:
        if round(t / 0.05) % 50 == 0:
            follower.set_path(line((0, 0), (4, 0)), None)

    run = drive(follower, World(), robot=Robot(speed_share=0.0, turn_share=0.0, spins=True), each_tick=plan, seconds=20.0)
    assert run.states() == ["following", "backing_off", "stuck"] and "no progress" in run.last.reason


def replanned(world: World, every_s: float, goal: tuple[float, float] = (8.0, 0.0), seconds: float = 60.0) -> Drive:
    """A drive to a goal, straight from where the robot is at each plan."""
    follower = on_path(line((0, 0), goal))

    def plan(t: float) -> None:
        if round(t / 0.05) % round(every_s / 0.05) == 0 and follower._pose:
            follower.set_path(line(follower._pose[:2], goal), None)

    return drive(follower, world, each_tick=plan, seconds=seconds)


@pytest.mark.parametrize("every_s", [0.5, 1.0, 2.0, 60.0])
def test_robot_that_waits_before_a_wall_is_blocked_however_often_its_path_is_replaced(every_s: float) -> None:
    world = World()
    world.lethal[world.cells(3.0, 3.3, -4.0, 4.0)] = True
    run = replanned(world, every_s)
    assert run.last.state is FollowerState.BLOCKED and "backing_off" in run.states() and not run.touched


@pytest.mark.parametrize("every_s", [0.5, 2.0, 60.0])
def test_robot_that_awaits_ground_is_blocked_however_often_its_path_is_replaced(every_s: float) -> None:
    run = replanned(unknown_from(3.0), every_s)
    assert run.last.state is FollowerState.BLOCKED and "m of known ground ahead" in run.last.reason
    assert run.poses[:, 0].max() < 3.0 - HALF_LENGTH_M


def awaiting_ground_then(path: np.ndarray) -> Drive:
    """A drive on along a new path that comes a second after the robot began to stand before unknown ground."""
    follower, stood = on_path(line((0, 0), (5, 0))), []

    def plan(t: float) -> None:
        stood.append(follower.latest.state is FollowerState.AWAITING_GROUND and follower.latest.v == 0.0)
        if stood[-1] and sum(stood) == 20:
            follower.set_path(path, None)

    return drive(follower, unknown_from(3.0), each_tick=plan)


def test_new_path_over_known_ground_ends_the_wait_for_ground_at_once() -> None:
    for corners in (((2.0, 0.0), (2.3, 0.0)), ((2.2, 0.0), (2.2, 2.0)), ((2.0, 0.0), (-1.0, 0.0))):
        run = awaiting_ground_then(line(*corners))
        assert run.last.state is FollowerState.REACHED and "blocked" not in run.states()


def test_robot_that_stood_in_vain_waits_anew_once_it_has_driven_on() -> None:
    world = World()
    world.lethal[world.cells(3.0, 3.3, -4.0, 4.0)] = True

    def goes(t: float) -> None:
        world.lethal[world.cells(3.0, 3.3, -4.0, 4.0)] = t < 7.0
        world.lethal[world.cells(5.0, 5.3, -4.0, 4.0)] = True

    run = drive(on_path(line((0, 0), (8, 0))), world, each_tick=goes)
    waits = [o.state is FollowerState.WAITING for o in run.outputs]
    assert run.states().count("waiting") == 2 and sum(waits) * 0.05 > 2.0 and run.poses[:, 0].max() > 3.8


def test_paths_that_are_replaced_all_the_time_are_driven_as_one() -> None:
    follower, seen = on_path(line((0, 0), (6, 0))), []

    def plan(t: float) -> None:
        seen.append(follower._pose[0] if follower._pose else 0.0)
        if len(seen) % 55 == 0:
            follower.set_path(line((seen[-20], 0), (6, 0)), None)  # planned from where it was a second ago

    run = drive(follower, World(), each_tick=plan)
    assert run.states() == ["following", "reached"] and len(seen) < 14.5 / 0.05


# --- what appears while it drives -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("max_speed", [0.5, 1.0])
def test_obstacle_that_appears_as_far_ahead_as_the_robot_stops_is_not_touched(max_speed: float) -> None:
    world, follower = World(), on_path(line((0, 0), (9, 0)), max_speed_mps=max_speed)
    reach = HALF_LENGTH_M + follower.latest.v + FollowerConfig().stopping_m(max_speed) + 0.1
    wall_x = 4.0 + reach

    def appears(t: float) -> None:
        if follower._pose and follower._pose[0] > 4.0:
            world.lethal[world.cells(wall_x, wall_x + 0.3, -3.0, 3.0)] = True

    run = drive(follower, world, robot=LATE, each_tick=appears)
    assert run.last.state is FollowerState.BLOCKED and run.last.reason.startswith("the way ahead is not free") and not run.touched


@pytest.mark.parametrize("max_speed", [0.5, 1.0])
def test_robot_does_not_touch_a_wall_that_was_always_there(max_speed: float) -> None:
    world = World()
    world.lethal[world.cells(5.0, 5.3, -4.0, 4.0)] = True
    run = drive(on_path(line((0, 0), (9, 0)), max_speed_mps=max_speed), world, robot=LATE)
    assert run.last.state is FollowerState.BLOCKED and not run.touched


def test_terrain_that_becomes_lethal_under_the_nose_stops_the_robot_within_its_deceleration() -> None:
    world, robot = World(), Robot(speed_share=1.0, deceleration_mps2=1.5)

    def appears(t: float) -> None:
        world.lethal[world.cells(2.4, 6.0, -3.0, 3.0)] = t > 5.0

    run = drive(on_path(line((0, 0), (5, 0))), world, robot=robot, each_tick=appears)
    first = next(i for i, o in enumerate(run.outputs) if o.state is FollowerState.WAITING)
    began, ended = run.poses[first, 0], run.poses[first:, 0].max()
    assert began + HALF_LENGTH_M > 2.4 - 0.1, "it was not under the nose"
    assert ended - began <= 0.5**2 / (2 * 1.5) + 0.5 * 0.05
    assert run.states()[-1] == "blocked" and "the way ahead is not free" in run.last.reason
