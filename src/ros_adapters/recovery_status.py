"""move_base's recovery_status: a message each time that the robot begins to help itself, or gives up."""

import enum

from geometry_msgs.msg import PoseStamped
from move_base_msgs.msg import RecoveryStatus

from path_following import FollowerOutput, FollowerState
from rigid_geometry.transforms import Transform
from ros_adapters.conversions import header, pose_message
from ros_adapters.frames import frames
from ros_adapters.node import Node


class Recovery(enum.Enum):
    """From the least to giving up; a message has the name, and as number the place here. Most are states of the follower."""

    TURNING_TO_PATH = "turning_to_path"
    WAITING = "waiting"
    AWAITING_GROUND = "awaiting_ground"
    BACKING_OFF = "backing_off"
    NEXT_GOAL = "next_goal"  # the one before could not be reached
    LOCALISING = "localising"  # the robot was moved otherwise than by its wheels, and stands
    CLEARING = "clearing"  # of the costmap: what was marked from a wrong place
    BLOCKED = "blocked"
    STUCK = "stuck"


_STATES = {state: Recovery(state.value) for state in FollowerState if state.value in {recovery.value for recovery in Recovery}}
_NAMES = list(Recovery)


class RecoveryTopic:
    """Tells of each recovery once, when it begins."""

    def __init__(self, node: Node) -> None:
        self._topic = node.publisher("move_base/recovery_status", RecoveryStatus)
        self._state = FollowerState.IDLE

    def tell(self, stamp_s: float, output: FollowerOutput, T_map_base: Transform | None) -> None:
        """Takes in what the follower does, and where."""
        entered, self._state = output.state is not self._state, output.state
        if entered and output.state in _STATES:
            self.tell_of(_STATES[output.state], stamp_s, T_map_base)

    def tell_of(self, recovery: Recovery, stamp_s: float, T_map_base: Transform | None) -> None:
        """One that is none of the follower's; nothing where nobody knows where the robot is."""
        if T_map_base is None:
            return
        here = PoseStamped(header(stamp_s, frames().map), pose_message(T_map_base))
        self._topic.publish(RecoveryStatus(here, _NAMES.index(recovery), len(_NAMES), recovery.value))
