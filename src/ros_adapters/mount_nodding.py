"""The mount's word to nod or to rest: given when it is needed, and once more when the run ends."""

import math

import rospy
from std_srvs.srv import SetBool

from ros_adapters.asking import AskedService
from ros_adapters.diagnostics import Diagnostics
from ros_adapters.driving_memory import DrivingMemory

_ASK_AGAIN_S = 3.0


class MountNodding:
    """Asks the service nod. A launch before may have left the mount nodding: what nobody has asked it yet is not known."""

    def __init__(self, memory: DrivingMemory, diagnostics: Diagnostics, *, limit_s: float | None, is_needed: bool) -> None:
        """`limit_s`: to wait for an answer; `is_needed`: the service has to be there, as where the mount nods while the robot drives."""
        self._memory, self._diagnostics, self._is_needed = memory, diagnostics, is_needed
        self._nod = AskedService("nod", SetBool, patience_s=0.0, limit_s=limit_s)
        self._asked_s = -math.inf

    def want(self, stamp_s: float, wanted: bool, *, is_stalled: bool, may_rest: bool) -> None:
        """Asked again when it was refused, and when no sweep comes. `may_rest`: nothing is lost where it is asked to rest."""
        asked_lately = 0.0 <= stamp_s - self._asked_s < _ASK_AGAIN_S
        if self._memory.nods is None and not wanted:
            is_due = may_rest and not asked_lately
        else:
            is_due = wanted != self._memory.nods or (is_stalled and not asked_lately)
        if is_due:
            self._asked_s = stamp_s
            self._ask(wanted)

    def end(self) -> None:
        """Has it rest, as far as it answers: who comes next finds it level."""
        if self._memory.nods is not False:
            self._ask(False)

    def _ask(self, wanted: bool) -> None:
        try:
            answer = self._nod(wanted)
            self._memory.nods = wanted if answer.success else self._memory.nods
            if not answer.success:
                self._diagnostics.dropped("nod refused", answer.message)
        except rospy.ServiceException as error:
            if self._is_needed:
                self._diagnostics.dropped("mount not told to nod", str(error))
