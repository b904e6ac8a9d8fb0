"""Services of nodes that may be started again: who asks waits for them, and asks again."""

import time

import genpy
import rospy

from node_life import Life

_AGAIN_S = 0.1
_UNWILLING, _UNKNOWN = (
    "responded with an error",
    "unavailable",
)  # as rospy says of a server that is there, and of one that the master knows not
_asking: list[str] = []


def is_asking() -> bool:
    """Whether this process waits for another's answer: it hangs no more than that one does."""
    return bool(_asking)


class AskedService:
    """A service over one persistent connection. Where nobody answers, it is asked again for as long as there is patience.

    One that never was there is not waited for: a node may do without it.
    """

    def __init__(self, name: str, service_type: type, patience_s: float = 60.0, *, is_known: bool | None = None) -> None:
        """`patience_s`: for a node that dies and is started again; a process takes seconds to be there.

        `is_known`: whether it has been there; by default where this node has, in a process before.
        """
        self._name, self._type, self._patience_s = name, service_type, patience_s
        self._is_known = not Life().is_first if is_known is None else is_known
        self._proxy: rospy.ServiceProxy | None = None
        self.broken = 0  # times that it did not answer

    def __call__(self, *arguments: object) -> genpy.Message:
        """The answer. ServiceException where it is an error, or does not come in time, or this node ends."""
        _asking.append(self._name)
        try:
            return self._ask(arguments)
        finally:
            _asking.remove(self._name)

    def _ask(self, arguments: tuple[object, ...]) -> genpy.Message:
        deadline_s = time.monotonic() + self._patience_s
        while True:
            try:
                self._proxy = self._proxy or rospy.ServiceProxy(self._name, self._type, persistent=True)
                answer = self._proxy(*arguments)
                self._is_known = True
                return answer
            except (rospy.ServiceException, rospy.exceptions.TransportException, OSError) as error:
                if _UNWILLING in str(error) or (_UNKNOWN in str(error) and not self._is_known):
                    raise
                self._proxy = None
                self.broken += 1
                if time.monotonic() > deadline_s or rospy.core.is_shutdown_requested():
                    raise rospy.ServiceException(f"{self._name} does not answer: {error}") from error
            time.sleep(_AGAIN_S)
