"""How sensors are mounted: by the frames of the robot's description and robot.yaml, and by those that others tell of."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import transform_from_quat
from robot_body.body import RobotBody
from robot_body.urdf import Description, Joint, read_description, with_mount

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StaticTransform:
    """A transform of /tf_static, as its message has it."""

    parent: str
    child: str
    xyz_m: tuple[float, float, float]
    quat_xyzw: tuple[float, float, float, float]


class FixedFrames:
    """Poses in base_link of frames that do not move. What the description has comes before what /tf_static says."""

    def __init__(self, robot: RobotBody, urdf: str) -> None:
        """`urdf` is the text of robot_description, or empty; ValueError when it cannot be read."""
        description = read_description(urdf) if urdf else Description({}, {}, {})
        for mount in robot.mounts:
            description = with_mount(description, mount)
        self._description = description
        self.contradicting: set[str] = set()

    def add(self, transforms: Iterable[StaticTransform]) -> None:
        """Takes the frames that are not known yet; ValueError for a transform that is none, and the others are taken."""
        wrong = []
        for t in transforms:
            try:
                self._add(t)
            except ValueError as error:
                wrong.append(f"{t.parent} -> {t.child}: {error}")
        if wrong:
            raise ValueError("; ".join(wrong))

    def _add(self, transform: StaticTransform) -> None:
        parent, child = transform.parent.lstrip("/"), transform.child.lstrip("/")
        if not np.isfinite(transform.xyz_m).all():
            raise ValueError(f"not a finite position: {transform.xyz_m}")
        T_parent_child = transform_from_quat(transform.xyz_m, transform.quat_xyzw)
        joint = Joint("/tf_static", "fixed", parent, child, T_parent_child, (1.0, 0.0, 0.0))
        if self._contradicts(joint):
            self.contradicting.add(child)
        self._description = replace(self._description, joints={child: joint, **self._description.joints})

    def _contradicts(self, joint: Joint) -> bool:
        """Whether a fixed joint of the description stands elsewhere, by more than a millimetre or a thousandth."""
        known = self._description.joints.get(joint.child)
        if known is None or known.kind != "fixed" or known.name == joint.name:
            return False
        return known.parent != joint.parent or not np.allclose(known.T_parent_child, joint.T_parent_child, atol=1e-3)

    def T_base(self, frame: str) -> Array:
        """(4, 4) pose of a frame in base_link. ValueError with advice when nothing says where it is, or when it moves."""
        if not frame:
            raise ValueError("a message without frame_id: set the frame in its driver")
        try:
            moving = [joint.name for joint in self._description.chain(frame) if joint.kind != "fixed"]
        except ValueError as error:
            raise ValueError(
                f"where frame {frame!r} is mounted is not known: neither robot_description nor /tf_static leads from base_link to it"
            ) from error
        if moving:
            raise ValueError(f"frame {frame!r} moves with joint {moving[0]}: this sensor must stand firm on base_link")
        return self._description.T_base_link(frame)

    def rotation_in_base(self, frame: str) -> Array:
        """(3, 3) rotation R_base_frame, as `T_base`."""
        return self.T_base(frame)[:3, :3]
