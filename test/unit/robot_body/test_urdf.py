"""robot.yaml and the URDF say the same, or it is told where they do not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robot_body import (
    RobotBody,
    SensorMount,
    contradictions,
    fixed_laser_problem,
    is_fixed,
    laser_mount,
    load_robot,
    mount_from_urdf,
    urdf_file,
)
from robot_body.urdf import read_description, with_mount

HUSKY = RobotBody()
FIXED = load_robot(Path(__file__).parents[3] / "config" / "robots" / "husky_vlp16.yaml")
URDF = urdf_file(HUSKY).read_text(encoding="utf-8")
LASER = SensorMount("laser", "laser", "tilt_link", (0.03, 0.0, 0.04), (0.0, 0.0, 0.0))


def with_mounts(*mounts: SensorMount) -> RobotBody:
    return replace(HUSKY, mounts=mounts)


def test_husky_does_not_contradict_its_description() -> None:
    assert contradictions(HUSKY, URDF) == []


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"length_m": 0.98}, "length_m = 0.98, and the shapes of the URDF take 0.99"),
        ({"length_m": 1.05}, "length_m = 1.05, and the shapes of the URDF take 0.99"),
        ({"width_m": 0.66}, "width_m = 0.66, and the shapes of the URDF take 0.67"),
        ({"height_m": 0.95}, "height_m = 0.95, and the shapes of the URDF take 0.957"),
        ({"base_height_m": 0.14}, "base_height_m = 0.14, and the URDF has 0.132"),
        ({"ground_clearance_m": 0.14}, "ground_clearance_m = 0.14, and the URDF has 0.132"),
        ({"wheel_radius_m": 0.16}, "wheel_radius_m = 0.16, and the URDF has 0.1651"),
        ({"wheel_width_m": 0.09}, "wheel_width_m = 0.09, and the URDF has 0.0992"),
        ({"track_m": 0.56}, "track_m = 0.56, and the URDF has 0.5708"),
        ({"wheelbase_m": 0.5}, "wheelbase_m = 0.5, and the URDF has 0.512"),
        ({"mounts": (SensorMount("laser", "lidar"),)}, "mounts/laser: the URDF has no frame lidar"),
        ({"mounts": (replace(LASER, parent="base_link"),)}, "laser is mounted on base_link, and in the URDF on tilt_link"),
        ({"mounts": (replace(LASER, xyz_m=(0.03, 0.0, 0.05)),)}, "laser is 0.01 m and 0 rad from where the URDF has it"),
        ({"mounts": (replace(LASER, rpy_rad=(0.0, 0.1, 0.0)),)}, "laser is 0 m and 0.1 rad from where the URDF has it"),
        ({"mounts": (replace(LASER, frame="lidar", parent="mast"),)}, "mounts/laser: the URDF has no frame mast"),
    ],
    ids=str,
)
def test_contradiction_is_told(changes: dict[str, object], said: str) -> None:
    found = contradictions(replace(HUSKY, **changes), URDF)
    assert any(said in text for text in found), found


def test_outline_may_be_a_little_larger_than_the_shapes() -> None:
    assert contradictions(replace(HUSKY, length_m=1.03, width_m=0.71), URDF) == []


def test_belly_may_lie_higher_than_it_has_to_be() -> None:
    assert contradictions(replace(HUSKY, ground_clearance_m=0.12), URDF) == []


def test_mounts_that_say_what_the_urdf_says_are_right() -> None:
    assert contradictions(with_mounts(LASER, SensorMount("imu", "imu_link")), URDF) == []


def test_frame_that_the_urdf_has_not_is_added_where_robot_yaml_has_it() -> None:
    camera = SensorMount("camera", "camera_link", "mast_link", (0.0, 0.0, 0.3), (0.0, 0.0, 0.0))
    assert contradictions(with_mounts(LASER, camera), URDF) == []
    T_base_camera = with_mount(read_description(URDF), camera).T_base_link("camera_link")
    np.testing.assert_allclose(T_base_camera[:3, 3], [0.2, 0.0, 0.555], atol=1e-12)


def test_description_without_shapes_contradicts_no_outline() -> None:
    bare = (
        "<robot name='r'><link name='laser'/><joint name='t' type='fixed'><parent link='base_link'/><child link='laser'/></joint></robot>"
    )
    assert contradictions(with_mounts(SensorMount("laser", "laser")), bare) == []


@pytest.mark.parametrize("text", ["<robot", "<robot><joint name='a' type='fixed'><child link='b'/></joint></robot>"])
def test_description_that_cannot_be_read_is_told(text: str) -> None:
    assert any("cannot be read" in line for line in contradictions(HUSKY, text))


def test_links_in_a_ring_have_no_way_to_base_link() -> None:
    joint = "<joint name='{0}' type='fixed'><parent link='{1}'/><child link='{0}'/></joint>"
    ring = f"<robot>{joint.format('a', 'b')}{joint.format('b', 'a')}</robot>"
    with pytest.raises(ValueError, match="no chain of joints"):
        read_description(ring).chain("a")


def test_lidar_that_is_fixed_has_a_pose_and_no_joint() -> None:
    text = urdf_file(FIXED).read_text(encoding="utf-8")
    joint, T_base_mount, T_tilt_laser = laser_mount(text, FIXED.mount("laser"))
    assert contradictions(FIXED, text) == [] and joint is None and is_fixed(text, FIXED.mount("laser"))
    looks_along = (T_base_mount @ T_tilt_laser)[:3, 0]
    assert np.degrees(np.arcsin(-looks_along[2])) == pytest.approx(25.0)
    with pytest.raises(ValueError, match="no joint that tilts laser"):
        mount_from_urdf(text, FIXED.mount("laser"))
    assert laser_mount(URDF, LASER)[0] == "tilt_joint"


@pytest.mark.parametrize(
    ("sensor", "mapping", "said"),
    [
        ("spinning", "driving", ""),
        ("tilting", "driving", "only a spinning lidar can be fixed"),
        ("spinning", "stop_and_go", "set it to driving"),
    ],
)
def test_fixed_lidar_spins_and_maps_while_the_robot_drives(sensor: str, mapping: str, said: str) -> None:
    problem = fixed_laser_problem(FIXED, sensor, mapping)
    assert said in problem and bool(problem) == bool(said) and "\n" not in problem
