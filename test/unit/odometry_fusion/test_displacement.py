"""A robot that is moved otherwise than by its wheels is noticed, from the IMU, and one that drives is not."""

import numpy as np
import pytest
from kinematic_robot import Errors, Motion, simulate

from odometry_fusion import OdometryConfig, OdometryFilter
from pybullet_simulation import Simulation, SimulationConfig, load_world
from rigid_geometry import LeapWatch
from robot_body import RobotBody

CONFIG = OdometryConfig()


def followed(script: str, seconds: float, v: float = 0.0, w: float = 0.0, seed: int = 1, each_imu: int = 1) -> list:
    """Estimates of a robot in rooms, with hardware's errors, under one command after three seconds of rest; of 100 Hz one in `each_imu`."""
    odometry, found, samples = OdometryFilter(CONFIG, RobotBody()), [], 0
    simulation = Simulation(SimulationConfig(disturbances=script), load_world("rooms", seed), seed)
    for k in range(round(20 * seconds)):
        data = simulation.tick(*((v, w) if k >= 60 else (0.0, 0.0)))
        for sample in data.imu:
            samples += 1
            if samples % each_imu:
                continue
            odometry.add_imu(sample.stamp_s, sample.gyro, sample.accel)
        for wheels in data.wheel_odometry:
            odometry.add_wheels(wheels.stamp_s, wheels.v, wheels.w)
            found.append(odometry.estimate(wheels.stamp_s))
    simulation.close()
    return [one for one in found if one is not None]


@pytest.mark.parametrize(
    ("script", "word"), [("push 5 0.3", "moved"), ("push 5 1", "moved"), ("lift 5 2", "moved|turned"), ("tilt 5 20", "moved|tilted")]
)
def test_robot_that_stands_and_is_moved_by_hands_is_noticed_within_two_seconds_and_rests_again(script: str, word: str) -> None:
    found = followed(script, 16.0)
    told = [one for one in found if one.displaced]
    begin_s = found[0].stamp_s
    assert told and told[0].displaced.split()[0] in word.split("|")
    assert 5.0 <= told[0].stamp_s - begin_s + 0.1 <= 7.0
    assert not found[-1].displaced and found[-1].standing


@pytest.mark.parametrize("each_imu", [5, 8])
def test_robot_whose_imu_tells_no_more_often_than_its_wheels_is_noticed_too(each_imu: int) -> None:
    assert any(one.displaced for one in followed("push 5 1", 8.0, each_imu=each_imu))
    assert not any(one.displaced for one in followed("", 8.0, v=0.5, each_imu=each_imu))


def test_robot_that_is_pushed_as_it_drives_is_noticed() -> None:
    assert any(one.displaced for one in followed("push 5 0.3", 7.0, v=0.5))


def test_robot_whose_wheels_spin_against_a_wall_is_noticed_as_it_meets_it() -> None:
    found = followed("", 7.5, v=0.7)
    told = [one.stamp_s for one in found if one.displaced]
    assert told and 6.6 < told[0] < 7.2
    assert not any(one.displaced for one in followed("", 5.5, v=0.7))


@pytest.mark.parametrize("speed_mps", [0.0, 0.5], ids=["stands", "drives on"])
def test_covariance_leaps_with_every_sample_of_the_way_that_is_not_known_and_with_no_other(speed_mps: float) -> None:
    watch, leaps = LeapWatch(), []
    for one in followed("push 4 0.5", 7.5, v=speed_mps):
        leaps.append((watch.leapt(one.pose_covariance[0, 0], one.pose_covariance[1, 1]), bool(one.displaced)))
    assert leaps and all(leapt == displaced for leapt, displaced in leaps)
    assert any(leapt for leapt, _ in leaps)


@pytest.mark.parametrize(("told", "displaced"), [(True, False), (False, True)])
def test_imu_beside_the_middle_feels_turns_which_are_not_taken_for_pushes_where_its_place_is_known(told: bool, displaced: bool) -> None:
    arm = np.array([0.6, 0.0, 0.1])
    data = simulate([Motion(3.0), Motion(3.0, 0.0, 1.4), Motion(2.0)], Errors(), np.random.default_rng(0))
    stamps, gyros = np.array([row[0] for row in data.imu]), np.array([row[1] for row in data.imu])
    jerks = np.gradient(gyros, stamps, axis=0)
    felt = [accel + np.cross(jerk, arm) + np.cross(w, np.cross(w, arm)) for (_, w, accel), jerk in zip(data.imu, jerks, strict=True)]
    odometry, found = OdometryFilter(CONFIG, RobotBody()), []
    if told:
        odometry.mount_imu(arm)
    for row, accel in zip(data.imu, felt, strict=True):
        odometry.add_imu(row[0], row[1], accel)
    for stamp, v, w in data.wheels:
        odometry.add_wheels(stamp, v, w)
        found.append(odometry.estimate(stamp))
    assert any(one is not None and bool(one.displaced) for one in found) == displaced


@pytest.mark.parametrize(
    "motion",
    [Motion(3.0, 0.7), Motion(3.0, 0.0, 1.2), Motion(3.0, 0.5, 0.8), Motion(0.5, 0.7, 0.0, -0.5)],
    ids=["straight", "turn", "bend", "up a ramp"],
)
def test_robot_that_drives_is_where_its_wheels_say(motion: Motion) -> None:
    rng = np.random.default_rng(3)
    data = simulate([Motion(3.0), motion, Motion(2.0)], Errors.drawn(rng), rng)
    odometry, pending = OdometryFilter(CONFIG, RobotBody()), list(data.imu)
    for stamp, v, w in data.wheels:
        while pending and pending[0][0] <= stamp:
            odometry.add_imu(*pending.pop(0))
        odometry.add_wheels(stamp, v, w)
        assert not odometry.estimate(stamp).displaced
