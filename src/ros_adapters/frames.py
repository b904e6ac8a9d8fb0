"""The names of the frames that all nodes share: the parameters /frames/map, /frames/odom, /frames/base and /frames/footprint.

A node's own ~frame_id and ~base_frame_id, octomap_server's names for them, stand in place of the first and the last.
"""

import functools
from dataclasses import dataclass, replace
from xml.etree import ElementTree

import rospy

from robot_body import with_base
from robot_body.urdf import BASE


@dataclass(frozen=True)
class Frames:
    """Names as REP 105 has them, unless a robot calls them otherwise."""

    map: str = "map"
    odom: str = "odom"
    base: str = "base_link"
    footprint: str = "base_footprint"  # on the ground below the base; empty: nobody sends it


@functools.cache
def frames() -> Frames:
    """The names of this run, read once. ValueError when /frames holds something else."""
    try:
        values = rospy.get_param("frames", {})
    except OSError:  # no master, as in a test of messages alone
        return Frames()
    try:
        found = Frames(**{str(name): str(value).lstrip("/") for name, value in dict(values).items()})
    except (TypeError, ValueError) as error:
        raise ValueError(f"{rospy.resolve_name('frames')} is {values!r}: expected names for map, odom, base and footprint") from error
    if "" in (found.map, found.odom, found.base) or len({found.map, found.odom, found.base, found.footprint}) < 4:
        raise ValueError(f"{rospy.resolve_name('frames')} is {values!r}: names that differ are expected for map, odom, base and footprint")
    own = {name: str(rospy.get_param(f"~{of}", "")).lstrip("/") for name, of in (("map", "frame_id"), ("base", "base_frame_id"))}
    return replace(found, **{name: frame for name, frame in own.items() if frame})


def named_as_ours(frame: str) -> str:
    """A frame's name without a slash; the robot's base is base_link, as everything here calls it."""
    frame = frame.lstrip("/")
    return BASE if frame == frames().base else frame


def lacks_footprint() -> bool:
    """Whether the footprint's frame is wanted, and the robot's description has no such link."""
    text, name = str(rospy.get_param("robot_description", "")), frames().footprint
    links = {link.get("name") for link in ElementTree.fromstring(text).iter("link")} if text else set()
    return name != "" and name not in links


def robot_description() -> str:
    """The URDF of the parameter /robot_description, its base called base_link; empty where it is not set. ValueError when it is none."""
    return with_base(str(rospy.get_param("robot_description", "")), frames().base)
