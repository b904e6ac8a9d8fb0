"""The whole simulation: what a drive, a sweep, a fall and a collision look like from outside."""

import math

import numpy as np
import pytest

from pybullet_simulation import IDEAL, IDEAL_TIMING, Simulation, SimulationConfig, load_world
from pybullet_simulation.solids import box, walls_around
from pybullet_simulation.world import World, joined
from rigid_geometry import angle_difference, inverse, tilt_angle, yaw_of

CONFIG = SimulationConfig()


@pytest.fixture
def simulate():
    """Makes simulations, and ends them."""
    made = []

    def make(name="rooms", seed=1, config=CONFIG, start=None, timing=None):
        made.append(Simulation(config, load_world(name, seed, start=start), seed, timing=timing))
        return made[-1]

    yield make
    for simulation in made:
        simulation.close()


def drive(simulation, ticks, v, w):
    return [simulation.tick(v, w) for _ in range(ticks)]


def test_first_tick_of_an_ideal_robot_ends_at_one_second_with_even_stamps(simulate):
    simulation = simulate(config=IDEAL, timing=IDEAL_TIMING)
    assert simulation.stamp_s == 0.95
    data = simulation.tick(0.0, 0.0)
    assert data.stamp_s == simulation.stamp_s == data.truth.stamp_s == 1.0
    assert [s.stamp_s for s in data.scans] == [0.95, 0.975]
    assert [j.stamp_s for j in data.joints] == [0.975, 1.0]
    assert [i.stamp_s for i in data.imu] == [0.96, 0.97, 0.98, 0.99, 1.0]
    assert [w.stamp_s for w in data.wheel_odometry] == [1.0]
    assert all(s.ranges.shape == (1081,) and s.ranges.dtype == np.float32 for s in data.scans)


def test_robot_stands_at_the_start_and_stays_there(simulate):
    simulation = simulate()
    x, y, yaw = load_world("rooms", 1).start_xyyaw
    drive(simulation, 100, 0.0, 0.0)
    T = simulation.T_world_base
    assert T[:3, 3] == pytest.approx((x, y, 0.132), abs=2e-3) and yaw_of(T) == pytest.approx(yaw, abs=1e-3)


def test_same_seed_and_commands_give_the_same_data_bit_for_bit(simulate):
    runs = []
    for _ in range(2):
        simulation = simulate("ramp", 2)
        simulation.start_sweep()
        runs.append(drive(simulation, 60, 0.3, 0.4))
    for a, b in zip(*runs, strict=True):
        assert all(np.array_equal(s.ranges, t.ranges) for s, t in zip(a.scans, b.scans, strict=True))
        assert a.joints == b.joints and a.wheel_odometry == b.wheel_odometry and a.contacts == b.contacts
        assert all(np.array_equal(s.accel, t.accel) and np.array_equal(s.gyro, t.gyro) for s, t in zip(a.imu, b.imu, strict=True))
        assert np.array_equal(a.truth.T_world_base, b.truth.T_world_base)


def test_mount_that_is_off_shows_in_the_ranges_and_nowhere_else(simulate):
    runs = []
    for config in (CONFIG, SimulationConfig(mount_tilt_scale=1.005, mount_roll_rad=0.0035)):
        simulation = simulate("ramp", 2, config)
        simulation.start_sweep()
        runs.append(drive(simulation, 40, 0.0, 0.0))
    for good, off in zip(*runs, strict=True):
        assert good.joints == off.joints and good.wheel_odometry == off.wheel_odometry
        assert all(np.array_equal(s.accel, t.accel) and np.array_equal(s.gyro, t.gyro) for s, t in zip(good.imu, off.imu, strict=True))
        assert np.array_equal(good.truth.T_world_base, off.truth.T_world_base)
    assert all(
        not np.array_equal(s.ranges, t.ranges) for good, off in zip(*runs, strict=True) for s, t in zip(good.scans, off.scans, strict=True)
    )


def test_two_simulations_at_once_do_not_disturb_each_other(simulate):
    alone = simulate()
    expected = drive(alone, 10, 0.3, 0.1)[-1].truth.T_world_base
    one, other = simulate(), simulate("moon", 2)
    for _ in range(10):
        data = one.tick(0.3, 0.1)
        other.tick(-0.3, 0.5)
    assert np.array_equal(data.truth.T_world_base, expected)


def test_wheel_odometry_and_truth_agree_but_for_slip(simulate):
    simulation = simulate("rooms", 1, start=(-4.0, -3.0, math.pi / 2))
    T_start = simulation.T_world_base
    data = drive(simulation, 120, 0.5, 0.0)
    measured = sum(w.v for d in data for w in d.wheel_odometry) * 0.05
    moved = (inverse(T_start) @ data[-1].truth.T_world_base)[0, 3]
    assert measured == pytest.approx(moved, rel=0.06) and measured != pytest.approx(moved, rel=1e-4)
    assert not any(d.contacts for d in data)


def test_turns_on_the_spot_are_as_commanded_in_both_directions(simulate):
    config = SimulationConfig(slip_sigma=0.0, slip_bias_sigma=0.0)
    turned = {}
    for w in (0.6, -0.6):
        simulation = simulate("rooms", 1, config, start=(-4.0, 0.0, 0.0))
        data = drive(simulation, 60, 0.0, w)
        turned[w] = angle_difference(yaw_of(data[-1].truth.T_world_base), 0.0)
        assert np.hypot(*(data[-1].truth.T_world_base[:2, 3] - (-4.0, 0.0))) < 0.15
    assert turned[0.6] == pytest.approx(1.8, rel=0.1) and turned[-0.6] == pytest.approx(-turned[0.6], rel=0.05)


