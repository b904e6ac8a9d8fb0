"""How sensors are mounted: by the frames of robot_description and robot.yaml, and by those of /tf_static."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from tf2_msgs.msg import TFMessage

from robot_body import RobotBody
from robot_body.urdf import Description, Joint, read_description, with_mount
from ros_adapters.conversions import transform_from_message
from ros_adapters.frames import named_as_ours

Floats = NDArray[np.float64]


class SensorFrames:
    """Poses in base_link of frames that do not move. What robot_description has comes before what /tf_static says."""

    def __init__(self, robot: RobotBody, urdf: str) -> None:
        """`urdf` is the text of robot_description, or empty; ValueError when it cannot be read."""
        description = read_description(urdf) if urdf else Description({}, {}, {})
        for mount in robot.mounts:
            description = with_mount(description, mount)
        self._description = description
        self.contradicting: set[str] = set()

    def add_static(self, message: TFMessage) -> None:
        """Takes the frames of /tf_static that are not known yet; ValueError for a transform that is none, and the others are taken."""
        wrong = []
        for t in message.transforms:
            parent, child = named_as_ours(t.header.frame_id), named_as_ours(t.child_frame_id)
            try:
                joint = Joint("/tf_static", "fixed", parent, child, transform_from_message(t.transform), (1.0, 0.0, 0.0))
            except ValueError as error:
                wrong.append(f"{parent} -> {child}: {error}")
                continue
            if self._contradicts(joint):
                self.contradicting.add(child)
            self._description = replace(self._description, joints={child: joint, **self._description.joints})
        if wrong:
            raise ValueError("; ".join(wrong))

    def _contradicts(self, joint: Joint) -> bool:
        """Whether a fixed joint of the description stands elsewhere, by more than a millimetre or a thousandth."""
        known = self._description.joints.get(joint.child)
        if known is None or known.kind != "fixed" or known.name == joint.name:
            return False
        return known.parent != joint.parent or not np.allclose(known.T_parent_child, joint.T_parent_child, atol=1e-3)

    def T_base(self, frame: str) -> Floats:
        """(4, 4) pose of a frame in base_link. ValueError with advice when nothing says where it is, or when it moves."""
        if not frame:
            raise ValueError("a message without frame_id: set the frame in its driver")
        frame = named_as_ours(frame)
        try:
            moving = [joint.name for joint in self._description.chain(frame) if joint.kind != "fixed"]
        except ValueError as error:
            raise ValueError(
                f"where frame {frame!r} is mounted is not known: neither robot_description nor /tf_static leads from base_link to it"
            ) from error
        if moving:
            raise ValueError(f"frame {frame!r} moves with joint {moving[0]}: this sensor must stand firm on base_link")
        return self._description.T_base_link(frame)

    def rotation_in_base(self, frame: str) -> Floats:
        """(3, 3) rotation R_base_frame, as `T_base`."""
        return self.T_base(frame)[:3, :3]
