"""The robot stands in one file; what follows from its body is derived from it, and what contradicts itself is refused at once."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from robot_body import DEFAULT_ROBOT_FILE, RobotBody, SensorMount, load_robot, overlaid, robot_from_mapping, robot_mapping
from stage_config import ConfigError

HUSKY = RobotBody()


def values(**changes: object) -> dict[str, object]:
    return {**robot_mapping(HUSKY), **changes}


def problems(content: dict[str, object]) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        robot_from_mapping(content, "robot.yaml")
    return str(caught.value).splitlines()


def test_file_of_the_project_is_the_default() -> None:
    assert load_robot(DEFAULT_ROBOT_FILE) == load_robot() == HUSKY


def test_robot_survives_being_written_and_read() -> None:
    mount = SensorMount("camera", "camera_link", "base_link", (0.1, 0.0, 0.2), (0.0, 0.1, 0.0))
    robot = replace(HUSKY, max_step_m=0.05, mounts=(mount, *HUSKY.mounts))
    assert robot_from_mapping(yaml.safe_load(yaml.safe_dump(robot_mapping(robot)))) == robot


def test_turning_radius_reaches_the_corners_and_no_farther() -> None:
    robot = replace(HUSKY, length_m=0.8, width_m=0.6, track_m=0.4, wheelbase_m=0.3)
    assert robot.turning_radius_m == pytest.approx(0.5)


def test_passage_keeps_half_the_width_and_what_the_robot_strays() -> None:
    assert HUSKY.passage_radius_m == pytest.approx(0.385)
    assert replace(HUSKY, straying_m=0.0).passage_radius_m == HUSKY.half_width_m


def test_outer_edge_of_a_front_wheel_stays_over_the_ground_of_a_passage() -> None:
    robot, turned = HUSKY, HUSKY.straying_rad
    axle, outer_edge = robot.wheelbase_m / 2, (robot.track_m + robot.wheel_width_m) / 2
    farthest = robot.straying_m + axle * math.sin(turned) + outer_edge * math.cos(turned)
    assert farthest <= robot.passage_cliff_radius_m <= farthest + 0.001


def test_robot_that_does_not_stray_passes_cliffs_by_its_wheels() -> None:
    exact = replace(HUSKY, straying_m=0.0, straying_rad=0.0, track_m=0.4, wheel_width_m=0.1)
    assert exact.passage_cliff_radius_m == pytest.approx(0.25)


def test_own_echoes_lie_around_outline_and_height() -> None:
    robot = replace(HUSKY, own_echo_margin_m=0.0)
    assert np_close(robot.body_min_m, (-0.495, -0.335, -0.132)) and np_close(robot.body_max_m, (0.495, 0.335, 0.868))


def np_close(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    return list(a) == pytest.approx(list(b))


def test_every_missing_value_is_named() -> None:
    assert sorted(problems({})) == sorted([f"robot.yaml: {name} is missing" for name in robot_mapping(HUSKY)])


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"name": ""}, "name is empty"),
        ({"max_stp_m": 0.1}, "unknown parameter max_stp_m, did you mean max_step_m?"),
        ({"width_m": -0.67}, "width_m = -0.67 is below 0.1"),
        ({"height_m": math.nan}, "height_m = nan is not finite"),
        ({"track_m": "wide"}, "track_m = 'wide' is no float"),
        ({"width_m": 0.6}, "width_m = 0.6 is below track_m + wheel_width_m = 0.67"),
        ({"length_m": 0.84}, "length_m = 0.84 is below wheelbase_m + 2 wheel_radius_m = 0.8422"),
        ({"max_step_m": 0.17, "ground_clearance_m": 0.2}, "wheel_radius_m = 0.1651 is below max_step_m = 0.17"),
        ({"max_step_m": 0.14}, "ground_clearance_m = 0.132 is below max_step_m = 0.14"),
        ({"height_m": 0.12, "ground_clearance_m": 0.11}, "height_m = 0.12 is below base_height_m = 0.132"),
        ({"mounts": {"imu": {"frame": "imu_link", "from": "urdf"}}}, "mounts has no laser"),
        ({"mounts": {"laser": {"from": "urdf"}}}, "mounts/laser: has no frame"),
        ({"mounts": {"laser": {"frame": "laser"}}}, "mounts/laser: has no parent, nor 'from: urdf'"),
        ({"mounts": {"laser": {"frame": "laser", "from": "tf"}}}, "mounts/laser: from = 'tf' is none of urdf"),
        ({"mounts": {"laser": {"frame": "laser", "from": "urdf", "xyz": [0, 0, 0]}}}, "mounts/laser: xyz contradicts 'from: urdf'"),
        ({"mounts": {"laser": {"frame": "a", "parent": "b", "xyz": [0, 0], "rpy": [0, 0, 0]}}}, "xyz = [0, 0] is not three finite numbers"),
        ({"mounts": {"laser": {"frame": "a", "parent": "b", "xyz": [0, 0, math.nan], "rpy": [0, 0, 0]}}}, "is not three finite numbers"),
        ({"mounts": {"laser": {"frame": "a", "from": "urdf", "rool": 1}}}, "mounts/laser: unknown rool"),
        ({"mounts": {"laser": {"frame": "a", "from": "urdf"}, "imu": {"frame": "a", "from": "urdf"}}}, "frame a is given twice"),
        ({"mounts": ["laser"]}, "mounts = ['laser'] is no mapping"),
        ({"mounts": {"laser": "laser"}}, "mounts/laser: 'laser' is no mapping"),
    ],
    ids=str,
)
def test_wrong_value_is_told(changes: dict[str, object], expected: str) -> None:
    found = problems(values(**changes))
    assert any(expected in line for line in found), found
    assert all(line.startswith("robot.yaml: ") for line in found)


def test_limits_themselves_are_allowed() -> None:
    robot = robot_from_mapping(values(max_step_m=0.132, ground_clearance_m=0.132, width_m=0.67, length_m=0.8422))
    assert robot.max_step_m == robot.ground_clearance_m


def test_frames_of_mounts_are_meant_without_a_slash() -> None:
    mount = {"frame": "/velodyne", "parent": "/base_link", "xyz": [0, 0, 0.5], "rpy": [0, 0, 0]}
    robot = robot_from_mapping(values(mounts={"laser": mount, "imu": {"frame": "/imu_link", "from": "urdf"}}))
    assert (robot.mount("laser").frame, robot.mount("laser").parent, robot.mount("imu").frame) == ("velodyne", "base_link", "imu_link")
    assert "mounts/laser: has no frame" in problems(values(mounts={"laser": {"frame": "/", "from": "urdf"}}))[0]


def test_all_violations_come_at_once_one_a_line() -> None:
    content = values(width_m=0.5, max_step_m=0.2, colour="red", mounts={"laser": {"from": "urdf"}})
    del content["track_m"]
    found = problems(content)
    assert len(found) == 5, found  # track missing, step twice, colour, frame; nothing of the width, which the track would tell


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[1, 2", "is no YAML"),
        ("name: a\nname: b", "key name stands in line 1, and again in line 2"),
        ("- a", "expected the robot's values"),
        (None, "no such robot or file; robots are husky, "),
    ],
)
def test_file_that_is_none_is_told(tmp_path: Path, text: str | None, expected: str) -> None:
    path = tmp_path / "robot.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ConfigError, match=expected):
        load_robot(path)


def test_changes_lie_over_the_values_and_leave_them_as_they_are() -> None:
    before = values()
    after = overlaid(before, {"max_step_m": 0.05, "mounts/laser/frame": "lidar"})
    robot = robot_from_mapping(after)
    assert (robot.max_step_m, robot.mount("laser").frame, robot.mount("imu").frame) == (0.05, "lidar", "imu_link")
    assert before == values()


def test_value_that_is_missing_or_wrong_contradicts_nothing() -> None:
    assert problems({**values(width_m=-1.0, max_step_m="high")}) == [
        "robot.yaml: max_step_m = 'high' is no float",
        "robot.yaml: width_m = -1.0 is below 0.1",
    ]
    content = values(width_m=0.2)
    del content["track_m"]
    assert problems(content) == ["robot.yaml: track_m is missing"]


def test_sensor_that_is_not_mounted_is_told_with_those_that_are() -> None:
    with pytest.raises(ValueError, match="no mount 'radar'; it has imu, laser"):
        HUSKY.mount("radar")


def test_robot_of_one_axle_stands_on_its_track_and_on_a_caster() -> None:
    assert HUSKY.standing_base_m == HUSKY.wheelbase_m
    assert replace(HUSKY, wheelbase_m=0.0, length_m=0.4, track_m=0.31).standing_base_m == 0.2
