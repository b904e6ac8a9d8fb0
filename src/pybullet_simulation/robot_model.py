"""The robot as its URDF describes it: mounting poses, wheels, casters, and the body as a mesh that its own laser can see."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from pybullet_simulation.world import joined
from rigid_geometry import transform_points
from robot_body import (
    Caster,
    RobotBody,
    Shape,
    Wheel,
    casters,
    driven_wheels,
    laser_mount,
    mesh_surface,
    read_description,
    simulation_problems,
    tilt_limits,
    urdf_file,
    with_mount,
)
from world_files import Surface

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RobotModel:
    """Geometry of the robot in base_link, in metres; `body` is all that does not tilt, but for the housing that a fixed laser looks out of.

    `tilt_joint` tilts the laser, within `tilt_limits_rad`; None for one that is fixed, which has T_base_laser for T_base_mount.
    """

    urdf_path: Path
    tilt_joint: str | None
    tilt_limits_rad: tuple[float, float]
    T_base_mount: Array
    T_tilt_laser: Array
    T_base_imu: Array
    wheels: tuple[Wheel, ...]
    casters: tuple[Caster, ...]
    body: Surface

    @property
    def tilts(self) -> bool:
        """Whether the laser does."""
        return self.tilt_joint is not None

    @property
    def side_of_wheel(self) -> NDArray[np.intp]:
        """(W,) 0 for a wheel on the left, 1 for one on the right."""
        return np.array([0 if wheel.is_left else 1 for wheel in self.wheels])

    @property
    def forward_of_wheel(self) -> Array:
        """(W,) 1 or -1: which way the joint of a wheel turns when it rolls forward."""
        return np.array([wheel.forward for wheel in self.wheels])


def read_robot_model(body: RobotBody) -> RobotModel:
    """The model in the robot's URDF; ValueError when it cannot be read or simulated, or contradicts the robot."""
    urdf_path = urdf_file(body)
    try:
        text = urdf_path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"cannot read the robot description {urdf_path}: {error}") from error
    if problems := simulation_problems(body, text, urdf_path.parent):
        raise ValueError(f"robot {body.name} with {urdf_path}: {'; '.join(problems)}")
    laser, imu = body.mount("laser"), body.mount("imu")
    description = with_mount(with_mount(read_description(text, urdf_path.parent), imu), laser)
    tilt_joint, T_base_mount, T_tilt_laser = laser_mount(text, laser)
    housing = set() if tilt_joint else description.housing(laser.frame)
    parts = [link for link in description.shapes if description.hangs_on_base(link) and link not in housing]
    links = [link for link in parts if all(joint.name != tilt_joint for joint in description.moving(link))]
    return RobotModel(
        urdf_path=urdf_path,
        tilt_joint=tilt_joint,
        tilt_limits_rad=tilt_limits(text, laser),
        T_base_mount=T_base_mount,
        T_tilt_laser=T_tilt_laser,
        T_base_imu=description.T_base_link(imu.frame),
        wheels=tuple(driven_wheels(description)),
        casters=tuple(casters(description)),
        body=Surface(*joined([_surface(shape, description.T_base_link(link)) for link in links for shape in description.shapes[link]])),
    )


def _surface(shape: Shape, T_base_link: Array) -> Surface:
    if shape.mesh is not None:
        vertices, triangles = mesh_surface(shape.mesh, shape.scale)
    else:
        solid = _solid(shape)
        vertices, triangles = np.asarray(solid.vertices, np.float64), np.asarray(solid.faces, np.int32)
    return Surface(np.asarray(transform_points(T_base_link @ shape.T_link_shape, vertices), np.float64), triangles)


def _solid(shape: Shape) -> trimesh.Trimesh:
    x, y, z = shape.half_m
    solid: trimesh.Trimesh
    if shape.kind == "box":
        solid = trimesh.creation.box([2 * x, 2 * y, 2 * z])
    elif shape.kind == "sphere":
        solid = trimesh.creation.icosphere(subdivisions=3, radius=x)
    else:
        solid = trimesh.creation.cylinder(x, 2 * z, sections=48)
    return solid
