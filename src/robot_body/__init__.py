"""The robot: one dataclass from config/robot.yaml, which everything that depends on its body reads, and all that follows from it.

A radius, a box or a margin that is due to the body is derived here, once, and written nowhere else.
"""

from robot_body.agreement import contradictions
from robot_body.body import RobotBody
from robot_body.fixed_frames import FixedFrames, StaticTransform
from robot_body.loading import (
    DEFAULT_ROBOT_FILE,
    load_robot,
    overlaid,
    robot_file,
    robot_from_mapping,
    robot_mapping,
    robot_names,
    robot_values,
)
from robot_body.mounts import SensorMount
from robot_body.package_folder import PACKAGE_FOLDER
from robot_body.remarks import description_remarks
from robot_body.shapes import Shape, mesh_surface
from robot_body.simulable import simulation_problems
from robot_body.tilting_mount import (
    DESCRIPTION,
    LEAST_TILT_RAD,
    fixed_laser_problem,
    is_fixed,
    laser_height_m,
    laser_mount,
    mount_from_urdf,
    tilt_limits,
)
from robot_body.urdf import URDF_FOLDER, read_description, urdf_file, with_base, with_mount
from robot_body.wheels import Caster, Wheel, casters, driven_wheels

__all__ = [
    "DEFAULT_ROBOT_FILE",
    "DESCRIPTION",
    "LEAST_TILT_RAD",
    "URDF_FOLDER",
    "Caster",
    "FixedFrames",
    "RobotBody",
    "SensorMount",
    "Shape",
    "StaticTransform",
    "Wheel",
    "casters",
    "contradictions",
    "description_remarks",
    "driven_wheels",
    "fixed_laser_problem",
    "is_fixed",
    "laser_height_m",
    "laser_mount",
    "load_robot",
    "mesh_surface",
    "PACKAGE_FOLDER",
    "mount_from_urdf",
    "overlaid",
    "read_description",
    "robot_file",
    "robot_from_mapping",
    "robot_mapping",
    "robot_names",
    "robot_values",
    "simulation_problems",
    "tilt_limits",
    "urdf_file",
    "with_base",
    "with_mount",
]
