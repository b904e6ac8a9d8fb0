"""Frame names as parameters: read once, checked, and the robot's base by whatever name its URDF has."""

from collections.abc import Iterator

import pytest
import rospy

from robot_body import mount_from_urdf, urdf_file
from robot_body.body import RobotBody
from ros_adapters.frames import Frames, frames, lacks_footprint, named_as_ours, robot_description


@pytest.fixture(autouse=True)
def forget() -> Iterator[None]:
    frames.cache_clear()
    yield
    frames.cache_clear()


def set_parameters(monkeypatch: pytest.MonkeyPatch, **parameters: object) -> None:
    monkeypatch.setattr(rospy, "get_param", lambda name, default=None: parameters.get(name.lstrip("/"), default))


def test_names_are_those_of_rep_105_unless_told(monkeypatch: pytest.MonkeyPatch) -> None:
    set_parameters(monkeypatch)
    assert frames() == Frames("map", "odom", "base_link")
    frames.cache_clear()
    set_parameters(monkeypatch, frames={"base": "/base", "odom": "odom_combined"})
    assert frames() == Frames("map", "odom_combined", "base")
    assert (named_as_ours("base"), named_as_ours("/imu")) == ("base_link", "imu")


@pytest.mark.parametrize("wrong", [{"base": ""}, {"footprint": "base_link"}, {"base": "map"}, {"bse": "base"}, "base"])
def test_names_that_cannot_be_are_refused(monkeypatch: pytest.MonkeyPatch, wrong: object) -> None:
    set_parameters(monkeypatch, frames=wrong)
    with pytest.raises(ValueError, match="/frames is"):
        frames()


def test_description_of_another_base_is_read_as_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = RobotBody()
    ours = urdf_file(robot).read_text()
    set_parameters(monkeypatch, frames={"base": "chassis"}, robot_description=ours.replace('"base_link"', '"chassis"'))
    theirs = mount_from_urdf(robot_description(), robot.mount("laser"))
    expected = mount_from_urdf(ours, robot.mount("laser"))
    assert theirs[0] == expected[0] and all((a == b).all() for a, b in zip(theirs[1:], expected[1:], strict=True))


def test_node_s_own_frames_stand_in_place_of_the_shared_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    set_parameters(monkeypatch, frames={"map": "map2"}, **{"~frame_id": "/odom", "~base_frame_id": "chassis"})
    assert frames() == Frames("odom", "odom", "chassis")  # as octomap_server's own launch file has it


@pytest.mark.parametrize(
    ("footprint", "link", "lacks"),
    [("base_footprint", "", True), ("base_footprint", "base_footprint", False), ("", "", False), ("ground", "base_footprint", True)],
)
def test_footprint_is_sent_where_it_is_wanted_and_the_robot_has_none(
    monkeypatch: pytest.MonkeyPatch, footprint: str, link: str, lacks: bool
) -> None:
    own = f'<link name="{link}"/>' if link else ""
    description = f'<robot name="r"><link name="base_link"/>{own}</robot>'
    set_parameters(monkeypatch, frames={"footprint": footprint}, robot_description=description)
    assert lacks_footprint() is lacks
