"""When the sensors measure and what comes of it: clocks by themselves, the trace that they ask, and the whole simulation."""

import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from pybullet_simulation import IDEAL, IDEAL_TIMING, SENSOR_TOPICS, Simulation, SimulationConfig, TimingConfig, load_world, realistic
from pybullet_simulation.sensor_clock import SensorClock, SensorTimes
from pybullet_simulation.trace import PhysicsTick, Tilts, Trace
from rigid_geometry import inverse, rotation_from_rpy, yaw_of
from stage_config import ConfigError

IMU = SensorTimes("/imu/data", 0.01, 0.0, 0.003)
SCAN = SensorTimes("/scan", 0.025, 0.01875, 0.025)
LATENCY_S = {"/scan": 0.025, "/imu/data": 0.003, "/joint_states": 0.012, "/wheel_odom": 0.012}
PERIOD_S = {"/scan": 0.025, "/imu/data": 0.01, "/joint_states": 0.025, "/wheel_odom": 0.05}
HUNDRED_S = 100 * 10**9


def clock(timing=TimingConfig(), sensor=IMU, seed=1, remainder=2):  # noqa: B008  frozen
    return SensorClock(timing, sensor, 0, (seed,), remainder)


def stamps_of(clock, until_ns=HUNDRED_S):
    return np.array([one.stamp_ns for one in clock.measured(until_ns)])


# -- the clock of one sensor


def test_period_jitters_by_its_share_and_keeps_its_mean():
    apart = np.diff(stamps_of(clock())) / 1e9
    assert apart.std() == pytest.approx(0.015 * 0.01, rel=0.05) and apart.mean() == pytest.approx(0.01, rel=1e-3)
    assert np.abs(apart / 0.01 - 1.0).max() < 0.046


def test_phase_is_drawn_by_the_seed_within_a_period():
    first = np.array([stamps_of(clock(seed=seed), 10**9)[0] for seed in range(200)]) / 1e9 - 0.01
    assert first.min() >= 0.0 and first.max() < 0.01001 and first.mean() == pytest.approx(0.005, abs=0.0006)
    assert len(set(first)) == 200


def test_stamps_are_no_multiples_of_anything_and_sensors_never_share_one():
    stamps = [stamps_of(clock(remainder=i)) for i in range(7)]
    assert all(set(one % 7) == {i} for i, one in enumerate(stamps))
    assert (stamps[0] % 1000 != 0).mean() > 0.99


def test_share_of_messages_is_lost_and_another_comes_twice():
    copies = Counter(one.copies for one in clock().measured(10 * HUNDRED_S))
    total = sum(copies.values())
    assert copies[0] / total == pytest.approx(1 / 500, rel=0.2) and copies[2] / total == pytest.approx(1 / 1000, rel=0.25)
    assert set(copies) == {0, 1, 2}


def test_measurement_is_handed_out_once_when_it_is_complete():
    one = clock(sensor=SCAN)
    found = [measurement for until in range(0, 10**9, 7_000_000) for measurement in one.measured(until)]
    assert [m.stamp_ns for m in found] == [m.stamp_ns for m in clock(sensor=SCAN).measured(10**9 - 1)][: len(found)]
    assert clock(sensor=SCAN).measured(found[0].stamp_ns + 18_749_999) == []
    assert len(clock(sensor=SCAN).measured(found[0].stamp_ns + 18_750_000)) == 1
    assert all(m.delivery_ns - m.stamp_ns == 25_000_000 for m in found)


def test_ideal_clock_has_even_stamps_and_loses_nothing():
    found = clock(IDEAL_TIMING, SCAN).measured(10**9)
    assert [m.stamp_ns for m in found] == list(range(0, 976_000_000, 25_000_000)) and {m.copies for m in found} == {1}
    assert stamps_of(clock(IDEAL_TIMING), 10**8).tolist() == list(range(10**7, 10**8 + 1, 10**7))


def test_effects_have_streams_of_their_own():
    """What is lost does not change when the sensor measures."""
    quiet = stamps_of(clock(TimingConfig(lost_share=0.0, doubled_share=0.0)))
    assert np.array_equal(quiet, stamps_of(clock(TimingConfig(lost_share=0.3))))


def test_fault_is_of_one_sensor_between_its_times():
    silent = TimingConfig(faults="silent /imu/data 2 3, silent /scan 5 6", lost_share=0.0)
    lost = np.array([m.delivery_ns / 1e9 for m in clock(silent).measured(10**10) if m.copies == 0])
    assert len(lost) == pytest.approx(100, abs=2) and lost.min() >= 2.0 and lost.max() < 3.0


