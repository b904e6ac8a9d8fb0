"""Services of nodes that may be started again: who asks waits for them, and asks again."""

import time

import genpy
import rospy

_AGAIN_S = 0.1
_FINAL = "responded with an error", "unavailable"  # as rospy says of a server that does not want, and of one that the master knows not
_asking: list[str] = []


def is_asking() -> bool:
    """Whether this process waits for another's answer: it hangs no more than that one does."""
    return bool(_asking)


class AskedService:
    """A service over one persistent connection. Where nobody answers, it is asked again for as long as there is patience.

    The master goes on knowing a node that was killed. One that never was there, or ended by itself, is not waited for.
    """

    def __init__(self, name: str, service_type: type, patience_s: float = 60.0) -> None:
        """`patience_s`: for a node that dies and is started again; a process takes seconds to be there."""
        self._name, self._type, self._patience_s = name, service_type, patience_s
        self._proxy: rospy.ServiceProxy | None = None

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
                return self._proxy(*arguments)
            except (rospy.ServiceException, rospy.exceptions.TransportException, OSError) as error:
                if any(words in str(error) for words in _FINAL):
                    raise
                self._proxy = None
                if time.monotonic() > deadline_s or rospy.core.is_shutdown_requested():
                    raise rospy.ServiceException(f"{self._name} does not answer: {error}") from error
            time.sleep(_AGAIN_S)
