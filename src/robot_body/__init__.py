"""The robot: one dataclass from config/robot.yaml, which everything that depends on its body reads, and all that follows from it.

A radius, a box or a margin that is due to the body is derived here, once, and written nowhere else.
"""

from robot_body.body import RobotBody
from robot_body.fixed_frames import FixedFrames, StaticTransform
from robot_body.loading import DEFAULT_ROBOT_FILE, load_robot, overlaid, robot_from_mapping, robot_mapping, robot_values
from robot_body.mounts import SensorMount
from robot_body.tilting_mount import DESCRIPTION, fixed_laser_problem, is_fixed, laser_mount, mount_from_urdf
from robot_body.urdf import contradictions, urdf_file, with_base

__all__ = [
    "DEFAULT_ROBOT_FILE",
    "DESCRIPTION",
    "FixedFrames",
    "RobotBody",
    "SensorMount",
    "StaticTransform",
    "contradictions",
    "fixed_laser_problem",
    "is_fixed",
    "laser_mount",
    "load_robot",
    "mount_from_urdf",
    "overlaid",
    "robot_from_mapping",
    "robot_mapping",
    "robot_values",
    "urdf_file",
    "with_base",
]
