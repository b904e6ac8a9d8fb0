"""The spinning lidar by itself and in the simulation: where its beams point, when, and what they bring back."""

import math
from dataclasses import replace

import numpy as np
import pytest
from solid_worlds import world_of

from pybullet_simulation import IDEAL, IDEAL_TIMING, Simulation, SimulationConfig, SpinningLidarConfig, load_world
from pybullet_simulation.beam_casting import Motion
from pybullet_simulation.records import LidarGeometry
from pybullet_simulation.robot_model import read_robot_model
from pybullet_simulation.solids import box
from pybullet_simulation.spinning_lidar import SpinningLidar
from pybullet_simulation.sweep_profile import spinning_sweep_profile, sweep_profile
from pybullet_simulation.world import nearest_hits, raycasting_scene
from rigid_geometry import rotation_from_rpy
from robot_body import DEFAULT_ROBOT_FILE, RobotBody, load_robot

EXACT = replace(IDEAL, range_sigma_m=0.0, range_sigma_far_m=0.0, veiling_probability=0.0)
HUSKY = RobotBody()
ROBOT = read_robot_model(HUSKY)
FIXED = load_robot(DEFAULT_ROBOT_FILE.parent / "robots" / "husky_vlp16.yaml")
HALL = box("hall", (-6.0, -6.0, -0.0), (6.0, 6.0, 4.0))
LASER_ABOVE_GROUND_M = 0.132 + 0.75 + 0.04


def standing(tilt=0.0, steps=20):
    positions = np.tile((0.0, 0.0, HUSKY.base_height_m), (steps + 1, 1))
    return Motion(np.tile(np.eye(3), (steps + 1, 1, 1)), positions, np.full(steps + 1, tilt), 0.1 / steps)


def turn(world, motion, config=EXACT, **lidar):
    sensor = SpinningLidar(config, SpinningLidarConfig(**lidar), ROBOT, world, np.random.default_rng(1))
    return sensor.revolution(motion, 0.0, 1.0)


def test_rings_lie_two_degrees_apart_and_turn_clockwise_from_the_back():
    seen = turn(world_of(HALL), standing())
    x, y, z = seen.points.astype(float).T
    elevation = np.degrees(np.arctan2(z, np.hypot(x, y)))
    np.testing.assert_allclose(elevation, -15.0 + 2.0 * seen.rings, atol=1e-3)
    azimuth = np.unwrap(np.arctan2(y, x)[seen.rings == 8])
    np.testing.assert_allclose(np.degrees(np.diff(azimuth)), -0.4, atol=1e-3)
    assert abs(abs(azimuth[0]) - math.pi) < 1e-5


def test_columns_are_fired_together_and_evenly_over_a_tenth_of_a_second():
    seen = turn(world_of(HALL), standing())
    assert len(seen.points) == 16 * 900 and seen.rings.dtype == np.uint16 and seen.times_s.dtype == np.float32
    np.testing.assert_allclose(seen.times_s.reshape(900, 16), np.arange(900)[:, None] * 0.1 / 900 * np.ones(16), atol=1e-7)
    np.testing.assert_array_equal(seen.rings.reshape(900, 16), np.tile(np.arange(16), (900, 1)))


def test_points_lie_on_the_walls():
    points = turn(world_of(HALL), standing()).points.astype(float) + [0.23, 0.0, LASER_ABOVE_GROUND_M]
    low, high = np.array([-6.0, -6.0, 0.0]), np.array([6.0, 6.0, 4.0])
    assert np.minimum(np.abs(points - low), np.abs(points - high)).min(axis=1).max() < 1e-3


