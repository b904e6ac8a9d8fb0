"""Where the tilting laser sits, by the robot's description: nodes have it from /robot_description, tools from a file."""

import numpy as np
from numpy.typing import NDArray

from robot_body.body import RobotBody
from robot_body.mounts import SensorMount
from robot_body.urdf import read_description, with_mount

Transform = NDArray[np.float64]

DESCRIPTION = "robot.urdf"
"""In a run's folder beside robot.yaml: the robot_description of the run."""


def laser_height_m(robot: RobotBody, urdf: str) -> float:
    """The laser above the ground that a robot stands on, all joints at zero. ValueError where its description does not say."""
    laser = robot.mount("laser")
    T_base_laser = with_mount(read_description(urdf), laser).T_base_link(laser.frame)
    return robot.base_height_m + float(T_base_laser[2, 3])


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
