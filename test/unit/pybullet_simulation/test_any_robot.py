"""Robots other than the Husky: what their URDFs say is how they stand, drive and see."""

import math
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from pybullet_simulation import IDEAL, IDEAL_TIMING, Simulation, SpinningLidarConfig, load_world
from pybullet_simulation.robot_model import read_robot_model
from pybullet_simulation.simulated_urdf import write_simulated_urdf
from pybullet_simulation.solids import box
from pybullet_simulation.world import World, joined
from rigid_geometry import tilt_angle, yaw_of
from robot_body import RobotBody, SensorMount, load_robot, robot_file, robot_names

EXACT = replace(IDEAL, slip_sigma=0.0, slip_bias_sigma=0.0)
SMALL = load_robot(robot_file("small"))
LIMIT = '<limit lower="-1" upper="3" effort="5" velocity="4"/>'


def link(name: str, shape: str = "", kg: float = 0.0, rpy: str = "0 0 0") -> str:
    inertial = (
        f'<inertial><mass value="{kg}"/><inertia ixx="{kg / 99}" ixy="0" ixz="0" iyy="{kg / 99}" iyz="0" izz="{kg / 99}"/></inertial>'
    )
    collision = f'<collision><origin rpy="{rpy}"/><geometry><{shape}/></geometry></collision>'
    return f'<link name="{name}">{inertial if kg else ""}{collision if shape else ""}</link>'


def joint(name: str, kind: str, parent: str, child: str, xyz: str = "0 0 0", rpy: str = "0 0 0", axis: str = "0 1 0") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}" rpy="{rpy}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}<axis xyz="{axis}"/>{LIMIT}</joint>'


def cart(folder: Path) -> RobotBody:
    """As drawing programs write them: a mesh of the body, frames without mass, wheels that turn about their own z, swivel casters."""
    trimesh.creation.box((0.5, 0.3, 0.1)).export(folder / "body.stl")
    parts = [link("base_footprint"), link("base_link"), joint("foot", "fixed", "base_footprint", "base_link", "0 0 0.1")]
    parts += [link("body", 'mesh filename="body.stl"', 12.0), joint("body_joint", "fixed", "base_link", "body", "-0.02 0 0.03")]
    for side, y, axis in (("left", 0.2, "0 0 1"), ("right", -0.2, "0 0 -1")):  # the right one is mounted the other way round
        parts += [link(f"{side}_wheel", 'cylinder radius="0.1" length="0.04"', 1.0)]
        parts += [joint(f"{side}_drive", "continuous", "base_link", f"{side}_wheel", f"0 {y} 0", f"{-math.pi / 2} 0 0", axis)]
        parts += [link(f"{side}_fork", kg=0.1), link(f"{side}_roll", 'cylinder radius="0.04" length="0.02"', 0.1, f"{math.pi / 2} 0 0")]
        parts += [joint(f"{side}_swivel", "continuous", "body", f"{side}_fork", f"-0.16 {y / 2} -0.05", axis="0 0 1")]
        parts += [joint(f"{side}_axle", "continuous", f"{side}_fork", f"{side}_roll", "-0.02 0 -0.04")]
    parts += [link("tilt", kg=0.1), joint("nod", "revolute", "base_link", "tilt", "0.1 0 0.4"), link("imu", kg=0.1)]
    parts += [joint("imu_joint", "fixed", "base_link", "imu"), link("laser", kg=0.1)]
    parts += [joint("laser_joint", "fixed", "tilt", "laser", "0 0 0.04", f"{math.pi} 0 0")]  # upside down
    path = folder / "cart.urdf"
    path.write_text(f'<robot name="cart">{"".join(parts)}</robot>')
    sizes = {"length_m": 0.55, "width_m": 0.44, "height_m": 0.2, "base_height_m": 0.1, "ground_clearance_m": 0.07, "wheel_radius_m": 0.1}
    wheels = {"wheel_width_m": 0.04, "track_m": 0.4, "wheelbase_m": 0.0, "effective_track_factor": 1.0, "max_step_m": 0.02}
    mounts = (SensorMount("imu", "imu"), SensorMount("laser", "laser"))
    return replace(RobotBody(), name="cart", urdf=str(path), mounts=mounts, **sizes, **wheels)


