"""The tick of lock-step that is answered when the robot has thought about its sweep: the clock stands meanwhile."""

import rospy

from ros_adapters.barrier import Tick
from ros_adapters.driving_memory import DrivingMemory

_THINKS_S = 20.0  # by the steady clock; what is awaited longer is told
_LOST_S = 90.0  # and what is awaited so long does not come: it was lost with a node that died


class HeldTick:
    """Waits for the decision about a sweep whose cloud is out, and for the follower to have its terrain.

    Until the cloud is out the clock goes on: on a robot, too, the last scans come after the mount is level.
    """

    def __init__(self, memory: DrivingMemory) -> None:
        self.terrain_stamp = rospy.Time()  # of the terrain that the follower has
        self._memory = memory
        self._tick: Tick | None = None
        self._since_s = 0.0

    def hold(self, tick: Tick, now_s: float) -> None:
        """A tick is to be answered; one that is told once more has waited since it was told first."""
        self._since_s = now_s if self._tick is None else self._since_s
        self._tick = tick

    def awaited(self, now_s: float) -> str:
        """What it has waited for too long, as words; empty when nothing."""
        return self._missing() if now_s - self._since_s > _THINKS_S else ""

    def give_up(self, now_s: float) -> str:
        """Waits no more for what does not come, and says for what; a robot, whose clock runs, goes on as well."""
        words = self._missing() if now_s - self._since_s > _LOST_S else ""
        if words:
            self._memory.open_sweeps.give_up()
            self._memory.decided_stamp = self.terrain_stamp
        return words

    def take(self) -> Tick | None:
        """The tick, once, when nothing is awaited any more."""
        if self._missing():
            return None
        tick, self._tick = self._tick, None
        return tick

    def _missing(self) -> str:
        if self._tick is None:
            return ""
        if self._memory.open_sweeps.must_be_decided(self._tick.stamp_s):
            return "the decision about a sweep has not come"
        return "" if self.terrain_stamp >= self._memory.decided_stamp else "the follower has not the terrain of the last decision"
