"""Which robots can be simulated by their description; what keeps one from it is told in one line."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
import trimesh.exchange.dae

from rigid_geometry import transform_from_rpy
from robot_body import (
    RobotBody,
    casters,
    description_remarks,
    driven_wheels,
    load_robot,
    read_description,
    robot_file,
    robot_names,
    urdf_file,
)
from robot_body import simulation_problems as problems_of

SMALL = load_robot(robot_file("small"))
URDF = urdf_file(SMALL).read_text(encoding="utf-8")
HUSKY_URDF = urdf_file(RobotBody()).read_text(encoding="utf-8")
BALL = '<visual><geometry><sphere radius="0.05"/></geometry><material name="grey"/></visual>'


def between(text: str, begin: str, end: str) -> str:
    """The part of a text from `begin` to the next `end`, both included."""
    return text[text.index(begin) : text.index(end, text.index(begin)) + len(end)]


def without(part: str, text: str = URDF) -> str:
    assert part in text
    return text.replace(part, "")


def changed(old: str, new: str, text: str = URDF) -> str:
    assert old in text
    return text.replace(old, new)


LEFT_WHEEL = between(URDF, '<link name="left_wheel">', "</link>")
LEFT_JOINT = between(URDF, '<joint name="left_wheel_joint"', "</joint>")
BODY = between(between(URDF, '<link name="base_link">', "</link>"), "<inertial>", "</inertial>")
AXLE_AHEAD = URDF.replace('xyz="0 0.155 0"', 'xyz="0.08 0.155 0"').replace('xyz="0 -0.155 0"', 'xyz="0.08 -0.155 0"')
XACRO = '<xacro:wheel xmlns:xacro="http://www.ros.org/wiki/xacro"/>'
BODY_OF_HUSKY = between(between(HUSKY_URDF, '<link name="base_link">', "</link>"), "<inertial>", "</inertial>")
OF_HUSKY = between(HUSKY_URDF, '<joint name="rear_left_wheel"', "</joint>")
TILT = between(URDF, '<joint name="tilt_joint"', "</joint>")
IMU = between(URDF, '<joint name="imu_joint"', "</joint>")
CASTER_JOINT = between(URDF, '<joint name="caster_joint"', "</joint>")
CASTER = CASTER_JOINT + "\n  " + between(URDF, '<link name="caster">', "</link>")


@pytest.mark.parametrize("name", robot_names())
def test_every_robot_of_the_project_can_be_simulated(name: str) -> None:
    robot = load_robot(robot_file(name))
    assert robot.name == name
    urdf = urdf_file(robot)
    assert problems_of(robot, urdf.read_text(encoding="utf-8"), urdf.parent) == []
    assert description_remarks(robot, urdf.read_text(encoding="utf-8"), urdf.parent) == []


@pytest.mark.parametrize(
    ("robot", "text", "said"),
    [
        (SMALL, without(between(LEFT_WHEEL, "<inertial>", "</inertial>")), "above 0 is missing in left_wheel, right_wheel"),
        (SMALL, without('<mass value="0.8"/>'), "an inertial with a mass above 0 is missing in left_wheel, right_wheel"),
        (
            SMALL,
            changed(BALL, '<collision><geometry><mesh filename="ball.stl"/></geometry></collision>'),
            "mesh of a collision shape of caster",
        ),
        (SMALL, changed("0 0.155 0", "0 0.155 0.02"), "left_wheel is 0.02 m above the ground"),
        (SMALL, changed("0 0.155 0", "0 0.175 0"), "track_m = 0.31, and the URDF has 0.33"),
        (replace(SMALL, track_m=0.30, width_m=0.36), URDF, "track_m = 0.3, and the URDF has 0.31"),
        (replace(SMALL, base_height_m=0.12), URDF, "base_height_m = 0.12, and the URDF has 0.1"),
        (SMALL, without(LEFT_JOINT), "no joint leads from base_link to left_wheel"),
        (SMALL, without(LEFT_WHEEL), "joint left_wheel_joint: the URDF has no link left_wheel"),
        (SMALL, without(LEFT_JOINT, without(LEFT_WHEEL)), "0 wheels on the left and 1 on the right"),
        (SMALL, changed('name="left_wheel_joint" type="continuous"', 'name="left_wheel_joint" type="fixed"'), "0 wheels on the left"),
        (RobotBody(), without(OF_HUSKY, HUSKY_URDF), "no joint leads from base_link to rear_left_wheel_link"),
        (SMALL, without(CASTER), "which the wheels and casters do not surround: it falls over"),
        (SMALL, changed('"laser"', '"lidar"'), "mounts/laser: the URDF has no frame laser"),
        (SMALL, changed('"imu_link"', '"imu"'), "mounts/imu: the URDF has no frame imu_link"),
        (SMALL, changed('"base_link"', '"base"'), "the URDF has no link base_link"),
        (SMALL, changed("<sphere", "<capsule"), "a collision shape is capsule, expected one of box, cylinder, sphere, mesh"),
        (SMALL, without(between(URDF, "<limit ", "/>")), "joint tilt_joint is revolute and has no limit"),
        (SMALL, changed('upper="3.1"', 'upper="0.1"'), "joint tilt_joint tilts from -0.8 to 0.1 rad: it must reach 0, and 0.2 down"),
        (SMALL, changed('lower="-0.8"', 'lower="0.3"'), "joint tilt_joint tilts from 0.3 to 3.1 rad"),
        (SMALL, changed(TILT, TILT.replace('xyz="0 1 0"', 'xyz="0 -1 0"')), "joint tilt_joint turns about 0 -1 0: only one joint"),
        (SMALL, changed(IMU, IMU.replace('"base_link"', '"left_wheel"')), "imu_link moves with joint left_wheel_joint"),
        (SMALL, changed('mass value="11.0"', 'mass value="-11"'), "link base_link: mass and inertia are -11 0.075 0.16 0.21"),
        (SMALL, changed('izz="0.21"', 'izz="nan"'), "link base_link: mass and inertia are 11.0 0.075 0.16 nan"),
        (SMALL, changed("</robot>", '<link name="mast"/></robot>'), "the URDF has more than one link mast"),
        (SMALL, changed('name="mast_joint"', 'name="tilt_joint"'), "the URDF has more than one joint tilt_joint"),
        (SMALL, changed("</robot>", CASTER_JOINT.replace("caster_joint", "other") + "</robot>"), "more than one joint to link caster"),
        (SMALL, URDF[:500], "cannot be read"),
        (SMALL, without(BODY), "base_link weighs 0.65 kg"),
        (SMALL, changed('mass value="11.0"', 'mass value="11000000"'), "base_link weighs 1.1e+07 kg"),
        (RobotBody(), without(BODY_OF_HUSKY, HUSKY_URDF), "12.5 kg for each m3 of its shapes: an inertial is missing there"),
        (SMALL, AXLE_AHEAD, "wheels is at x 0.08 y 0 in"),
        (SMALL, changed('size="', 'size="-', URDF), "link base_link: a collision box is -"),
        (SMALL, changed('<sphere radius="0.05"/>', "<sphere/>"), "link caster: a collision sphere has no radius"),
        (SMALL, changed('xyz="0 0.155 0"', 'xyz="0 0.155"'), "joint left_wheel_joint: '0 0.155' is not three numbers"),
        (SMALL, changed('xyz="0 0.155 0"', 'xyz="0 0.155 nan"'), "joint left_wheel_joint: '0 0.155 nan' is not three numbers"),
        (SMALL, changed("</robot>", XACRO + "</robot>"), "it is a xacro: make a URDF of it with xacro FILE"),
    ],
    ids=lambda value: value if isinstance(value, str) and len(value) < 90 else "",
)
def test_robot_that_cannot_be_simulated_is_told_in_one_line(robot: RobotBody, text: str, said: str, tmp_path: Path) -> None:
    found = problems_of(robot, text, tmp_path)
    assert sum(said in line for line in found) == 1, found
    assert all("\n" not in line for line in found)


JACKAL = load_robot(robot_file("jackal"))
JACKAL_URDF = urdf_file(JACKAL).read_text(encoding="utf-8")
ABOVE = '<origin xyz="0 0 0.1525"/>'  # of the lidar over the foot of its mast


def test_lidar_looks_out_of_its_housing_and_not_out_of_the_body(tmp_path: Path) -> None:
    sealed = '<collision><origin xyz="0 0 0.15"/><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'
    mast = between(JACKAL_URDF, '<link name="tower">', "</link>")
    housed = changed(mast, mast.replace("</link>", sealed + "</link>"), JACKAL_URDF)  # as velodyne_description has it
    assert problems_of(JACKAL, housed, tmp_path) == []
    assert read_description(housed).housing("laser") == {"tower", "laser"}
    frame = changed('<parent link="tower"/>', '<parent link="base_link"/>', housed)
    found = problems_of(JACKAL, changed(ABOVE, '<origin xyz="0 0 0.33"/>', frame), tmp_path)
    assert found == ["mounts/laser: laser lies inside a collision shape of tower, and would see nothing else"]


def test_laser_in_the_middle_of_the_body_sees_nothing() -> None:
    inside = replace(SMALL, mounts=(replace(SMALL.mount("laser"), frame="base_link"), SMALL.mount("imu")))
    found = problems_of(inside, URDF, Path("/"))
    assert found == ["mounts/laser: base_link lies inside a collision shape of base_link, and would see nothing else"]


@pytest.mark.parametrize("shape", ["box", "cylinder", "sphere", "mesh"])
def test_shape_holds_what_is_inside_wherever_it_stands(shape: str, tmp_path: Path) -> None:
    trimesh.creation.box((0.2, 0.2, 0.2)).export(tmp_path / "box.stl")
    sizes = {"box": 'size="0.2 0.2 0.2"', "cylinder": 'radius="0.1" length="0.2"', "sphere": 'radius="0.1"', "mesh": 'filename="box.stl"'}
    collision = f'<collision><origin xyz="1 0 0" rpy="0 0 1"/><geometry><{shape} {sizes[shape]}/></geometry></collision>'
    text = f'<robot name="r"><link name="base_link">{collision}</link></robot>'
    (found,) = read_description(text, tmp_path).shapes["base_link"]
    T = transform_from_rpy((0.0, 0.0, 0.5), (0.0, 0.0, 0.0))
    assert found.holds(T, np.array([1.0, 0.03, 0.58]))
    assert not any(found.holds(T, np.array(place)) for place in ((1.0, 0.03, 0.62), (1.16, 0.0, 0.5), (0.0, 0.0, 0.5)))


def test_mesh_has_the_unit_that_its_file_names_but_not_its_upward_axis(tmp_path: Path) -> None:
    text = trimesh.exchange.dae.export_collada(trimesh.creation.box((200.0, 400.0, 600.0))).decode()
    start, end = text.index("<asset>"), text.index("</asset>")
    (tmp_path / "box.dae").write_text(text[:start] + '<asset><unit name="mm" meter="0.001"/><up_axis>Y_UP</up_axis>' + text[end:])
    collision = '<collision><geometry><mesh filename="box.dae" scale="1 1 2"/></geometry></collision>'
    found = read_description(f'<robot name="r"><link name="base_link">{collision}</link></robot>', tmp_path)
    low, high = found.reach("base_link") or (np.zeros(3), np.zeros(3))
    assert high - low == pytest.approx((0.2, 0.4, 1.2))


def test_missing_mesh_of_a_picture_keeps_nobody_from_driving(tmp_path: Path) -> None:
    text = changed(BALL, '<visual><geometry><mesh filename="package://mine/ball.dae"/></geometry></visual>')
    assert problems_of(SMALL, text, tmp_path) == []
    assert description_remarks(SMALL, text, tmp_path) == [
        "package://mine/ball.dae is missing: rviz will not show it, and nothing else needs it"
    ]


def test_mesh_is_found_beside_the_description_and_in_its_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine" / "meshes").mkdir(parents=True)
    (tmp_path / "mine" / "urdf").mkdir()
    (tmp_path / "mine" / "meshes" / "ball.dae").touch()
    text = changed(BALL, '<visual><geometry><mesh filename="package://mine/meshes/ball.dae"/></geometry></visual>')
    assert description_remarks(SMALL, text, tmp_path / "mine" / "urdf") == []
    assert description_remarks(SMALL, text, Path("/")) != []
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path))
    assert description_remarks(SMALL, text, Path("/")) == []


def test_mesh_of_another_package_is_not_taken_for_the_same_path_here(tmp_path: Path) -> None:
    (tmp_path / "mine" / "meshes").mkdir(parents=True)
    (tmp_path / "mine" / "meshes" / "ball.dae").touch()
    text = changed(BALL, '<visual><geometry><mesh filename="package://yours/meshes/ball.dae"/></geometry></visual>')
    assert len(description_remarks(SMALL, text, tmp_path / "mine")) == 1


def test_wheels_are_what_turns_about_y_whatever_their_own_axes() -> None:
    turned = changed(
        '<origin xyz="0 0.155 0"/>\n    <axis xyz="0 1 0"/>', '<origin xyz="0 0.155 0" rpy="-1.5707963 0 0"/>\n    <axis xyz="0 0 1"/>'
    )
    backwards = changed('<origin xyz="0 0.155 0"/>\n    <axis xyz="0 1 0"/>', '<origin xyz="0 0.155 0"/>\n    <axis xyz="0 -1 0"/>')
    turned = turned.replace(LEFT_WHEEL, LEFT_WHEEL.replace('<origin rpy="1.5707963267948966 0 0"/>', ""))
    for text, forward in ((turned, 1.0), (backwards, -1.0)):
        left, right = driven_wheels(read_description(text))
        assert (left.joint, left.is_left, left.forward) == ("left_wheel_joint", True, forward) and right.forward == 1.0
        assert (left.radius_m, left.width_m) == pytest.approx((0.1, 0.04))
        assert problems_of(SMALL, text, Path("/")) == []


def test_ball_that_is_off_the_ground_is_no_caster_but_a_belly() -> None:
    assert [caster.link for caster in casters(read_description(URDF))] == ["caster"]
    high = changed('<origin xyz="-0.15 0 -0.05"/>', '<origin xyz="-0.15 0 -0.04"/>')
    assert casters(read_description(high)) == []
    assert any("ground_clearance_m = 0.05, and the URDF has 0.01" in line for line in problems_of(SMALL, high, Path("/")))


def behind_a_joint(kind: str, axis: str) -> str:
    """The small robot, with its left wheel behind another joint where the wheel's was."""
    unit = '<inertial><mass value="0.1"/><inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial>'
    limit = '<limit lower="-0.15" upper="0.15" effort="1" velocity="1"/>'
    joint = (
        f'<joint name="unit_joint" type="{kind}"><parent link="base_link"/><child link="unit"/><axis xyz="{axis}"/>{limit}</joint>'
        f'<link name="unit">{unit}</link>'
    )
    return changed(LEFT_JOINT, joint + LEFT_JOINT.replace('"base_link"', '"unit"'))


