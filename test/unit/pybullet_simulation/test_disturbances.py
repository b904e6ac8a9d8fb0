"""What somebody does to the robot: where it comes to be, what its sensors feel of it, and a script that cannot be read."""

import math

import numpy as np
import pytest

from pybullet_simulation import IDEAL, IDEAL_TIMING, KINDS, Simulation, SimulationConfig, disturbances_csv, load_world, realistic
from pybullet_simulation.disturbances import Hands, disturbances_of
from rigid_geometry import angle_difference, tilt_angle, transform_from_rpy, translation_distance, yaw_of
from robot_body import load_robot, robot_file
from simulated_movers import OpenGround


@pytest.fixture
def disturbed():
    """Makes simulations of a robot in rooms with a script, and ends them."""
    made = []

    def make(script, seed=1):
        config = realistic(SimulationConfig, "ideal", {"disturbances": script})
        made.append(Simulation(config, load_world("rooms", seed), seed, timing=IDEAL_TIMING))
        return made[-1]

    yield make
    for simulation in made:
        simulation.close()


def driven(simulation, seconds, v=0.0, w=0.0):
    """All ticks of so long a drive."""
    return [simulation.tick(v, w) for _ in range(round(20 * seconds))]


def test_lifted_robot_is_put_down_level_on_its_wheels_as_far_away_as_asked_and_with_another_heading(disturbed):
    simulation = disturbed("lift 1 2")
    before = simulation.T_world_base
    ticks = driven(simulation, 10.0)
    after = simulation.T_world_base
    assert translation_distance(before, after) == pytest.approx(2.0, abs=0.35)
    assert abs(angle_difference(yaw_of(after), yaw_of(before))) > 0.1
    assert after[2, 3] == pytest.approx(before[2, 3], abs=0.005) and tilt_angle(after) < 0.01
    assert max(data.truth.T_world_base[2, 3] for data in ticks) == pytest.approx(before[2, 3] + 0.31, abs=0.01)
    assert not [contact for data in ticks for contact in data.contacts]
    (done,) = simulation.disturbances
    assert (done.kind, done.begin_s) == ("lift", pytest.approx(1.0)) and done.moved_m == pytest.approx(
        translation_distance(before, after), abs=0.02
    )
    assert disturbances_csv(simulation.disturbances).splitlines()[1].startswith("lift,1.0")


def test_pushed_robot_comes_aside_and_its_wheels_do_not_tell(disturbed):
    simulation = disturbed("push 1 0.5")
    before = simulation.T_world_base
    ticks = driven(simulation, 3.0)
    off = before[:3, :3].T @ (simulation.T_world_base - before)[:3, 3]
    assert abs(off[1]) == pytest.approx(0.5, abs=0.06) and abs(off[0]) < 0.05
    assert max(abs(one.v) for data in ticks for one in data.wheel_odometry) < 0.02
    across = [one.accel[1] for data in ticks for one in data.imu]
    assert max(map(abs, across)) > 3.0


def test_tilted_robot_leans_as_far_as_asked_and_stands_again_where_it_was(disturbed):
    simulation = disturbed("tilt 1 20")
    before = simulation.T_world_base
    ticks = driven(simulation, 6.0)
    assert max(tilt_angle(data.truth.T_world_base) for data in ticks) == pytest.approx(math.radians(20.0), abs=0.01)
    assert translation_distance(before, simulation.T_world_base) < 0.05 and tilt_angle(simulation.T_world_base) < 0.01


def test_robot_on_ice_slides_on_though_its_wheels_stand(disturbed):
    slid = []
    for script in ("", "ice 2 4"):
        simulation = disturbed(script)
        driven(simulation, 2.5, 0.6)
        before = simulation.T_world_base
        driven(simulation, 1.0)
        slid.append(translation_distance(before, simulation.T_world_base))
    assert slid[1] > slid[0] + 0.1


def test_robot_that_nobody_touches_is_the_same_to_the_bit(disturbed):
    truth = [driven(disturbed(script), 1.0, 0.4, 0.2)[-1].truth.T_world_base for script in ("", "push 30 0.5")]
    assert np.array_equal(*truth)


@pytest.mark.parametrize("name", ["husky", "small"])
def test_hands_take_hold_of_a_robot_of_any_size(name):
    robot = load_robot(robot_file(name))
    ways = np.arange(0.0, 5.0, 0.05)
    clear = np.tile(np.minimum(ways, ways[::-1]), (len(ways), 1))  # a corridor along x
    ground = OpenGround(np.zeros_like(clear).T, clear.T, -2.5, -2.5, 0.05)
    at = {}
    for kind, amount in (("push", 9.0), ("lift", 1.5), ("tilt", 20.0)):
        hands = Hands(disturbances_of(f"{kind} 0 {amount}"), ground, robot, np.random.default_rng(1))
        hands.step(0.0, transform_from_rpy((0.0, 0.0, robot.base_height_m), (0.0, 0.0, 0.0)), 0.0)
        at[kind] = [guided.T_world_base for t in np.arange(0.0, 30.0, 0.1) if (guided := hands.guided(t)) is not None]
    assert abs(at["push"][-1][1, 3]) == pytest.approx(2.5 - robot.half_width_m - 0.15, abs=0.1)
    assert abs(at["lift"][-1][1, 3]) <= 2.5 - robot.turning_radius_m - 0.15 + 0.05
    foot = np.array([0.0, -robot.track_m / 2, -robot.base_height_m, 1.0])  # stays where it is
    assert {tuple(np.round((T @ foot)[1:3], 9)) for T in at["tilt"]} == {(-robot.track_m / 2, 0.01)}


@pytest.mark.parametrize("script", ["shove 1 2", "push 1", "lift x 2", "tilt 1 -20", "ice nan 3", "push -1 0.5"])
def test_script_that_cannot_be_read_is_named_in_one_line(script):
    (problem,) = SimulationConfig(disturbances=f"push 5 0.5, {script}").validate()
    assert repr(script) in problem and "\n" not in problem


def test_every_kind_is_read():
    assert not SimulationConfig(disturbances=", ".join(f"{kind} 4 1" for kind in KINDS)).validate()
    assert IDEAL.disturbances == ""
