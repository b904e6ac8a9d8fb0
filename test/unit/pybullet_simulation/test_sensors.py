"""Sensors and drive by themselves: closed forms as oracles."""

import dataclasses
import math
from dataclasses import replace

import numpy as np
import pytest
from solid_worlds import world_of

from pybullet_simulation import IDEAL, ScanGeometry, SimulationConfig
from pybullet_simulation.drive import Drive, SlipModel
from pybullet_simulation.imu import Imu
from pybullet_simulation.laser import Laser, Motion
from pybullet_simulation.robot_model import read_robot_model
from pybullet_simulation.solids import box
from pybullet_simulation.sweep_profile import sweep_profile
from pybullet_simulation.world import nearest_hits, raycasting_scene
from rigid_geometry import rotation_from_rpy, transform_from_rpy
from robot_body import RobotBody
from stage_config import ConfigError, load_config

EXACT = replace(IDEAL, range_sigma_m=0.0, range_sigma_far_m=0.0, veiling_probability=0.0)
HUSKY = RobotBody()
ROBOT = read_robot_model(HUSKY)


def standing(tilt, steps=10):
    """A robot on the origin that does not move, over one tick."""
    positions = np.tile((0.0, 0.0, HUSKY.base_height_m), (steps + 1, 1))
    return Motion(np.tile(np.eye(3), (steps + 1, 1, 1)), positions, np.full(steps + 1, tilt), 0.05 / steps)


def scan(world, motion, config=EXACT):
    return Laser(config, ROBOT, world, np.random.default_rng(1)).scans(motion, np.array([0.0]))[0]


WALL = box("wall", (5.0, -50.0, -1.0), (5.2, 50.0, 4.0))
ANGLES = ScanGeometry().angles


def test_robot_model_has_the_mounting_that_the_stages_agreed_on():
    assert ROBOT.T_base_mount[:3, 3] == pytest.approx((0.20, 0.0, 0.75)) and ROBOT.T_tilt_laser[:3, 3] == pytest.approx((0.03, 0.0, 0.04))
    size = ROBOT.body.vertices.max(axis=0) - ROBOT.body.vertices.min(axis=0)
    assert size[:2] == pytest.approx((HUSKY.length_m, HUSKY.width_m), abs=1e-3)


def test_level_scan_measures_the_distance_to_a_wall():
    ranges = scan(world_of(WALL), standing(0.0))
    ahead = np.abs(ANGLES) < 1.3
    assert ranges[ahead] == pytest.approx((5.0 - 0.23) / np.cos(ANGLES[ahead]), rel=1e-5)
    assert ranges.dtype == np.float32 and np.isposinf(ranges[0])


def test_scan_sees_a_wall_from_inside_as_well():
    around = box("hollow", (-4.0, -4.0, -1.0), (4.0, 4.0, 3.0))
    ranges = scan(world_of(around), standing(0.0))
    assert np.isfinite(ranges).all() and ranges[540] == pytest.approx(4.0 - 0.23, rel=1e-5)


def test_nose_down_scan_meets_the_ground_where_trigonometry_says():
    tilt, floor = 0.4, box("floor", (-40.0, -40.0, -1.0), (40.0, 40.0, 0.0))
    height = 0.132 + 0.75 + math.cos(tilt) * 0.04 - math.sin(tilt) * 0.03
    assert scan(world_of(floor), standing(tilt))[540] == pytest.approx(height / math.sin(tilt), abs=2e-4)


def test_tilted_laser_sees_its_own_deck_and_level_it_does_not():
    far = world_of(box("far", (90.0, 0.0, 0.0), (91.0, 1.0, 1.0)))
    assert np.isposinf(scan(far, standing(0.0))).all()
    down = scan(far, standing(2.3))
    assert (np.isfinite(down) & (down < 1.0)).sum() > 50


def test_mount_whose_tilt_is_off_scans_as_a_good_one_that_is_tilted_more():
    room = world_of(box("room", (-4.0, -4.0, -1.0), (4.0, 4.0, 3.0)))
    off = dataclasses.replace(EXACT, mount_tilt_scale=1.005)
    for tilt in (-0.5, 0.4, 2.0):
        assert scan(room, standing(tilt), off) == pytest.approx(scan(room, standing(1.005 * tilt)), rel=1e-6)


