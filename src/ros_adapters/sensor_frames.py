"""How sensors are mounted, by the messages of /tf_static, too; the robot's base by whatever name its frames have."""

import numpy as np
from geometry_msgs.msg import TransformStamped
from numpy.typing import NDArray
from tf2_msgs.msg import TFMessage

from robot_body import FixedFrames, StaticTransform
from ros_adapters.frames import named_as_ours

Floats = NDArray[np.float64]


class SensorFrames(FixedFrames):
    """Frames that do not move, of robot_description, robot.yaml and /tf_static."""

    def add_static(self, message: TFMessage) -> None:
        """Takes the frames that are not known yet; ValueError for a transform that is none, and the others are taken."""
        self.add(_static(t) for t in message.transforms)

    def T_base(self, frame: str) -> Floats:
        """As `FixedFrames`."""
        return super().T_base(named_as_ours(frame))

    def place_in_base(self, frame: str) -> Floats:
        """(3,) origin of a frame in base_link."""
        return self.T_base(frame)[:3, 3]


def _static(message: TransformStamped) -> StaticTransform:
    p, q = message.transform.translation, message.transform.rotation
    parent, child = named_as_ours(message.header.frame_id), named_as_ours(message.child_frame_id)
    return StaticTransform(parent, child, (p.x, p.y, p.z), (q.x, q.y, q.z, q.w))