def cart_with_arm(folder: Path, kind: str) -> RobotBody:
    """An arm of 24 cm reaches forward behind a limited joint and one of a kind, and would swing down to the ground."""
    robot = cart(folder)
    arm = link("arm", 'box size="0.24 0.02 0.02"', 0.5)
    arm = arm.replace('<origin rpy="0 0 0"/>', '<origin xyz="0.12 0 0"/>').replace("<inertial>", '<inertial><origin xyz="0.12 0 0"/>')
    arm += link("shoulder", kg=0.1) + joint("pan", "revolute", "base_link", "shoulder", axis="0 0 1")
    arm += joint("lift", kind, "shoulder", "arm", "0.03 0 0.09")
    path = Path(robot.urdf)
    path.write_text(path.read_text().replace("</robot>", f"{arm}</robot>"))
    return robot


@pytest.fixture(params=["cart", *robot_names()])
def robot(request: pytest.FixtureRequest, tmp_path: Path) -> RobotBody:
    return cart(tmp_path) if request.param == "cart" else load_robot(robot_file(request.param))


def lidar_of(robot: RobotBody) -> SpinningLidarConfig | None:
    return None if read_robot_model(robot).tilts else SpinningLidarConfig()


def driven(robot: RobotBody, ticks: int, v: float, w: float, start=(-4.0, 0.0, 0.0), world: str = "rooms"):
    simulation = Simulation(EXACT, load_world(world, 1, start=start, robot=robot), 1, robot, lidar_of(robot), IDEAL_TIMING)
    data = [simulation.tick(v, w) for _ in range(ticks)]
    simulation.close()
    return data


def test_it_stands_level_at_the_height_that_its_file_says(robot: RobotBody) -> None:
    data = driven(robot, 40, 0.0, 0.0)
    T = data[-1].truth.T_world_base
    assert T[:3, 3] == pytest.approx((-4.0, 0.0, robot.base_height_m), abs=3e-3)
    assert tilt_angle(T) < 0.01 and not any(d.contacts for d in data)


@pytest.mark.parametrize("w", [0.6, -0.6])
def test_it_turns_on_the_spot_as_its_wheels_say(robot: RobotBody, w: float) -> None:
    data = driven(robot, 60, 0.0, w)
    T, by_wheels = data[-1].truth.T_world_base, sum(o.w for d in data for o in d.wheel_odometry) * 0.05
    assert yaw_of(T) == pytest.approx(by_wheels, rel=0.05) and by_wheels == pytest.approx(3.0 * w, rel=0.05)
    assert np.hypot(*(T[:2, 3] - (-4.0, 0.0))) < 0.1 and not any(d.contacts for d in data)


@pytest.mark.parametrize("v", [0.4, -0.4])
def test_it_drives_straight_as_its_wheels_say(robot: RobotBody, v: float) -> None:
    data = driven(robot, 60, v, 0.0, (-4.0, 0.0, math.pi / 2))
    x, y = data[-1].truth.T_world_base[:2, 3]
    assert y == pytest.approx(sum(o.v for d in data for o in d.wheel_odometry) * 0.05, rel=0.05)
    assert y == pytest.approx(3.0 * v, rel=0.1) and x == pytest.approx(-4.0, abs=0.1)
    assert not any(d.contacts for d in data)


@pytest.mark.parametrize("kind", ["revolute", "continuous"])
def test_arm_stays_where_its_joint_is_at_zero(tmp_path: Path, kind: str) -> None:
    data = driven(cart_with_arm(tmp_path, kind), 60, 0.2, 0.0)
    assert not [c.link for d in data for c in d.contacts]


def test_caster_that_runs_into_a_wall_is_a_touch() -> None:
    contacts = [c for d in driven(SMALL, 60, -0.5, 0.0, (-4.0, -3.0, math.pi / 2)) for c in d.contacts]
    assert {"base_link"} <= {c.link for c in contacts}


def test_small_robot_climbs_its_slope_and_comes_down_without_a_touch() -> None:
    up = driven(SMALL, 480, 0.5, 0.0, (-8.0, 1.0, 0.0), "ramp")
    assert up[-1].truth.T_world_base[2, 3] == pytest.approx(2.3 + SMALL.base_height_m, abs=0.01)
    assert not any(d.contacts for d in up)