@pytest.mark.parametrize("roll", [0.05, -0.05])
def test_mount_that_leans_meets_the_ground_beside_the_robot_where_trigonometry_says(roll):
    ranges = scan(
        world_of(box("floor", (-40.0, -40.0, -1.0), (40.0, 40.0, 0.0))), standing(0.0), dataclasses.replace(EXACT, mount_roll_rad=roll)
    )
    down, up = (180, 900) if roll > 0.0 else (900, 180)  # the beams at 90 degrees to the right and to the left
    assert ranges[down] == pytest.approx((0.132 + 0.75 + 0.04 * math.cos(roll)) / math.sin(abs(roll)), abs=2e-3)
    assert np.isposinf(ranges[up])


def test_mount_that_is_off_in_both_casts_the_rays_that_its_transforms_give():
    """The robot's body does not lean with the mount: seen from base_link, it is met by the rays of the true one."""
    roll, scale, tilt = 0.1, 1.05, 2.2
    T_mount_laser = transform_from_rpy((0, 0, 0), (roll, 0, 0)) @ transform_from_rpy((0, 0, 0), (0, scale * tilt, 0)) @ ROBOT.T_tilt_laser
    T_base_laser = ROBOT.T_base_mount @ T_mount_laser
    directions = np.column_stack([np.cos(ANGLES), np.sin(ANGLES), np.zeros_like(ANGLES)]) @ T_base_laser[:3, :3].T
    rays = np.hstack([np.tile(T_base_laser[:3, 3], (len(ANGLES), 1)), directions])
    body = nearest_hits(raycasting_scene(ROBOT.body.vertices, ROBOT.body.triangles), rays.astype(np.float32))
    behind = np.where(directions[:, 0] < 0.0, (-5.0 - T_base_laser[0, 3]) / directions[:, 0], np.inf)
    ranges = scan(
        world_of(box("wall", (-5.2, -900.0, -900.0), (-5.0, 900.0, 900.0))),
        standing(tilt),
        dataclasses.replace(EXACT, mount_roll_rad=roll, mount_tilt_scale=scale),
    )
    expected = np.minimum(behind, body)
    seen = expected < EXACT.range_max_m
    assert np.isfinite(body).sum() > 50 and ranges[seen] == pytest.approx(expected[seen], rel=1e-4)


def test_beams_use_the_pose_at_their_own_time():
    """A robot that drives at 2 m/s towards a wall: every beam is nearer than the one before by speed times time per beam."""
    motion = standing(0.0)
    motion.positions[:, 0] = 2.0 * np.arange(11) * 0.005
    ranges = scan(world_of(WALL), motion)
    ahead = np.abs(ANGLES) < 1.0
    times = np.arange(1081)[ahead] * 0.025 / 1440
    assert ranges[ahead] * np.cos(ANGLES[ahead]) == pytest.approx(5.0 - 0.23 - 2.0 * times, abs=1e-4)


def test_turning_robot_turns_its_beams():
    motion = standing(0.0)
    for i in range(11):
        motion.rotations[i] = rotation_from_rpy(0.0, 0.0, 1.0 * i * 0.005)
    motion.positions[:] -= motion.rotations @ np.array([0.23, 0.0, 0.0])  # about the laser
    ranges, times = scan(world_of(WALL), motion), np.arange(1081) * 0.025 / 1440
    ahead = np.abs(ANGLES) < 1.0
    assert ranges[ahead] == pytest.approx(5.0 / np.cos(ANGLES[ahead] + times[ahead]), rel=1e-4)


def test_range_noise_has_the_configured_spread_and_limits_are_reported_as_rep_117_says():
    config = replace(EXACT, range_sigma_m=0.02)
    laser = Laser(config, ROBOT, world_of(WALL), np.random.default_rng(1))
    middle = np.concatenate([laser.scans(standing(0.0), np.array([0.0]))[0][530:551] for _ in range(60)])
    assert middle.std() == pytest.approx(0.02, rel=0.1)
    near = scan(world_of(box("near", (0.28, -1.0, 0.0), (0.4, 1.0, 2.0))), standing(0.0))
    assert np.isneginf(near[540])
    far = scan(world_of(box("far", (31.0, -9.0, -1.0), (32.0, 9.0, 4.0))), standing(0.0))
    assert np.isposinf(far[540])


def test_veiling_returns_ranges_between_both_surfaces_only_at_edges():
    world = world_of(WALL, box("post", (2.0, -0.2, 0.0), (2.2, 0.2, 2.0)))
    exact = scan(world, standing(0.0))
    veiled = scan(world, standing(0.0), replace(EXACT, veiling_probability=1.0))
    changed = np.flatnonzero(exact != veiled)
    assert 2 <= changed.size <= 4
    for i in changed:
        low, high = sorted((exact[i], exact[i + 1]))
        assert high - low > 0.15 and low <= veiled[i] <= high


