"""Where the laser sits, tilting or fixed, by the robot's description: nodes have it from /robot_description, tools from a file."""

import math

import numpy as np
from numpy.typing import NDArray

from robot_body.body import RobotBody
from robot_body.mounts import SensorMount
from robot_body.urdf import read_description, with_mount

Transform = NDArray[np.float64]

LEAST_TILT_RAD = 0.2
"""So far down at least a mount has to tilt its laser: what a nod is allowed to reach (`SimulationConfig.nod_lowest_rad`)."""
DESCRIPTION = "robot.urdf"
"""In a run's folder beside robot.yaml: the robot_description of the run."""


def laser_height_m(robot: RobotBody, urdf: str) -> float:
    """The laser above the ground that a robot stands on, all joints at zero. ValueError where its description does not say."""
    laser = robot.mount("laser")
    T_base_laser = with_mount(read_description(urdf), laser).T_base_link(laser.frame)
    return robot.base_height_m + float(T_base_laser[2, 3])


def laser_mount(urdf: str, laser: SensorMount) -> tuple[str | None, Transform, Transform]:
    """The tilting joint's name, T_base_mount (at tilt 0) and T_tilt_laser; of a laser that is fixed None, T_base_laser and the identity.

    ValueError when more than one joint between base_link and the laser's frame moves, or one about another axis than y.
    """
    before, after, tilt = np.eye(4), np.eye(4), None
    for joint in with_mount(read_description(urdf), laser).chain(laser.frame):
        if joint.kind == "fixed":
            before, after = (joint.T_parent_child @ before, after) if tilt else (before, joint.T_parent_child @ after)
        elif tilt is None and joint.axis == (0.0, 1.0, 0.0):
            tilt, before = joint.name, joint.T_parent_child
        else:
            turns = " ".join(f"{value:g}" for value in joint.axis)
            only = f"only one joint may move between base_link and {laser.frame}, and about 0 1 0, so that down is positive"
            raise ValueError(f"joint {joint.name} turns about {turns}: {only}")
    return (tilt, before, after) if tilt else (None, after, before)


def tilt_limits(urdf: str, laser: SensorMount) -> tuple[float, float]:
    """Lowest and highest tilt (rad) of the laser's mount: what its joint is limited to. ValueError as `laser_mount`."""
    moving = with_mount(read_description(urdf), laser).moving(laser.frame)
    limits = moving[0].limits if laser_mount(urdf, laser)[0] and moving[0].kind != "continuous" else None
    return limits or (-math.inf, math.inf)


def is_fixed(urdf: str, laser: SensorMount) -> bool:
    """Whether no joint moves the laser. ValueError as `laser_mount`."""
    return laser_mount(urdf, laser)[0] is None


def fixed_laser_problem(robot: RobotBody, sensor: str, mapping: str) -> str:
    """What is wrong with a sensor and a way of mapping on a robot whose laser is fixed, with advice; empty when nothing is."""
    if sensor != "spinning":
        return f"sensor is {sensor}, and no joint tilts the laser of {robot.name}: only a spinning lidar can be fixed: set it to spinning"
    if mapping != "driving":
        return f"mapping is {mapping}, and no joint tilts the lidar of {robot.name}: set it to driving"
    return ""


def mount_from_urdf(urdf: str, laser: SensorMount) -> tuple[str, Transform, Transform]:
    """As `laser_mount`, of a laser that tilts. ValueError when it does not."""
    tilt, T_base_mount, T_tilt_laser = laser_mount(urdf, laser)
    if tilt is None:
        raise ValueError(f"robot_description has no joint that tilts {laser.frame}")
    return tilt, T_base_mount, T_tilt_laser
