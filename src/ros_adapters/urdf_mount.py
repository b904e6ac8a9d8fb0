"""Where the laser sits, of robot.yaml, robot_description and the mount's calibration; the first two must not contradict each other."""

import sys
from pathlib import Path
from typing import NoReturn

import numpy as np
import rospy
from numpy.typing import NDArray

from mount_calibration import DEFAULT_FILE, TiltCalibration, TiltGeometry, read_calibration
from robot_body import RobotBody, contradictions, mount_from_urdf, robot_from_mapping
from ros_adapters.frames import robot_description
from stage_config import ConfigError

Transform = NDArray[np.float64]
CALIBRATION_PARAMETER = "/mount_calibration"


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
    urdf = robot_description()
    if not urdf:
        _refuse(node, "/robot_description is not set")
    if rospy.has_param("/robot") and (found := contradictions(robot, urdf)):
        _refuse(node, f"robot.yaml contradicts robot_description: {'; '.join(found)}")
    return mount_from_urdf(urdf, robot.mount("laser"))


def tilting_mount(node: str, robot: RobotBody) -> tuple[str, TiltGeometry]:
    """The tilting joint's name, and the mount of robot_description with the calibration of the file /mount_calibration.

    That parameter is a path; where it is empty or missing the mount is taken as described. "auto" is calibrate_mount's own file, if it is
    there. Exit code 2 when the file is none.
    """
    joint, T_base_mount, T_tilt_laser = robot_mount(node, robot)
    return joint, TiltGeometry(T_base_mount, T_tilt_laser, _calibration(node))


def _calibration(node: str) -> TiltCalibration:
    path = str(rospy.get_param(CALIBRATION_PARAMETER, "") or "")
    if path == "auto":
        path = str(DEFAULT_FILE) if DEFAULT_FILE.expanduser().exists() else ""
    if not path:
        return TiltCalibration()
    try:
        return read_calibration(Path(path).expanduser())
    except OSError as error:
        _refuse(node, f"{CALIBRATION_PARAMETER}: {path} cannot be read: {error.strerror}; calibrate_mount writes it, empty means none")
    except ValueError as error:
        _refuse(node, f"{CALIBRATION_PARAMETER}: {error}")


def _refuse(node: str, reason: str) -> NoReturn:
    sys.stderr.write(f"{node}: wrong parameter: {reason}\n")
    sys.exit(2)