def test_sensor_whose_values_are_no_numbers_or_whose_stamps_are_old():
    faults = "nan /imu/data 1 2, nan /wheel_odom 1 2, nan /joint_states 1 2, nan /scan 1 2, late /imu/data 2 3"
    simulation = Simulation(SimulationConfig(), load_world("rooms", 1), 1, timing=TimingConfig(faults=faults, lost_share=0.0))
    ticks = [simulation.tick() for _ in range(70)]
    simulation.close()
    since_s = [d.time_s - (ticks[0].stamp_s - 0.05) for tick in ticks for d in tick.deliveries]
    samples = [d.sample for tick in ticks for d in tick.deliveries]
    for sample, at_s in zip(samples, since_s, strict=True):
        values = np.concatenate([np.ravel(v) for k, v in vars(sample).items() if k not in ("stamp_s", "names")])
        assert np.isnan(values).all() if 1.0 <= at_s < 2.0 else not np.isnan(values).any()
    ages = np.array([d.time_s - d.sample.stamp_s for tick in ticks for d in tick.deliveries if d.topic == "/imu/data"])
    assert set(np.round(ages).tolist()) == {0.0, 3.0} and np.count_nonzero(ages > 1.0) == pytest.approx(100, abs=2)


@pytest.mark.parametrize(
    ("faults", "told"),
    [
        ("silent /lidar 1 2", "no sensor of that topic; there are /scan, /points"),
        ("wrong /scan 1 2", "no such kind; there are silent, nan, late"),
        ("/scan 1 2", "expected KIND TOPIC FROM TO"),
        ("silent /scan 1 x", "expected KIND TOPIC FROM TO"),
        ("silent /scan 2 2", "does not end after it begins"),
        ("silent /scan nan 2", "does not end after it begins"),
    ],
)
def test_fault_that_cannot_be_read_is_refused(faults, told):
    with pytest.raises(ConfigError, match=told):
        realistic(TimingConfig, "hardware", {"faults": faults})


def test_realism_is_hardware_or_ideal_and_values_stay_on_top():
    with pytest.raises(ConfigError, match="realism = 'real' is none of hardware, ideal"):
        realistic(SimulationConfig, "real", {})
    assert realistic(SimulationConfig, "hardware", {}) == SimulationConfig()
    assert realistic(SimulationConfig, "ideal", {"tilt_backlash_rad": 0.01}) == replace(IDEAL, tilt_backlash_rad=0.01)


# -- the trace


def tick_of_turn(k, steps=10, rate_rps=1.0):
    """Turning at a constant rate; encoders turn by k rad in the first half, and twice that in the second."""
    times = k * 0.05 + np.arange(steps + 1) * 0.05 / steps
    return PhysicsTick(
        begin_ns=k * 50_000_000,
        rotations=np.array([rotation_from_rpy(0.0, 0.0, rate_rps * t) for t in times]),
        positions=np.column_stack([times, times * 0.0, times * 0.0]),
        angular=np.tile([0.0, 0.0, rate_rps], (steps + 1, 1)),
        imu_velocities=np.column_stack([2.0 * times, times * 0.0, times * 0.0]),
        tilts=Tilts(times, 10.0 * times, np.full(steps + 1, 10.0)),
        encoders=np.full(4, sum(3.0 * i for i in range(k))),
        turns=np.array([np.full(4, 1.0 * k), np.full(4, 2.0 * k)]),
    )


@pytest.fixture
def trace():
    found = Trace(50_000_000, 200)
    for k in range(5):
        found.append(tick_of_turn(k))
    return found


def test_instants_lie_between_the_steps(trace):
    for ns in (100_000_001, 123_456_789, 150_000_000, 150_000_001, 250_000_000):
        now = trace.at(ns)
        assert now.imu_velocity[0] == pytest.approx(2.0 * ns / 1e9) and now.tilt_measured == pytest.approx(ns / 1e8)
        assert math.atan2(now.R_world_base[1, 0], now.R_world_base[0, 0]) == pytest.approx(ns / 1e9, abs=1e-6)


def test_motion_reaches_over_the_ticks_since_a_stamp(trace):
    motion, start_s = trace.motion_from(133_000_000)
    assert start_s == pytest.approx(0.033) and motion.positions[:, 0] == pytest.approx(np.arange(31) * 0.005 + 0.1)
    assert len(trace.motion_from(200_000_000)[0].tilts) == 11


def test_encoders_are_asked_at_any_instant(trace):
    assert trace.turned(150_000_000, 200_000_000) == pytest.approx(np.full(4, 9.0))
    assert trace.turned(170_000_000, 180_000_000) == pytest.approx(np.full(4, 0.2 * 3.0 + 0.2 * 6.0))
    assert trace.encoders(200_000_000) == pytest.approx(np.full(4, 18.0))
    assert trace.encoders(180_000_000) - trace.encoders(170_000_000) == pytest.approx(trace.turned(170_000_000, 180_000_000))


def test_instant_before_the_kept_ticks_is_refused(trace):
    with pytest.raises(IndexError):
        trace.at(99_000_000)


# -- the whole


@pytest.fixture(scope="module")
def driven():
    """Ten seconds of a drive in bends, on hardware: the data of each tick."""
    simulation = Simulation(SimulationConfig(), load_world("rooms", 1, start=(-4.0, 0.0, 0.0)), 5)
    data = [simulation.tick(0.2 * math.sin(k / 20), 0.5) for k in range(200)]
    simulation.close()
    return data