@pytest.mark.parametrize("v", [0.25, -0.25])
def test_small_robot_climbs_its_highest_step_either_way_with_its_caster(v: float) -> None:
    step_m = SMALL.max_step_m
    solids = [box("ground", (-5.0, -5.0, -0.5), (5.0, 5.0, 0.0)), box("front", (0.5, -5.0, -0.1), (5.0, 5.0, step_m))]
    solids.append(box("rear", (-5.0, -5.0, -0.1), (-0.5, 5.0, step_m)))
    vertices, triangles = joined(solids)
    extent = np.array([vertices.min(axis=0), vertices.max(axis=0)])
    world = World("steps", tuple(solids), (), vertices, triangles, extent, (0.0, 0.0, 0.0), 0.0)
    simulation = Simulation(EXACT, world, 1, SMALL, timing=IDEAL_TIMING)
    data = [simulation.tick(v, 0.0) for _ in range(160)]
    simulation.close()
    assert abs(data[-1].truth.T_world_base[0, 3]) > 1.5 and not any(d.contacts for d in data)
    assert data[-1].truth.T_world_base[2, 3] == pytest.approx(SMALL.base_height_m + step_m, abs=2e-3)


def test_joint_states_name_the_robot_s_own_joints_and_turn_as_they_do(tmp_path: Path) -> None:
    sample = driven(cart(tmp_path), 40, 0.4, 0.0, (-4.0, 0.0, math.pi / 2))[-1].joints[-1]
    assert sample.names == ("nod", "left_drive", "right_drive")
    assert sample.positions[1] > 1.0 and sample.positions[2] == pytest.approx(-sample.positions[1], rel=0.05)


def test_laser_that_is_mounted_upside_down_sees_left_on_its_right(tmp_path: Path) -> None:
    beside = {}
    for robot in (SMALL, cart(tmp_path)):  # a wall 1 m to the right
        scan = driven(robot, 3, 0.0, 0.0, (-4.0, -3.0, 0.0))[-1].scans[-1]
        beside[robot.name] = scan.ranges[[180, 900]]  # 90 degrees to the right, and to the left
    assert (beside["small"][0] < beside["small"][1]) != (beside["cart"][0] < beside["cart"][1])


def test_what_tilts_and_what_does_not_is_told_by_the_joints(tmp_path: Path) -> None:
    model = read_robot_model(cart(tmp_path))
    assert model.tilt_joint == "nod" and [w.forward for w in model.wheels] == [1.0, -1.0]
    assert model.T_tilt_laser[:3, 3] == pytest.approx((0.0, 0.0, 0.04)) and model.T_base_mount[:3, 3] == pytest.approx((0.1, 0.0, 0.4))
    assert {c.link for c in model.casters} == {"left_roll", "right_roll"}
    size = np.ptp(model.body.vertices, axis=0)
    assert size[:2] == pytest.approx((0.5, 0.44), abs=1e-3)


def test_battery_that_names_only_its_mass_keeps_it_with_the_inertia_of_its_box(tmp_path: Path) -> None:
    robot = cart(tmp_path)
    mass = '<inertial><origin rpy="1 0 0"/><mass value="12"/></inertial>'
    parts = link("battery", 'box size="0.3 0.2 0.1"').replace("<collision>", f"{mass}<collision>")
    parts += f'<link name="ballast">{mass}</link>' + joint("b", "fixed", "body", "ballast") + joint("a", "fixed", "body", "battery")
    Path(robot.urdf).write_text(Path(robot.urdf).read_text().replace("</robot>", f"{parts}</robot>"))
    written = ElementTree.parse(write_simulated_urdf(Path(robot.urdf), tmp_path, "nod"))
    box, ball = (written.find(f"link[@name='{name}']/inertial") for name in ("battery", "ballast"))
    assert box.find("mass").get("value") == "12" and box.find("origin").get("rpy") is None
    assert [float(box.find("inertia").get(axis)) for axis in ("ixx", "iyy", "izz")] == pytest.approx([0.05, 0.10, 0.13])
    radius_m = (3 * 12 / (4 * math.pi * 1000)) ** (1 / 3)
    assert float(ball.find("inertia").get("ixx")) == pytest.approx(0.4 * 12 * radius_m**2, rel=1e-4)