def test_sweep_ends_level_within_its_time_and_a_second_one_meanwhile_is_refused(simulate):
    simulation = simulate()
    assert simulation.sweep_left_s == 0.0
    simulation.start_sweep()
    assert simulation.sweep_left_s == pytest.approx(simulation._profile.duration_s)
    with pytest.raises(ValueError, match="a sweep is running"):
        simulation.start_sweep()
    data, points = [], 0
    while simulation.sweeping:
        data.append(simulation.tick(0.0, 0.0))
        points += sum(int(np.isfinite(s.ranges).sum()) for s in data[-1].scans)
    assert len(data) == math.ceil(simulation._profile.duration_s / 0.05) and 130_000 < points < 260_000
    tilt = [joint.positions[0] for d in data for joint in d.joints]
    assert max(tilt) > 2.8 and min(tilt) < -0.55 and abs(tilt[-1]) < 1e-3
    assert data[-1].joints[-1].velocities[0] == 0.0 and not data[-1].sweeping and simulation.sweep_left_s == 0.0


def test_robot_climbs_the_big_ramp_onto_the_plateau_without_a_touch(simulate):
    simulation = simulate("ramp", 1, SimulationConfig(slip_sigma=0.0, slip_bias_sigma=0.0), start=(-8.0, 1.0, 0.0))
    data = drive(simulation, 480, 0.5, 0.0)
    assert data[-1].truth.T_world_base[2, 3] == pytest.approx(2.3 + 0.132, abs=0.01)
    assert not any(d.contacts for d in data)
    assert max(tilt_angle(d.truth.T_world_base) for d in data) == pytest.approx(math.radians(15.0), abs=0.03)


def test_robot_that_stops_on_the_ramp_does_not_creep(simulate):
    simulation = simulate("ramp", 1, start=(-8.0, 1.0, 0.0))
    drive(simulation, 160, 0.5, 0.0)
    stopped = drive(simulation, 20, 0.0, 0.0)[-1].truth.T_world_base
    later = drive(simulation, 100, 0.0, 0.0)[-1].truth.T_world_base
    assert tilt_angle(later) > 0.2 and np.linalg.norm(later[:3, 3] - stopped[:3, 3]) < 2e-3


def test_drive_into_a_wall_is_a_contact_with_speed_and_force(simulate):
    simulation = simulate("rooms", 1, start=(-4.0, 0.0, math.pi))
    contacts = [c for d in drive(simulation, 40, 0.5, 0.0) for c in d.contacts]
    assert contacts and contacts[0].link == "base_link" and contacts[0].force_n > 10.0
    assert contacts[0].speed_mps == pytest.approx(0.5, abs=0.15)


def plate(height_m):
    """A room with a plate of a height on its floor, whose long edge lies along y."""
    low, high = np.array([-4.0, -3.0]), np.array([4.0, 3.0])
    solids = [
        box("floor", (*low, -0.2), (*high, 0.0)),
        *walls_around(low, high, -0.1, 1.0),
        box("plate", (0.0, -2.0, 0.0), (2.0, 2.0, height_m)),
    ]
    vertices, triangles = joined(solids)
    return World("plate", tuple(solids), (), vertices, triangles, np.array([vertices.min(0), vertices.max(0)]), (-0.46, 0.0, 0.0), 0.0)


@pytest.mark.parametrize(("height_m", "touches"), [(0.025, False), (0.09, False), (0.12, True)])
def test_riser_that_a_turning_wheel_meets_is_a_touch_where_it_is_higher_than_a_step(height_m, touches):
    """The corner of the wheel meets the upright face below its edge, as that of a threshold."""
    simulation = Simulation(CONFIG, plate(height_m), 1)
    data = drive(simulation, 60, 0.0, 0.5)
    met = any(c.link.endswith("wheel_link") for d in data for c in d.contacts)
    simulation.close()
    assert met == touches


def test_drive_off_the_side_of_the_ramp_is_a_fall_that_shows(simulate):
    simulation = simulate("ramp", 1, start=(-8.0, 1.0, 0.0))
    data = drive(simulation, 240, 0.5, 0.0) + drive(simulation, 120, 0.5, 0.3)
    assert max(tilt_angle(d.truth.T_world_base) for d in data) > math.radians(60.0)
    assert any(c.link == "base_link" for d in data for c in d.contacts)


def test_terrain_of_triangles_is_driven_without_shocks_or_false_contacts(simulate):
    simulation = simulate("moon", 1)
    data = drive(simulation, 100, 0.4, 0.0)
    assert not any(d.contacts for d in data)
    heights = np.array([d.truth.T_world_base[2, 3] for d in data])
    assert np.abs(np.diff(heights, 2)).max() < 0.006


def test_twist_of_the_truth_is_the_derivative_of_its_pose(simulate):
    simulation = simulate("rooms", 1, start=(-4.0, -2.0, math.pi / 2))
    data = drive(simulation, 60, 0.4, 0.2)
    step = inverse(data[-2].truth.T_world_base) @ data[-1].truth.T_world_base
    mean = (data[-2].truth.linear + data[-1].truth.linear) / 2
    assert step[:2, 3] / 0.05 == pytest.approx(mean[:2], abs=0.03)
    assert yaw_of(step) / 0.05 == pytest.approx(data[-1].truth.angular[2], abs=0.05)


def test_command_that_is_not_finite_is_refused(simulate):
    with pytest.raises(ValueError, match="not finite"):
        simulate().tick(math.inf, 0.0)


def test_nothing_is_printed(simulate, capfd):
    drive(simulate(), 2, 0.1, 0.0)
    assert capfd.readouterr() == ("", "")
