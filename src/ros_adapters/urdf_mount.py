"""Where the laser sits, of robot.yaml, robot_description and the mount's calibration; the first two must not contradict each other."""

import sys
from typing import NoReturn

import numpy as np
import rospy
from numpy.typing import NDArray

from mount_calibration import TiltCalibration, TiltGeometry, named_calibration
from robot_body import RobotBody, contradictions, fixed_laser_problem, laser_mount, robot_from_mapping
from ros_adapters.frames import robot_description
from stage_config import ConfigError

Transform = NDArray[np.float64]
CALIBRATION_PARAMETER = "mount_calibration"


def robot_of_parameters(node: str) -> RobotBody:
    """The robot of the parameter /robot, which explore.launch loads from robot.yaml; exit code 2 when it is none.

    Where it is not set, as for a node that is started alone, it is the Husky, with a warning.
    """
    parameter = rospy.resolve_name("robot")
    if not rospy.has_param(parameter):
        rospy.logwarn("%s: %s is not set: taken for a Husky; load your robot.yaml there, as launch/robot.launch does", node, parameter)
        return RobotBody()
    values = rospy.get_param(parameter)
    try:
        if not isinstance(values, dict):
            raise ConfigError(f"{parameter} is {values!r}, not a robot.yaml: load it there, as launch/robot.launch does")
        return robot_from_mapping(values, parameter)
    except ConfigError as error:
        _refuse(node, "; ".join(str(error).splitlines()))


def robot_mount(node: str, robot: RobotBody) -> tuple[str | None, Transform, Transform]:
    """`laser_mount` of the parameter robot_description; exit code 2 when there is none, or it contradicts the robot.

    Also where the laser is fixed and the robot is to stop for its sweeps, or has no lidar: nothing would make a sweep.
    """
    urdf = robot_description()
    if not urdf:
        _refuse(node, f"{rospy.resolve_name('robot_description')} is not set: load it with the robot's drivers, or name it, urdf:=FILE")
    if rospy.has_param("robot") and (found := contradictions(robot, urdf)):
        _refuse(node, f"robot.yaml contradicts robot_description: {'; '.join(found)}; both can be named, robot_file:=FILE urdf:=FILE")
    mount = laser_mount(urdf, robot.mount("laser"))
    if mount[0] is None:
        _check_fixed(node, robot)
    return mount


def _check_fixed(node: str, robot: RobotBody) -> None:
    asked = {name: str(rospy.get_param(name, default)) for name, default in (("sensor", "tilting"), ("mapping", "stop_and_go"))}
    if problem := fixed_laser_problem(robot, **asked):
        _refuse(node, problem)


def mount_of_laser(node: str, robot: RobotBody) -> tuple[str | None, TiltGeometry]:
    """The tilting joint's name, and the mount of robot_description with the calibration of the file /mount_calibration.

    That parameter is as of `named_calibration`; where it is missing the mount is taken as described. Exit code 2 when the file is none.
    A laser that is fixed has no joint, hence None and no calibration.
    """
    joint, T_base_mount, T_tilt_laser = robot_mount(node, robot)
    return joint, TiltGeometry(T_base_mount, T_tilt_laser, mount_calibration(node) if joint else TiltCalibration())


def mount_calibration(node: str) -> TiltCalibration:
    """The calibration that the parameter /mount_calibration names; exit code 2 when it is none."""
    try:
        return named_calibration(str(rospy.get_param(CALIBRATION_PARAMETER, "") or ""))
    except ValueError as error:
        _refuse(node, f"{rospy.resolve_name(CALIBRATION_PARAMETER)}: {error}")


def _refuse(node: str, reason: str) -> NoReturn:
    sys.stderr.write(f"{node}: wrong parameter: {reason}\n")
    sys.exit(2)
