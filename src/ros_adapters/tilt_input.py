"""The tilt of the laser's mount, as a node hears it: by joint states, or, of a mount that is fixed, level whenever odometry comes."""

from collections.abc import Callable

from sensor_msgs.msg import JointState

from ros_adapters.conversions import joint_position, sender_of, stamp_of
from ros_adapters.node import SILENT_AFTER_S, Node

_BOTH_S = 2.0  # who sent within so long sends still


class TiltInput:
    """Subscribes /joint_states where a joint tilts the laser."""

    def __init__(
        self, node: Node, joint: str | None, take: Callable[[float, float], object], silent_after_s: float = SILENT_AFTER_S
    ) -> None:
        """`take(stamp_s, tilt_rad)` hears every tilt; `joint` is the tilting joint's name, None where the laser is fixed."""
        self._node, self._joint, self._take = node, joint, take
        self._sent_s: dict[str, float] = {}
        self.topics = () if joint is None else ("joint_states",)
        if joint is not None:
            node.subscribe("joint_states", JointState, self._on_joints, silent_after_s=silent_after_s)

    @property
    def is_fixed(self) -> bool:
        """Whether nothing tilts."""
        return self._joint is None

    def add_odometry(self, stamp_s: float) -> None:
        """A fixed mount has no other clock than odometry's."""
        if self._joint is None:
            self._take(stamp_s, 0.0)

    def _on_joints(self, message: JointState) -> bool:
        """Whether the tilt is in it: others publish joints, too."""
        assert self._joint is not None
        tilt_rad = joint_position(message, self._joint)
        if tilt_rad is not None:
            self._look_for_others(stamp_of(message), sender_of(message))
            self._take(stamp_of(message), tilt_rad)
        return tilt_rad is not None

    def _look_for_others(self, stamp_s: float, sender: str) -> None:
        """Of two senders, a driver and a joint_state_publisher for example, the tilts are mixed: it is told for as long as both send."""
        self._sent_s[sender] = stamp_s
        self._sent_s = {name: s for name, s in self._sent_s.items() if abs(stamp_s - s) < _BOTH_S}
        self._node.diagnostics.holds(f"{self._joint} has two senders", ", ".join(sorted(self._sent_s)) if len(self._sent_s) > 1 else "")