def test_deliveries_come_in_order_each_with_its_latency(driven):
    for data in driven:
        times = [d.time_s for d in data.deliveries]
        assert times == sorted(times) and all(data.stamp_s - 0.05 < t <= data.stamp_s for t in times)
        assert all(d.time_s - d.sample.stamp_s == pytest.approx(LATENCY_S[d.topic], abs=1e-8) for d in data.deliveries)


def test_every_sensor_has_its_rate_and_no_two_share_a_stamp(driven):
    stamps = {topic: [d.sample.stamp_s for data in driven for d in data.deliveries if d.topic == topic] for topic in PERIOD_S}
    for topic, period_s in PERIOD_S.items():
        assert len(stamps[topic]) == pytest.approx(10.0 / period_s, rel=0.03, abs=2)
    single = [{round(t * 1e9) for t in found} for found in stamps.values()]
    assert len(set().union(*single)) == sum(map(len, single))
    assert set(stamps) <= set(SENSOR_TOPICS)


def test_same_seed_gives_the_same_messages_at_the_same_times(driven):
    simulation = Simulation(SimulationConfig(), load_world("rooms", 1, start=(-4.0, 0.0, 0.0)), 5)
    again = [simulation.tick(0.2 * math.sin(k / 20), 0.5) for k in range(40)]
    simulation.close()
    for a, b in zip(driven, again, strict=False):
        assert [(d.time_s, d.topic) for d in a.deliveries] == [(d.time_s, d.topic) for d in b.deliveries]
        assert all(np.array_equal(s.ranges, t.ranges) for s, t in zip(a.scans, b.scans, strict=True))
        assert a.joints == b.joints and a.wheel_odometry == b.wheel_odometry
        assert all(np.array_equal(s.gyro, t.gyro) for s, t in zip(a.imu, b.imu, strict=True))


def test_integrated_gyro_and_wheels_are_those_of_the_stamps(driven):
    """Bias, scale and slip apart, what the samples say adds up to the true way between their stamps."""
    turned = sum(yaw_of(inverse(a.truth.T_world_base) @ b.truth.T_world_base) for a, b in zip(driven, driven[1:], strict=False))
    imu = [sample for data in driven[1:] for sample in data.imu]
    stamps, rates = np.array([s.stamp_s for s in imu]), np.array([s.gyro[2] for s in imu])
    assert np.trapezoid(rates, stamps) == pytest.approx(turned, rel=0.03)


def test_scans_of_a_turning_robot_see_a_still_world_at_their_own_stamps():
    """With the pose at the stamp, ends of beams on a wall lie on it, whenever the scan began."""
    config = replace(IDEAL, range_sigma_m=0.0, range_sigma_far_m=0.0, veiling_probability=0.0)
    simulation = Simulation(config, load_world("rooms", 1, start=(-4.0, 0.0, 0.0)), 3)
    poses, scans = [], []
    for _ in range(40):
        data = simulation.tick(0.0, 0.6)
        poses.append((data.stamp_s, data.truth.T_world_base))
        scans += list(data.scans)
    simulation.close()
    times, yaws = np.array([t for t, _ in poses]), np.unwrap([yaw_of(T) for _, T in poses])
    places = np.array([T[:2, 3] for _, T in poses])
    ends = []
    for scan in scans[10:-6]:
        at = scan.stamp_s + 540 * 0.025 / 1440
        yaw = np.interp(at, times, yaws)
        place = [np.interp(at, times, places[:, i]) for i in (0, 1)]
        x, y = place[0] + math.cos(yaw) * (0.23 + scan.ranges[540]), place[1] + math.sin(yaw) * (0.23 + scan.ranges[540])
        ends.append((x, y))
    x = np.array(ends)[:, 0]
    on_wall = x[np.abs(x - np.median(x)) < 0.1]
    assert len(on_wall) > 20 and np.ptp(on_wall) < 2e-3


# -- the drive's deadman


def speeds(simulation, ticks, *command):
    return [abs(w.v) for _ in range(ticks) for w in simulation.tick(*command).wheel_odometry]


def test_drive_goes_on_for_a_quarter_of_a_second_without_a_command_and_then_stands():
    simulation = Simulation(IDEAL, load_world("rooms", 1, start=(-4.0, -3.0, math.pi / 2)), 1, timing=IDEAL_TIMING)
    speeds(simulation, 20, 0.4, 0.0)
    assert min(speeds(simulation, 4)) > 0.35
    stopping = speeds(simulation, 8)
    assert stopping[0] < 0.39 and stopping[-1] < 0.01
    assert min(speeds(simulation, 12, 0.4, 0.0)[8:]) > 0.35
    simulation.close()


def test_drive_stands_half_a_second_after_the_last_command():
    simulation = Simulation(SimulationConfig(), load_world("rooms", 1, start=(-4.0, -3.0, math.pi / 2)), 1)
    speeds(simulation, 30, 0.5, 0.0)
    for _ in range(8):
        data = simulation.tick()
    last = data.truth.linear[0]
    simulation.tick()
    assert abs(last) < 0.15 and abs(simulation.tick().truth.linear[0]) < 0.05
    simulation.close()
