"""The robot as its URDF describes it: mounting poses, wheels, and the body as a mesh that its own laser can see."""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from pybullet_simulation.world import joined
from rigid_geometry import transform_from_rpy
from robot_body import RobotBody, contradictions, laser_mount, urdf_file
from world_files import Surface

Array = NDArray[np.float64]

WHEELS = ("front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel")
TILT_JOINT = "tilt_joint"


@dataclass(frozen=True)
class RobotModel:
    """Geometry of the robot in base_link, in metres; `body` is all that does not tilt, but for the laser's own link.

    `tilts`: whether the laser does. One that is fixed has T_base_laser for T_base_mount.
    """

    urdf_path: Path
    T_base_mount: Array
    T_tilt_laser: Array
    T_base_imu: Array
    body: Surface
    tilts: bool = True


def read_robot_model(body: RobotBody) -> RobotModel:
    """The model in the robot's URDF, one like ours; ValueError when it cannot be read, lacks a joint that we need, or contradicts it."""
    urdf_path = urdf_file(body)
    try:
        text = urdf_path.read_text(encoding="utf-8")
        robot = ElementTree.fromstring(text)
    except (OSError, UnicodeDecodeError, ElementTree.ParseError) as error:
        raise ValueError(f"cannot read the robot description {urdf_path}: {error}") from error
    if problems := contradictions(body, text):
        raise ValueError(f"robot.yaml contradicts {urdf_path}: {'; '.join(problems)}")
    poses = _joint_origins(robot)
    laser = body.mount("laser")
    joint, T_base_mount, T_tilt_laser = laser_mount(text, laser)
    missing = [name for name in (*WHEELS, *([TILT_JOINT] if joint else []), "imu_joint") if name not in poses]
    if missing:
        raise ValueError(f"{urdf_path} lacks the joints {', '.join(missing)}")
    return RobotModel(
        urdf_path=Path(urdf_path),
        T_base_mount=T_base_mount,
        T_tilt_laser=T_tilt_laser,
        T_base_imu=poses["imu_joint"][1],
        body=_body_surface(robot, poses, {"tilt_link", laser.frame}),
        tilts=joint is not None,
    )


def _origin(element: ElementTree.Element) -> Array:
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    xyz = [float(v) for v in origin.get("xyz", "0 0 0").split()]
    roll, pitch, yaw = (float(v) for v in origin.get("rpy", "0 0 0").split())
    return transform_from_rpy(xyz, (roll, pitch, yaw))


def _joint_origins(robot: ElementTree.Element) -> dict[str, tuple[str, Array]]:
    """Joint name -> (child link, T_parent_child at zero); our tree is flat but for the tilting laser."""
    return {str(j.get("name")): (str(j.find("child").get("link")), _origin(j)) for j in robot.findall("joint")}  # type: ignore[union-attr]


def _shape_surface(collision: ElementTree.Element, T_base_shape: Array) -> Surface:
    box, cylinder = collision.find("geometry/box"), collision.find("geometry/cylinder")
    if box is not None:
        mesh = trimesh.creation.box([float(v) for v in str(box.get("size")).split()], T_base_shape)
    elif cylinder is not None:
        radius, length = float(str(cylinder.get("radius"))), float(str(cylinder.get("length")))
        mesh = trimesh.creation.cylinder(radius, length, sections=48, transform=T_base_shape)
    else:
        raise ValueError("collision shapes of the robot are boxes and cylinders, nothing else")
    return Surface(np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int32))


def _body_surface(robot: ElementTree.Element, poses: dict[str, tuple[str, Array]], apart: set[str]) -> Surface:
    T_base_link = {link: T for link, T in poses.values() if link not in apart} | {"base_link": np.eye(4)}
    shapes = []
    for name, T in T_base_link.items():
        shapes += [_shape_surface(shape, T @ _origin(shape)) for shape in robot.findall(f"link[@name='{name}']/collision")]
    return Surface(*joined(shapes))
