"""How sensors are mounted, by the messages of /tf_static, too."""

from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from robot_body import FixedFrames, StaticTransform


class SensorFrames(FixedFrames):
    """Frames that do not move, of robot_description, robot.yaml and /tf_static."""

    def add_static(self, message: TFMessage) -> None:
        """Takes the frames that are not known yet; ValueError for a transform that is none, and the others are taken."""
        self.add(_static(t) for t in message.transforms)


def _static(message: TransformStamped) -> StaticTransform:
    p, q = message.transform.translation, message.transform.rotation
    return StaticTransform(message.header.frame_id, message.child_frame_id, (p.x, p.y, p.z), (q.x, q.y, q.z, q.w))
