"""The follower in a loop with a slipping robot: it keeps to its path, off what is lethal, and ends with a reason."""

import math
import pickle

import numpy as np
import pytest
from drive_simulation import Robot, World, cluttered_world, distance_to_path, drive, planned_path

from path_following import FollowerConfig, FollowerObservation, PathFollower
from rigid_geometry import transform_from_rpy
from robot_body import RobotBody

STEP = 0.08


def line(*corners: tuple[float, float]) -> np.ndarray:
    """(K, 3) points every 8 cm along straight pieces, as a planner on voxels gives them."""
    pieces = [np.linspace(a, b, max(2, round(math.dist(a, b) / STEP) + 1))[:-1] for a, b in zip(corners, corners[1:], strict=False)]
    xy = np.vstack([*pieces, [corners[-1]]])
    return np.column_stack([xy, np.zeros(len(xy))])


def stairs(steps: int) -> np.ndarray:
    """A path over four neighbours: two cells along x, one along y, again and again."""
    moves = np.tile([[STEP, 0.0], [STEP, 0.0], [0.0, STEP]], (steps, 1))
    xy = np.vstack([[0.0, 0.0], np.cumsum(moves, axis=0)])
    return np.column_stack([xy, np.zeros(len(xy))])


def s_curve() -> np.ndarray:
    x = np.arange(0.0, 6.0, STEP)
    return np.column_stack([x, 0.8 * np.sin(1.2 * x), np.zeros(len(x))])


def follower(path: np.ndarray, goal_yaw: float | None = None, **changes: float) -> PathFollower:
    f = PathFollower(FollowerConfig(**changes), RobotBody())
    f.set_path(path, goal_yaw)
    return f


PATHS = {
    "straight": line((0, 0), (4, 0)),
    "S": s_curve(),
    "corner": line((0, 0), (2, 0), (2, 2)),
    "U turn": line((0, 0), (2, 0), (2, 0.8), (0, 0.8)),
    "goal behind": line((0, 0), (-3, 0)),
    "grid steps": stairs(20),
    "sharp corner": line((0, 0), (2, 0), (1, 1)),
    "short": line((0, 0), (0.2, 0)),
    "over its own start": line((0, 0), (3, 0), (3, 2), (1, 2), (1, -2)),
}
ROBOTS = {"good": Robot(), "slipping": Robot(turn_share=0.75, sideways=0.05), "eager": Robot(1.0, 1.0)}


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS.keys())
@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS.keys())
def test_path_is_followed_closely_to_its_goal_and_heading(path, robot):
    run = drive(follower(path, goal_yaw=1.0), World(), robot=robot)
    assert run.last.state.value == "reached" and run.last.reason == "at the goal"
    assert distance_to_path(run.poses, path).max() < 0.15
    assert math.dist(run.poses[-1, :2], path[-1, :2]) < 0.15
    assert abs(math.remainder(run.poses[-1, 2] - 1.0, 2 * math.pi)) < 0.2


def test_commands_keep_speed_and_acceleration_limits():
    run = drive(follower(PATHS["U turn"], goal_yaw=0.0), World())
    v, w = np.array([[o.v, o.w] for o in run.outputs[:-1]]).T
    assert v.min() >= 0.0 and v.max() <= 0.5 + 1e-9 and np.abs(w).max() <= 0.9 + 1e-9
    assert np.diff(v).max() <= 0.8 * 0.05 + 1e-9
    assert np.abs(np.diff(w)).max() <= 3.0 * 0.05 + 1e-9


def test_same_observations_give_the_same_commands():
    runs = [drive(follower(PATHS["S"], goal_yaw=2.0), World()) for _ in range(2)]
    assert runs[0].outputs == runs[1].outputs


def test_noisy_poses_do_not_make_it_swerve():
    rng = np.random.default_rng(1)
    run = drive(follower(PATHS["S"]), World(), pose_error=lambda t: tuple(rng.normal(0.0, [0.015, 0.015, 0.02])))
    assert run.last.state.value == "reached"
    assert distance_to_path(run.poses, PATHS["S"]).max() < 0.2