def test_level_rings_leave_the_floor_around_the_robot_unseen():
    """Why the lidar sits on a mount that nods: level, its lowest ring meets the floor 3.4 m away, and the next 0.6 m farther."""
    floor = world_of(box("floor", (-40.0, -40.0, -1.0), (40.0, 40.0, 0.0)))
    seen = turn(floor, standing())
    radius = [np.hypot(*seen.points[seen.rings == ring, :2].T).mean() for ring in (0, 1)]
    assert radius == pytest.approx([LASER_ABOVE_GROUND_M / math.tan(math.radians(a)) for a in (15.0, 13.0)], rel=1e-3)
    assert radius[0] > 3.4 and radius[1] - radius[0] > 0.5


def test_beams_that_met_nothing_have_no_point_and_those_too_near_no_row():
    world = world_of(box("near", (0.30, -1.0, 0.0), (0.32, 1.0, 2.0)))
    seen = turn(world, standing())
    nothing = np.isnan(seen.points).all(axis=1)
    assert (nothing | np.isfinite(seen.points).all(axis=1)).all() and nothing.any()
    assert len(seen.points) < 16 * 900
    assert np.linalg.norm(seen.points[~nothing], axis=1).min() >= EXACT.range_min_m


def test_level_lidar_sees_nothing_of_its_robot_and_tilted_it_does():
    far = world_of(box("far", (90.0, 0.0, 0.0), (91.0, 1.0, 1.0)))
    assert np.isnan(turn(far, standing()).points).all()
    tilted = turn(far, standing(1.4)).points
    assert np.isfinite(tilted).all(axis=1).sum() > 50
    directions = LidarGeometry(900).directions(np.arange(900)).reshape(-1, 3)
    rays = np.hstack([np.tile((0.23, 0.0, 0.79), (len(directions), 1)), directions]).astype(np.float32)
    assert np.isinf(nearest_hits(raycasting_scene(ROBOT.body.vertices, ROBOT.body.triangles), rays)).all()


def test_beams_use_the_pose_at_their_own_time():
    """A robot that turns about its lidar at 1 rad/s: the wall that it turns to lies where it did, as seen from each beam's own heading."""
    motion = standing()
    for i in range(21):
        motion.rotations[i] = rotation_from_rpy(0.0, 0.0, 1.0 * i * 0.005)
    motion.positions[:] -= motion.rotations @ np.array([0.23, 0.0, 0.0])
    seen = turn(world_of(HALL), motion)
    yaw = seen.times_s.astype(float)
    x = np.cos(yaw) * seen.points[:, 0] - np.sin(yaw) * seen.points[:, 1]
    y = np.sin(yaw) * seen.points[:, 0] + np.cos(yaw) * seen.points[:, 1]
    level = seen.rings == 7
    assert np.minimum(np.abs(np.abs(x) - 6.0), np.abs(np.abs(y) - 6.0))[level].max() < 2e-3


def test_range_noise_is_the_laser_s():
    config = replace(EXACT, range_sigma_m=0.02)
    noisy, exact = (turn(world_of(HALL), standing(), config=c) for c in (config, EXACT))
    errors = np.linalg.norm(noisy.points, axis=1) - np.linalg.norm(exact.points, axis=1)
    near = np.linalg.norm(exact.points, axis=1) < 9.0
    assert errors[near].std() == pytest.approx(0.02, rel=0.05)


def test_sweep_takes_the_revolutions_asked_for_and_ends_level_at_rest():
    config, lidar = SimulationConfig(), SpinningLidarConfig(revolutions=30)
    profile = spinning_sweep_profile(config, lidar)
    slow = profile.rates_rps < 0.0
    assert slow.sum() * 0.001 == pytest.approx(3.0, abs=0.3)
    assert profile.tilts_rad.max() == lidar.sweep_start_rad and profile.tilts_rad.min() == lidar.sweep_end_rad
    assert profile.tilts_rad[-1] == 0.0 and profile.rates_rps[-1] == 0.0


