"""Where the laser sits, read from robot_description: the URDF is the only place that says so."""

from xml.etree import ElementTree

import numpy as np
import rospy
from numpy.typing import NDArray

from rigid_geometry import transform_from_rpy

Transform = NDArray[np.float64]


def _numbers(text: str | None) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in (text or "0 0 0").split())
    return x, y, z


def _origin(joint: ElementTree.Element) -> Transform:
    origin = joint.find("origin")
    if origin is None:
        return np.eye(4)
    return transform_from_rpy(_numbers(origin.get("xyz")), _numbers(origin.get("rpy")))


def mount_from_urdf(urdf: str, base: str = "base_link", laser: str = "laser") -> tuple[str, Transform, Transform]:
    """The tilting joint's name, T_base_mount (at tilt 0) and T_tilt_laser.

    ValueError when there is not exactly one joint between them that moves, about y.
    """
    parents = {j.find("child").get("link"): j for j in ElementTree.fromstring(urdf).iter("joint") if j.find("child") is not None}  # type: ignore[union-attr]
    before, after, tilt = np.eye(4), np.eye(4), None
    link = laser
    while link != base:
        joint = parents.get(link)
        if joint is None:
            raise ValueError(f"robot_description has no chain of joints from {base} to {laser}: {link} has no parent")
        if joint.get("type") == "fixed":
            before, after = (_origin(joint) @ before, after) if tilt else (before, _origin(joint) @ after)
        elif tilt is None and _numbers(joint.find("axis").get("xyz")) == (0.0, 1.0, 0.0):  # type: ignore[union-attr]
            tilt, before = joint.get("name"), _origin(joint)
        else:
            raise ValueError(f"joint {joint.get('name')}: between {base} and {laser} there must be one joint that moves, about the y axis")
        link = joint.find("parent").get("link")  # type: ignore[union-attr,assignment]
    if tilt is None:
        raise ValueError(f"robot_description has no joint that tilts {laser}")
    return tilt, before, after


def robot_mount() -> tuple[str, Transform, Transform]:
    """`mount_from_urdf` of the parameter robot_description; ValueError when there is none."""
    urdf = rospy.get_param("/robot_description", "")
    if not urdf:
        raise ValueError("parameter /robot_description is not set")
    return mount_from_urdf(urdf)
