"""Where the laser sits, of robot.yaml and robot_description; the two must not contradict each other."""

import sys
from typing import NoReturn

import numpy as np
import rospy
from numpy.typing import NDArray

from robot_body import RobotBody, SensorMount, contradictions, robot_from_mapping
from robot_body.urdf import read_description, with_mount
from stage_config import ConfigError

Transform = NDArray[np.float64]


def robot_of_parameters(node: str) -> RobotBody:
    """The robot of the parameter /robot, which explore.launch loads from robot.yaml; exit code 2 when it is none.

    Where it is not set, as for a node that is started alone, it is the Husky, with a warning.
    """
    if not rospy.has_param("/robot"):
        rospy.logwarn("%s: /robot is not set: taken for a Husky; load your robot.yaml there, as launch/robot.launch does", node)
        return RobotBody()
    values = rospy.get_param("/robot")
    try:
        if not isinstance(values, dict):
            raise ConfigError(f"/robot is {values!r}, not a robot.yaml: load it there, as launch/robot.launch does")
        return robot_from_mapping(values, "/robot")
    except ConfigError as error:
        _refuse(node, "; ".join(str(error).splitlines()))


def robot_mount(node: str, robot: RobotBody) -> tuple[str, Transform, Transform]:
    """`mount_from_urdf` of the parameter robot_description; exit code 2 when there is none, or it contradicts the robot."""
    urdf = str(rospy.get_param("/robot_description", ""))
    if not urdf:
        _refuse(node, "/robot_description is not set")
    if rospy.has_param("/robot") and (found := contradictions(robot, urdf)):
        _refuse(node, f"robot.yaml contradicts robot_description: {'; '.join(found)}")
    return mount_from_urdf(urdf, robot.mount("laser"))


def _refuse(node: str, reason: str) -> NoReturn:
    sys.stderr.write(f"{node}: wrong parameter: {reason}\n")
    sys.exit(2)


def mount_from_urdf(urdf: str, laser: SensorMount) -> tuple[str, Transform, Transform]:
    """The tilting joint's name, T_base_mount (at tilt 0) and T_tilt_laser.

    ValueError when there is not exactly one joint between base_link and the laser's frame that moves, about y.
    """
    before, after, tilt = np.eye(4), np.eye(4), None
    for joint in with_mount(read_description(urdf), laser).chain(laser.frame):
        if joint.kind == "fixed":
            before, after = (joint.T_parent_child @ before, after) if tilt else (before, joint.T_parent_child @ after)
        elif tilt is None and joint.axis == (0.0, 1.0, 0.0):
            tilt, before = joint.name, joint.T_parent_child
        else:
            raise ValueError(f"joint {joint.name}: one joint must move between base_link and {laser.frame}, about the y axis")
    if tilt is None:
        raise ValueError(f"robot_description has no joint that tilts {laser.frame}")
    return tilt, before, after
