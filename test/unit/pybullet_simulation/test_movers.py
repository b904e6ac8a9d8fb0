"""Movers in the simulated world: seen by every sensor where they are, judged when touched, and absent when nobody asked for them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pybullet_simulation import IDEAL, IDEAL_TIMING, ScanGeometry, Simulation, SimulationConfig, SpinningLidarConfig, load_world
from pybullet_simulation.open_ground import open_ground
from simulated_movers import MoverSpec, drawn_movers

START = (-4.0, -2.6, math.pi / 2)  # in the corridor, which is empty, looking along it
EXACT = replace(IDEAL, range_sigma_m=0.0, range_sigma_far_m=0.0, veiling_probability=0.0)


@pytest.fixture
def simulate():
    """Makes simulations of `rooms` with movers, and ends them."""
    made = []

    def make(*movers, config=EXACT, lidar=None, start=START, seed=1):
        world = replace(load_world("rooms", seed, start=start), movers=movers)
        made.append(Simulation(config, world, seed, lidar=lidar, timing=IDEAL_TIMING))
        return made[-1]

    yield make
    for simulation in made:
        simulation.close()


def standing(x, y):
    return MoverSpec(name="Ann", start=(x, y), walk="path", path=(x, y, x, y + 0.01), pause_s=600.0)


def test_laser_sees_a_person_who_is_not_there_without_one(simulate):
    ahead = np.flatnonzero(np.abs(ScanGeometry().angles) < 0.02)
    alone, with_person = (simulate(*movers).tick(0.0).scans[0].ranges[ahead] for movers in ((), (standing(-4.0, -0.6),)))
    assert with_person == pytest.approx(2.0 - 0.23 - 0.18, abs=0.02) and (alone > with_person + 0.5).all()


def test_spinning_lidar_sees_a_person(simulate):
    simulation = simulate(standing(-4.0, -0.6), lidar=SpinningLidarConfig())
    revolution = next(r for _ in range(8) for r in simulation.tick(0.0).revolutions)
    near_axis = np.abs(revolution.points[:, 1]) < 0.05
    ahead = revolution.points[near_axis & (revolution.points[:, 0] > 0.0)]
    assert ahead[:, 0].min() == pytest.approx(2.0 - 0.23 - 0.18, abs=0.1) or ahead[:, 0].min() < 1.7


def test_walking_person_is_seen_where_it_is_at_the_time_of_each_beam(simulate):
    """It comes towards the robot at 1 m/s: what two scans of a tick show differs by half a tick's way."""
    simulation = simulate(MoverSpec(walk="path", path=(-4.0, 2.5, -4.0, -0.6), start=(-4.0, 2.5), pause_s=0.0))
    ranges = [scan.ranges[540] for _ in range(30) for scan in simulation.tick(0.0).scans]
    steps = np.diff([r for r in ranges if r < 4.6][4:])
    assert np.median(steps) == pytest.approx(-0.025, abs=2e-3)


def test_robot_that_drives_into_a_person_touches_it_at_its_speed(simulate):
    simulation = simulate(standing(-4.0, -1.0))
    contacts = [c for _ in range(60) for c in simulation.tick(0.5).contacts]
    assert contacts and {c.other for c in contacts} == {"Ann"} and max(c.speed_mps for c in contacts) == pytest.approx(0.5, abs=0.06)


def test_robot_that_turns_into_a_person_moves_where_it_touches(simulate):
    simulation = simulate(standing(-3.56, -2.6), start=(-4.2, -2.6, math.pi / 2))
    contacts = [c for _ in range(80) for c in simulation.tick(0.0, 1.0).contacts if c.other]
    assert contacts and contacts[0].speed_mps > 0.2


def test_robot_that_stands_is_touched_by_nobody(simulate):
    simulation = simulate(*drawn_movers(5, 1))
    assert not [c for _ in range(1200) for c in simulation.tick(0.0).contacts]


def test_same_seed_with_movers_gives_the_same_data_bit_for_bit(simulate):
    def run():
        simulation = simulate(*drawn_movers(3, 2), config=SimulationConfig(), start=None, seed=2)
        return [simulation.tick(0.2, 0.3) for _ in range(100)]

    for a, b in zip(run(), run(), strict=True):
        assert all(np.array_equal(s.ranges, t.ranges) for s, t in zip(a.scans, b.scans, strict=True)) and a.contacts == b.contacts
        assert np.array_equal(a.truth.T_world_base, b.truth.T_world_base)


def test_movers_do_not_change_the_robot_s_own_randomness(simulate):
    """Nothing near it: the IMU says the same, bit for bit."""
    runs = []
    for movers in ((), drawn_movers(2, 1)):
        simulation = simulate(*movers, config=SimulationConfig())
        runs.append([one.gyro for _ in range(40) for one in simulation.tick(0.0).imu])
    assert np.array_equal(*runs)


@pytest.mark.parametrize(("x", "y"), [(-3.0, 0.0), (0.0, 4.5), (-3.0, 20.0)])
def test_mover_in_a_wall_is_one_clear_line(simulate, x, y):
    with pytest.raises(ValueError, match=f"mover Ann cannot start at x {x:g} y {y:g}: it is inside") as error:
        simulate(MoverSpec(name="Ann", start=(x, y)))
    assert "\n" not in str(error.value)


def test_open_ground_of_rooms_is_both_rooms_and_the_corridor_without_walls_and_clutter():
    ground = open_ground(load_world("rooms", 1))
    for x, y, is_open in ((-4.0, 0.0, True), (-3.0, 2.1, True), (-3.0, 0.0, False), (3.1, 0.0, True), (-6.0, 0.0, False)):
        assert bool(ground.clear_at(np.array([[x, y]]))[0] > 0.25) is is_open
    assert ground.clear_at(np.array([[-4.0, 0.0]]))[0] == pytest.approx(0.925, abs=0.08)
    assert ground.height_at(np.array([-4.0, 0.0])) == pytest.approx(0.0, abs=1e-5)


def test_open_ground_of_ramp_leads_up_its_ramps_and_not_over_its_edges():
    ground = open_ground(load_world("ramp", 1))
    heights = ground.height[np.isfinite(ground.height)]
    assert heights.max() > 1.8 and math.isclose(heights.min(), 0.0, abs_tol=0.1)
    walked = np.where(ground.clear_m >= 0.2, ground.height, np.nan)
    assert np.nanmax(walked) > 1.5 and np.nanmax(np.abs(np.diff(walked, axis=0))) <= 0.06 >= np.nanmax(np.abs(np.diff(walked, axis=1)))