@pytest.mark.parametrize("jump", [(0.0, 0.2, 0.0), (-0.2, 0.0, 0.05), (0.2, 0.0, -0.05)])
def test_pose_that_jumps_after_a_map_correction_is_steered_back(jump):
    path = line((0, 0), (6, 0))
    run = drive(follower(path), World(), pose_error=lambda t: jump if t > 6.0 else (0.0, 0.0, 0.0))
    assert run.last.state.value == "reached"
    told = run.poses[len(run.poses) // 2 + 60 :, 1] + jump[1]
    assert np.abs(told).max() < 0.1


@pytest.mark.parametrize("seed", range(8))
def test_planned_path_through_clutter_is_driven_without_a_touch(seed):
    rng = np.random.default_rng(seed)
    world = cluttered_world(rng)
    path = planned_path(world, rng, clearance_m=0.6)
    robot = Robot(turn_share=rng.uniform(0.75, 1.0), sideways=rng.normal(0.0, 0.03))
    start = (path[0, 0], path[0, 1], rng.uniform(-3, 3))
    run = drive(follower(path, rng.uniform(-3, 3)), world, start, robot=robot, pose_error=lambda t: tuple(rng.normal(0.0, 0.01, 3)))
    # Facing the goal's heading may lack the room beside a box; being there may not.
    assert run.last.state.value == "reached" and run.last.reason.startswith("at the goal") and not run.touched
    assert distance_to_path(run.poses, path).max() < 0.2


@pytest.mark.parametrize("goal_x", [6.0, -4.0])
def test_path_along_a_lethal_edge_keeps_its_distance(goal_x):
    rng = np.random.default_rng(2)
    world = World()
    world.lethal[world.cells(-9, 9, -1.2, -0.6)] = True
    run = drive(follower(line((0, 0), (goal_x, 0))), world, pose_error=lambda t: tuple(rng.normal(0.0, [0.01, 0.01, 0.01])))
    assert run.last.state.value == "reached" and not run.touched
    assert run.poses[:, 1].min() + 0.6 > 0.4


def test_box_on_the_path_blocks_without_a_touch_and_leaves_room_to_turn():
    world = World()
    world.lethal[world.cells(2.0, 2.4, -0.3, 0.3)] = True
    run = drive(follower(line((0, 0), (5, 0))), world)
    assert run.states()[-3:] == ["waiting", "backing_off", "blocked"] and not run.touched
    assert run.last.reason == "the way ahead is not free"
    assert run.poses[-1, 0] < 2.0 - 0.6


def test_box_that_reaches_into_the_way_is_passed_on_the_other_side():
    world = World()
    world.lethal[world.cells(2.0, 2.4, 0.24, 0.7)] = True
    run = drive(follower(line((0, 0), (5, 0))), world)
    assert run.last.state.value == "reached" and not run.touched
    assert any(o.reason == "round an obstacle" for o in run.outputs)


def test_obstacle_that_goes_away_in_time_is_only_waited_for():
    world = World()
    box = world.cells(2.4, 2.7, -1.0, 1.0)

    def someone_passes(t: float) -> None:
        world.lethal[box] = 4.0 < t < 5.5

    run = drive(follower(line((0, 0), (5, 0))), world, each_tick=someone_passes)
    assert run.states() == ["following", "waiting", "following", "reached"] and not run.touched


def test_obstacle_right_in_front_stops_it_at_once():
    world = World()

    def appears(t: float) -> None:
        world.lethal[world.cells(2.2, 2.4, -1.0, 1.0)] = t > 4.0

    run = drive(follower(line((0, 0), (5, 0))), world, each_tick=appears)
    first = next(i for i, o in enumerate(run.outputs) if o.state.value == "waiting")
    assert run.outputs[first].v == 0.0 and run.outputs[first - 1].v > 0.1
    assert run.last.state.value == "blocked" and not run.touched


def test_corridor_too_narrow_to_turn_in_is_reported():
    world = World()
    for y in ((-1.0, -0.45), (0.45, 1.0)):
        world.lethal[world.cells(-9, 9, *y)] = True
    run = drive(follower(line((0, 0), (-3, 0))), world)
    assert run.last.state.value == "blocked" and "no free turn" in run.last.reason and not run.touched


def test_room_for_a_turn_is_made_beside_a_wall():
    world = World()
    world.lethal[world.cells(-9, 9, -1.2, -0.5)] = True
    run = drive(follower(line((0, 0), (-0.5, 0.5), (-4, 0.5))), world, (0.0, 0.0, 0.0))
    assert run.last.state.value == "reached" and not run.touched


@pytest.mark.parametrize("off", [0.4, 0.44, 0.48])
def test_room_for_a_turn_is_made_though_only_a_gentle_bend_leads_away_from_the_wall(off):
    world = World()
    world.lethal[world.cells(-6, 6, -off - 0.5, -off)] = True
    run = drive(follower(line((0, 0), (2.4, 3.2))), world)
    assert run.last.state.value == "reached" and not run.touched


def test_turn_that_slides_down_a_slope_keeps_its_distance_from_a_wall():
    world = World()
    world.lethal[world.cells(-9, 9, -1.6, -0.68)] = True
    clearance_m = []
    for margin_m in (0.0, 0.08):
        turned = follower(line((0, 0), (-4, 0.3)), turn_margin_m=margin_m)
        run = drive(turned, world, (0.0, 0.0, 0.3), robot=Robot(slide_m_per_rad=0.15))
        assert run.last.state.value == "reached"
        y, yaw = run.poses[:, 1], run.poses[:, 2]
        clearance_m.append(float((y - 0.495 * np.abs(np.sin(yaw)) - 0.335 * np.abs(np.cos(yaw)) + 0.68).min()))
    assert clearance_m[0] < 0.02 and clearance_m[1] > 0.06


def test_turn_on_a_slope_keeps_room_below_for_what_the_robot_slides():
    world = World()
    world.lethal[world.cells(-9, 9, -1.6, -0.6)] = True
    touched = []
    for factor in (0.0, 1.0):
        turned = follower(line((0, 0), (-0.3, 0.5), (-4, 0.5)), turn_slide_factor=factor)
        run = drive(turned, world, (0.0, 0.0, 0.3), robot=Robot(slide_m_per_rad=0.2, slope_rad=0.2, feels_slide=False))
        assert run.last.state.value == "reached"
        touched.append(run.touched)
    assert touched == [True, False]


@pytest.mark.parametrize("factor, touched", [(0.0, True), (1.0, False)], ids=["not known", "known"])
def test_bend_on_a_slope_keeps_room_below_for_what_the_robot_slides(factor, touched):
    world = World()
    world.lethal[world.cells(-9, 9, -1.6, -0.48)] = True
    driven = follower(line((0, 0), (3, 2.6)), turn_slide_factor=factor)
    run = drive(driven, world, robot=Robot(slide_m_per_rad=0.2, slope_rad=0.2, feels_slide=False))
    assert run.last.state.value == "reached" and run.touched == touched


def test_room_for_a_turn_is_made_in_one_go():
    world = World()
    world.lethal[world.cells(-9, 9, -1.6, -0.62)] = True
    run = drive(follower(line((0, 0), (-4, 0.3))), world, (0.0, 0.0, 0.3))
    assert run.states() == ["following", "turning_to_path", "following", "reached"] and not run.touched


def test_robot_turns_where_there_is_room_for_its_outline_and_no_more():
    world = World()
    for y in ((-2.0, -0.64), (0.64, 2.0)):
        world.lethal[world.cells(-9, 9, *y)] = True
    run = drive(follower(line((0, 0), (-3, 0))), world)
    assert run.last.state.value == "reached" and not run.touched


def test_robot_that_cannot_move_is_stuck_with_a_reason():
    run = drive(follower(line((0, 0), (4, 0))), World(), robot=Robot(speed_share=0.0, turn_share=0.0, spins=True))
    assert run.states() == ["following", "backing_off", "stuck"]
    assert run.last.reason == "no progress for 6.0 s while following"


def test_robot_that_cannot_turn_backs_off_and_is_stuck():
    run = drive(follower(line((0, 0), (-4, 0))), World(), robot=Robot(turn_share=0.0))
    assert run.states() == ["turning_to_path", "backing_off", "stuck"]
    assert -0.5 < run.poses[-1, 0] < -0.3


def test_nothing_is_backed_into():
    world = World()
    world.lethal[world.cells(-0.8, -0.72, -1, 1)] = True
    run = drive(follower(line((0, 0), (-4, 0)), back_off_distance_m=1.0), world, robot=Robot(turn_share=0.0, spins=True))
    assert run.last.state.is_over and not run.touched


def test_backing_off_does_not_go_where_nothing_is_known():
    world = World()
    world.unknown[world.cells(-9, -0.6, -9, 9)] = True
    run = drive(follower(line((0, 0), (4, 0)), check_ahead_m=0.6), world, robot=Robot(turn_share=0.0, speed_share=1e-3, spins=True))
    assert run.last.state.value == "stuck"
    assert min(o.v for o in run.outputs) == 0.0


def test_goal_yaw_without_room_to_turn_is_reached_and_says_so():
    world = World()
    for y in ((-1.0, -0.45), (0.45, 1.0)):
        world.lethal[world.cells(-9, 9, *y)] = True
    run = drive(follower(line((0, 0), (2, 0)), goal_yaw=1.6), world)
    assert run.last.state.value == "reached" and "not free" in run.last.reason and not run.touched


def test_robot_that_stands_on_a_lethal_mark_may_leave_it():
    world = World()
    world.lethal[world.cells(-0.24, 0.0, 0.16, 0.4)] = True
    run = drive(follower(line((0, 0), (3, 0))), world)
    assert run.last.state.value == "reached"


def test_unknown_ground_on_the_planned_path_is_driven():
    world = World()
    world.unknown[world.cells(1.0, 1.3, -0.3, 0.3)] = True
    assert drive(follower(line((0, 0), (3, 0))), world).last.state.value == "reached"


def test_follower_that_was_kept_on_its_way_goes_on_from_there():
    path = line((0, 0), (6, 0))
    whole = follower(path)
    costmap = World().grid()
    seen = [FollowerObservation(0.05 * k, transform_from_rpy((0.02 * k, 0.0, 0.0)), costmap, (0.4, 0.0), False, "") for k in range(240)]
    for observation in seen[:200]:
        whole.step(observation)
    kept = pickle.loads(pickle.dumps(whole))
    for observation in seen[200:]:
        assert kept.step(observation) == whole.step(observation)
    assert kept._task.s == pytest.approx(0.02 * 239, abs=0.1)
