"""The faults of hardware, each by itself: closed forms as oracles, and that `ideal` has none of them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pybullet_simulation import IDEAL, IDEAL_TIMING, Simulation, SimulationConfig, load_world
from pybullet_simulation.ground import Ground
from pybullet_simulation.imu import Imu
from pybullet_simulation.laser import Laser, Motion
from pybullet_simulation.range_errors import RangeErrors
from pybullet_simulation.robot_model import read_robot_model
from pybullet_simulation.solids import box
from pybullet_simulation.tilt_mount import TiltMount
from pybullet_simulation.world import World, joined
from rigid_geometry import rotation_from_rpy, yaw_of
from robot_body import RobotBody

EXACT = replace(IDEAL, range_sigma_m=0.0, range_sigma_far_m=0.0, veiling_probability=0.0)
HUSKY = RobotBody()
HARDWARE = SimulationConfig()


def rng(seed=1):
    return np.random.default_rng(seed)


def measured(config, ranges, incidence=1.0):
    ranges = np.asarray(ranges, np.float32)
    return RangeErrors(config, rng()).measured(ranges, np.full(ranges.size, incidence, np.float32)).astype(float) - ranges


# -- ranges


@pytest.mark.parametrize("angle_deg", [0.0, 60.0, 85.0])
def test_range_is_too_long_by_the_angle_of_incidence(angle_deg):
    cosine = math.cos(math.radians(angle_deg))
    config = replace(EXACT, range_incidence_bias_m=0.01)
    assert measured(config, np.full(50, 4.0), cosine) == pytest.approx(np.full(50, 0.01 * (1.0 - cosine)), abs=1e-6)


def test_wall_that_is_met_aslant_is_measured_longer_than_one_head_on():
    """The laser finds the angle by itself: beam i of a level scan meets a wall ahead at its own angle."""
    wall = box("wall", (5.0, -50.0, -1.0), (5.2, 50.0, 4.0))
    vertices, triangles = joined([wall])
    world = World("test", (wall,), (), vertices, triangles, np.array([vertices.min(0), vertices.max(0)]), (0.0, 0.0, 0.0), 0.0)
    motion = Motion(np.tile(np.eye(3), (6, 1, 1)), np.tile((0.0, 0.0, HUSKY.base_height_m), (6, 1)), np.zeros(6), 0.005)
    scans = [
        Laser(config, read_robot_model(HUSKY), world, rng()).scans(motion, np.array([0.0]))[0].astype(float)
        for config in (EXACT, replace(EXACT, range_incidence_bias_m=0.01))
    ]
    angles = np.radians(np.linspace(-135.0, 135.0, 1081))
    seen = np.abs(angles) < 1.3
    assert (scans[1][seen] - scans[0][seen]) == pytest.approx(0.01 * (1.0 - np.cos(angles[seen])), abs=1e-5)


@pytest.mark.parametrize(("range_m", "sigma", "limit"), [(5.0, 0.01, 0.03), (15.0, 0.03, 0.05)])
def test_range_has_the_noise_and_the_accuracy_of_the_data_sheet(range_m, sigma, limit):
    errors = measured(replace(HARDWARE, veiling_probability=0.0, range_incidence_bias_m=0.0), np.full(40_000, range_m))
    clipped = np.clip(sigma * rng(2).standard_normal(40_000), -limit, limit).std()
    assert errors.std() == pytest.approx(clipped, rel=0.02) and np.abs(errors).max() == pytest.approx(limit, abs=1e-3)


def test_floor_that_is_met_at_a_grazing_angle_sends_no_echo_from_afar():
    """Of the light that falls on it a surface of 40 % at 10 m sends back four times what a surface of 10 % does."""
    config, ranges = replace(EXACT, reflectivity=0.4), np.array([4.0, 9.9, 10.1, 19.9, 20.1], np.float32)
    assert np.isfinite(measured(config, ranges)).tolist() == [True, True, True, True, False]
    assert np.isfinite(measured(config, ranges, 0.25)).tolist() == [True, True, False, False, False]
    assert np.isfinite(measured(EXACT, ranges, 0.01)).all()


def test_ranges_are_whole_millimetres():
    ranges = RangeErrors(HARDWARE, rng()).measured(np.linspace(1.0, 20.0, 500, dtype=np.float32), np.ones(500, np.float32))
    assert np.abs(ranges * 1000.0 - np.round(ranges * 1000.0)).max() < 2e-3


# -- the mount


def test_play_holds_the_laser_back_on_either_side():
    mount = TiltMount(replace(IDEAL, tilt_backlash_rad=0.01), rng())
    up, down = np.linspace(0.0, 0.5, 51), np.linspace(0.5, -0.2, 71)
    risen, fallen = mount.true_tilts(up), mount.true_tilts(down)
    assert risen[5:] == pytest.approx(up[5:] - 0.005) and risen[0] == 0.0
    assert fallen[0] == risen[-1] and fallen[5:] == pytest.approx(down[5:] + 0.005)
    assert mount.true_tilts(np.full(5, -0.198)) == pytest.approx(np.full(5, -0.195))  # within the play nothing moves


def test_offset_is_drawn_by_the_seed_and_stays():
    offsets = np.array([TiltMount(HARDWARE, rng(seed)).offset_rad for seed in range(400)])
    assert offsets.std() == pytest.approx(math.radians(0.1), rel=0.1)
    mount = TiltMount(replace(HARDWARE, tilt_backlash_rad=0.0), rng())
    assert mount.true_tilts(np.array([0.0, 1.0])) == pytest.approx(np.array([0.0, 1.0]) + mount.offset_rad)


def test_mount_s_faults_show_in_the_ranges_and_not_in_the_measured_tilt():
    runs = []
    for config in (IDEAL, replace(IDEAL, tilt_backlash_rad=0.0052, tilt_offset_sigma_rad=0.00175)):
        simulation = Simulation(config, load_world("ramp", 2), 2, timing=IDEAL_TIMING)
        simulation.start_sweep()
        runs.append([simulation.tick(0.0, 0.0) for _ in range(20)])
        simulation.close()
    for good, off in zip(*runs, strict=True):
        assert good.joints == off.joints
        assert all(not np.array_equal(s.ranges, t.ranges) for s, t in zip(good.scans, off.scans, strict=True))


# -- the IMU


def test_gyro_s_scale_is_drawn_by_the_seed():
    scales = np.array([Imu(HARDWARE, rng(seed)).gyro_scale for seed in range(300)])
    assert scales.std() == pytest.approx(0.005, rel=0.1) and scales.mean() == pytest.approx(1.0, abs=1e-3)
    imu = Imu(replace(HARDWARE, imu_gyro_sigma_rps=0.0, imu_gyro_bias_walk_rps=0.0), rng())
    rate = np.array([0.0, 0.0, 2.0])
    assert imu.sample(1.0, np.eye(3), rate, np.zeros(3)).gyro - imu.gyro_bias == pytest.approx(imu.gyro_scale * rate)


def test_biases_wander_with_the_root_of_time_and_not_at_all_when_ideal():
    config = replace(HARDWARE, imu_gyro_bias_sigma_rps=0.0, imu_accel_bias_sigma_mps2=0.0)
    after = {}
    for steps in (100, 400):
        imus = [Imu(config, rng(seed)) for seed in range(60)]
        for k in range(steps + 1):
            for imu in imus:
                imu.sample(0.01 * k, np.eye(3), np.zeros(3), np.zeros(3))
        after[steps] = np.std([imu.gyro_bias for imu in imus]), np.std([imu.accel_bias for imu in imus])
    assert after[100] == pytest.approx((4e-5, 5e-5), rel=0.2)
    assert after[400] == pytest.approx((8e-5, 1e-4), rel=0.2)
    ideal = Imu(IDEAL, rng())
    before = ideal.gyro_bias
    ideal.sample(0.0, np.eye(3), np.zeros(3), np.zeros(3))
    ideal.sample(9.0, np.eye(3), np.zeros(3), np.zeros(3))
    assert np.array_equal(before, ideal.gyro_bias)


# -- ground and wheels


def test_slip_is_a_smooth_function_of_the_place_alone():
    config = replace(HARDWARE, wheel_radius_sigma=0.0)
    places = np.random.default_rng(3).uniform(-50.0, 50.0, (4000, 2))
    ground = Ground(config, rng())
    slips = np.concatenate([ground.slip(pair, 0.0) for pair in places.reshape(-1, 2, 2)])
    assert slips.std() == pytest.approx(config.slip_patch_sigma, rel=0.1) and slips.mean() == pytest.approx(0.0, abs=2e-3)
    assert ground.slip(places[:2], 0.0) == pytest.approx(Ground(config, rng()).slip(places[:2], 0.0))
    assert np.abs(ground.slip(places[:2] + 0.05, 0.0) - ground.slip(places[:2], 0.0)).max() < 0.2 * config.slip_patch_sigma


def test_wheels_slip_uphill_and_are_ahead_downhill():
    ground, here = Ground(replace(HARDWARE, wheel_radius_sigma=0.0), rng()), np.zeros((2, 2))
    assert ground.slip(here, 0.25) - ground.slip(here, 0.0) == pytest.approx(np.full(2, 0.025))
    assert ground.slip(here, -0.25) - ground.slip(here, 0.0) == pytest.approx(np.full(2, -0.025))


def test_ground_s_grip_differs_from_place_to_place_and_is_never_none():
    ground = Ground(HARDWARE, rng())
    ratios = np.array([ground.sideways_ratio(place) for place in np.random.default_rng(3).uniform(-50.0, 50.0, (2000, 2))])
    assert ratios.std() == pytest.approx(0.2 * HARDWARE.lateral_friction_ratio, rel=0.1) and ratios.min() > 0.1


def test_wheel_radius_is_drawn_once_for_all_places():
    config = replace(IDEAL, wheel_radius_sigma=0.01)
    slips = np.array([Ground(config, rng(seed)).slip(np.zeros((2, 2)), 0.3) for seed in range(300)])
    assert slips.std() == pytest.approx(0.01, rel=0.1) and np.array_equal(slips[:, 0], slips[:, 1])
    assert not Ground(IDEAL, rng()).varies


def test_grip_changes_how_far_the_robot_turns():
    turned = []
    for config in (IDEAL, replace(IDEAL, lateral_friction_ratio=0.9)):
        simulation = Simulation(config, load_world("rooms", 1, start=(-4.0, 0.0, 0.0)), 1, timing=IDEAL_TIMING)
        for _ in range(40):
            data = simulation.tick(0.0, 0.6)
        simulation.close()
        turned.append(yaw_of(data.truth.T_world_base))
    assert turned[1] < 0.9 * turned[0]


def test_level_laser_sees_nothing_of_the_robot_though_its_mount_is_off():
    far = box("far", (90.0, 0.0, 0.0), (91.0, 1.0, 1.0))
    vertices, triangles = joined([far])
    world = World("test", (far,), (), vertices, triangles, np.array([vertices.min(0), vertices.max(0)]), (0.0, 0.0, 0.0), 0.0)
    for tilt in (0.0, 0.005, -0.005):
        R = np.tile(rotation_from_rpy(0.0, 0.0, 0.3), (6, 1, 1))
        motion = Motion(R, np.tile((0.0, 0.0, HUSKY.base_height_m), (6, 1)), np.full(6, tilt), 0.005)
        assert np.isposinf(Laser(EXACT, read_robot_model(HUSKY), world, rng()).scans(motion, np.array([0.0]))[0]).all()