def test_sweep_goes_behind_and_up_and_ends_level_at_rest():
    config = SimulationConfig()
    profile = sweep_profile(config)
    assert profile.tilts_rad.max() == pytest.approx(config.sweep_start_rad) and profile.tilts_rad.min() == pytest.approx(
        config.sweep_end_rad
    )
    assert profile.tilts_rad[-1] == 0.0 and profile.rates_rps[-1] == 0.0 and profile.tilt_at(99.0) == 0.0
    assert 5.0 < profile.duration_s < 6.5
    assert np.abs(np.diff(profile.tilts_rad) / 0.001).max() <= 4.0
    assert np.abs(np.diff(profile.rates_rps)).max() < 4.0 * config.tilt_acceleration_rps2 * 0.001


def test_sweep_is_slow_near_the_horizon_and_fast_looking_down():
    profile = sweep_profile(SimulationConfig())
    slow_part = profile.rates_rps < 0.0
    rates = {goal: np.interp(goal, profile.tilts_rad[slow_part][::-1], profile.rates_rps[slow_part][::-1]) for goal in (0.1, 1.57)}
    assert rates[0.1] == pytest.approx(-0.32, abs=0.02) and rates[1.57] == pytest.approx(-2.4, abs=0.05)


def test_imu_at_rest_on_a_slope_measures_gravity_and_its_bias_is_that_of_the_seed():
    R = rotation_from_rpy(0.1, -0.2, 0.7)
    imu = Imu(SimulationConfig(), np.random.default_rng(5))
    mean = np.mean([imu.sample(0.0, R, np.zeros(3), np.zeros(3)).accel for _ in range(2000)], axis=0)
    assert mean - imu.accel_bias == pytest.approx(R.T @ np.array([0.0, 0.0, 9.81]), abs=4e-3)
    assert np.linalg.norm(imu.accel_bias) > 0.0


def test_wheel_odometry_is_the_inverse_of_the_drive():
    drive = Drive(HUSKY)
    for _ in range(100):
        left, right = drive.step(0.4, -0.3, 0.05)
    assert drive.velocity(left, right) == pytest.approx((0.4, -0.3))


def test_drive_clips_and_smooths_commands_and_refuses_nan():
    drive = Drive(HUSKY)
    assert drive.velocity(*drive.step(9.0, 0.0, 0.05))[0] == pytest.approx(HUSKY.max_acceleration_mps2 * 0.05)
    for _ in range(100):
        speeds = drive.step(9.0, 0.0, 0.05)
    assert drive.velocity(*speeds)[0] == pytest.approx(HUSKY.max_speed_mps)
    with pytest.raises(ValueError, match="not finite"):
        drive.step(math.nan, 0.0, 0.05)


def test_slip_keeps_its_spread_over_time():
    slip = SlipModel(SimulationConfig(slip_bias_sigma=0.0, slip_sigma=0.02, slip_correlation_s=0.2), np.random.default_rng(1))
    values = np.array([slip.step(0.05) for _ in range(8000)])
    assert values.std(axis=0) == pytest.approx((0.02, 0.02), rel=0.1)


def test_configuration_reports_every_violation_at_once():
    with pytest.raises(ConfigError) as caught:
        load_config(SimulationConfig, {"physics_rate_hz": 250, "range_min_m": -1.0, "friktion": 1.0})
    assert "multiple of 200" in str(caught.value) and "range_min_m" in str(caught.value) and "did you mean friction" in str(caught.value)


def test_robot_that_contradicts_its_description_is_refused():
    with pytest.raises(ValueError, match="husky.urdf: wheel_radius_m = 0.2, and the URDF has 0.1651"):
        read_robot_model(replace(HUSKY, wheel_radius_m=0.2))
    with pytest.raises(ValueError, match="cannot read the robot description"):
        read_robot_model(replace(HUSKY, urdf="absent.urdf"))


def test_drive_is_as_fast_and_turns_as_the_robot_does():
    robot = replace(HUSKY, max_speed_mps=0.3, max_turn_rate_radps=0.2, max_acceleration_mps2=0.5, effective_track_factor=2.0)
    drive = Drive(robot)
    assert drive.velocity(*drive.step(9.0, 0.0, 0.05))[0] == pytest.approx(0.5 * 0.05)
    for _ in range(100):
        left, right = drive.step(9.0, 9.0, 0.05)
    assert drive.velocity(left, right) == pytest.approx((0.3, 0.2))
    assert right - left == pytest.approx(0.2 * 2.0 * HUSKY.track_m / HUSKY.wheel_radius_m)