@pytest.mark.parametrize("axis", ["0 1 0", "1 0 0", "0.7 0.7 0.1"])
def test_wheel_behind_a_rocker_that_stays_at_zero_is_driven(axis: str) -> None:
    text = behind_a_joint("revolute", axis)
    assert [wheel.link for wheel in driven_wheels(read_description(text))] == ["left_wheel", "right_wheel"]
    assert problems_of(SMALL, text, Path("/")) == []


@pytest.mark.parametrize("axis", ["0 0 1", "0 0.2 -1"])
def test_wheel_that_is_steered_is_refused_with_its_joint(axis: str) -> None:
    found = problems_of(SMALL, behind_a_joint("revolute", axis), Path("/"))
    assert found == ["joint unit_joint steers left_wheel: the robot turns by the difference of its sides, steered wheels are not known"]
    assert [caster.link for caster in casters(read_description(behind_a_joint("continuous", "0 0 1")))] == ["left_wheel", "caster"]


def test_arm_with_a_wrist_that_turns_without_end_is_neither_wheel_nor_caster() -> None:
    arm = behind_a_joint("revolute", "0 1 0").replace('<child link="unit"/>', '<child link="unit"/><origin xyz="0 0 0.5"/>')
    found = read_description(arm)
    assert "left_wheel" not in {part.link for part in (*driven_wheels(found), *casters(found))}


@pytest.mark.parametrize("inertia", ["", '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>'])
def test_mass_without_an_inertia_weighs_what_it_says(inertia: str) -> None:
    given = between(LEFT_WHEEL, "<inertia ", "/>")
    text = changed(LEFT_WHEEL, LEFT_WHEEL.replace(given, inertia))
    assert read_description(text).masses["left_wheel"][0] == 0.8
    assert problems_of(SMALL, text, Path("/")) == []
    assert description_remarks(SMALL, text, Path("/")) == [
        "left_wheel: mass without an inertia above 0: that of the box around its shapes is taken"
    ]


@pytest.mark.parametrize(("size", "told"), [("0.3 0.02 0.02", True), ("0.05 0.04 0.02", False)])
def test_link_that_is_only_seen_is_told_unless_it_is_small(size: str, told: bool) -> None:
    bar = f'<link name="bar"><visual><geometry><box size="{size}"/></geometry></visual></link>'
    bar += '<joint name="j" type="fixed"><parent link="base_link"/><child link="bar"/></joint>'
    said = ["bar: no collision shape: no laser sees it in simulation, nothing touches it, and no outline is checked for it"]
    assert description_remarks(SMALL, changed("</robot>", bar + "</robot>"), Path("/")) == (said if told else [])