def test_sweep_is_never_faster_than_the_mount():
    profile = spinning_sweep_profile(SimulationConfig(), SpinningLidarConfig(revolutions=1))
    assert np.abs(profile.rates_rps).max() <= SimulationConfig().slew_rate_rps + 1e-9
    assert spinning_sweep_profile(SimulationConfig(), SpinningLidarConfig()).duration_s < 0.6 * sweep_profile(SimulationConfig()).duration_s


@pytest.fixture(scope="module")
def rooms():
    return load_world("rooms", 1)


def test_ideal_simulation_gives_a_revolution_every_second_tick_and_no_scans(rooms):
    simulation = Simulation(IDEAL, rooms, 1, lidar=SpinningLidarConfig(), timing=IDEAL_TIMING)
    data = [simulation.tick(0.0, 0.0) for _ in range(6)]
    simulation.close()
    assert [len(d.revolutions) for d in data] == [0, 1] * 3
    assert all(d.scans == () for d in data)
    assert [turn.stamp_s for d in data for turn in d.revolutions] == [0.95, 1.05, 1.15]


def test_revolution_that_began_two_ticks_ago_is_measured_along_all_of_the_way(rooms):
    """A turning robot, on whose revolutions the same wall lies where it did, although each begins at an instant of its own."""
    simulation = Simulation(replace(EXACT, tilt_encoder_sigma_rad=0.0), rooms, 1, lidar=SpinningLidarConfig(columns=360))
    data = [simulation.tick(0.0, 0.8) for _ in range(24)]
    simulation.close()
    stamps = np.array([turn.stamp_s for d in data for turn in d.revolutions])
    assert len(stamps) >= 9 and np.diff(stamps) == pytest.approx(0.1, rel=0.06)
    assert len(set(np.round((stamps / 0.05) % 1.0, 6))) == len(stamps)


def test_same_seed_gives_the_same_revolutions(rooms):
    def run():
        simulation = Simulation(SimulationConfig(), rooms, 3, lidar=SpinningLidarConfig(columns=180))
        simulation.start_sweep()
        found = [simulation.tick(0.3, 0.4) for _ in range(8)]
        simulation.close()
        return [turn for data in found for turn in data.revolutions]

    for a, b in zip(run(), run(), strict=True):
        assert a.points.tobytes() == b.points.tobytes() and a.times_s.tobytes() == b.times_s.tobytes()


def test_fixed_lidar_looks_where_its_description_has_it_and_no_joint_tilts_it():
    floor = box("floor", (-9.0, -9.0, -1.0), (9.0, 9.0, 0.0))
    simulation = Simulation(EXACT, world_of(floor), 1, FIXED, SpinningLidarConfig(), IDEAL_TIMING)
    samples = [one for _ in range(10) for one in simulation.tick(0.0, 0.0).deliveries]
    names = {name for one in samples if one.topic == "/joint_states" for name in one.sample.names}
    assert len(names) == 4 and all("wheel" in name for name in names)
    turns = [one.sample for one in samples if one.topic == "/points"]
    T_base_laser = read_robot_model(FIXED).T_base_mount
    points = turns[-1].points.astype(float) @ T_base_laser[:3, :3].T + T_base_laser[:3, 3]
    ground = points[np.abs(points[:, 2] + FIXED.base_height_m) < 0.02]
    below = LASER_ABOVE_GROUND_M / np.tan(np.radians(40.0))  # 25 deg, and the lowest ring 15 deg more
    assert ground[:, 0].max() > 4.0 and np.hypot(*(ground[:, :2] - T_base_laser[:2, 3]).T).min() == pytest.approx(below, abs=0.02)
    with pytest.raises(ValueError, match="fixed"):
        simulation.start_sweep()
    with pytest.raises(ValueError, match="fixed"):
        simulation.nod(True)
    simulation.close()


def test_laser_that_scans_a_line_cannot_be_fixed():
    with pytest.raises(ValueError, match="husky_vlp16.*has to be a spinning lidar"):
        Simulation(EXACT, world_of(HALL), 1, FIXED)
