"""move_base's recovery_status: a message each time that the follower begins to help itself, or gives up."""

from geometry_msgs.msg import PoseStamped
from move_base_msgs.msg import RecoveryStatus

from path_following import FollowerOutput, FollowerState
from rigid_geometry.transforms import Transform
from ros_adapters.conversions import header, pose_message
from ros_adapters.frames import frames
from ros_adapters.node import Node

RECOVERIES = (
    FollowerState.TURNING_TO_PATH,
    FollowerState.WAITING,
    FollowerState.AWAITING_GROUND,
    FollowerState.BACKING_OFF,
    FollowerState.BLOCKED,
    FollowerState.STUCK,
)
"""From the least to giving up; a message's number is the place here, its name the state's."""


class RecoveryTopic:
    """Tells of each of the follower's recoveries once, when it begins."""

    def __init__(self, node: Node) -> None:
        self._topic = node.publisher("/move_base/recovery_status", RecoveryStatus)
        self._state = FollowerState.IDLE

    def tell(self, stamp_s: float, output: FollowerOutput, T_map_base: Transform | None) -> None:
        """Takes in what the follower does, and where."""
        entered, self._state = output.state is not self._state, output.state
        if not entered or output.state not in RECOVERIES or T_map_base is None:
            return
        here = PoseStamped(header(stamp_s, frames().map), pose_message(T_map_base))
        self._topic.publish(RecoveryStatus(here, RECOVERIES.index(output.state), len(RECOVERIES), output.state.value))
