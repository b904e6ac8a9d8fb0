"""What a node waits for that is not its own: services of nodes that may be started again, and disks."""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator

import genpy
import rospy

from node_life import Life

NO_ANSWER = rospy.ServiceException, rospy.exceptions.TransportException, ConnectionError  # what a service that fails raises
_AGAIN_S = 0.1
_UNWILLING, _UNKNOWN = (
    "responded with an error",
    "unavailable",
)  # as rospy says of a server that is there, and of one that the master knows not
_waited_for: list[str] = []


def is_waiting() -> bool:
    """Whether this process waits for another's answer, or for a disk: it hangs no more than that does."""
    return bool(_waited_for)


@contextlib.contextmanager
def waiting_for(name: str) -> Iterator[None]:
    """While it lasts, this process waits for another, or for a disk."""
    _waited_for.append(name)
    try:
        yield
    finally:
        _waited_for.remove(name)


class AskedService:
    """A service over one persistent connection. Where nobody answers, it is asked again for as long as there is patience.

    One that never was there is not waited for: a node may do without it.
    """

    def __init__(
        self, name: str, service_type: type, patience_s: float = 60.0, *, is_known: bool | None = None, limit_s: float | None = None
    ) -> None:
        """`patience_s`: for a node that dies and is started again; a process takes seconds to be there.

        `is_known`: whether it has been there; by default where this node has, in a process before. `limit_s`: for one that is there, or
        whose computer is gone, and does not answer; None: no limit.
        """
        self._limit_s, self._asking = limit_s, threading.Thread()
        self._name, self._type, self._patience_s = rospy.resolve_name(name), service_type, patience_s
        self._is_known = not Life().is_first if is_known is None else is_known
        self._proxy: rospy.ServiceProxy | None = None
        self.broken = 0  # times that it did not answer

    def __call__(self, *arguments: object) -> genpy.Message:
        """The answer. ServiceException where it is an error, or does not come in time, or this node ends."""
        with waiting_for(self._name):
            if self._limit_s is None:
                return self._ask(arguments)
            return self._within(self._limit_s, lambda: self._ask(arguments))

    def _within(self, limit_s: float, ask: Callable[[], genpy.Message]) -> genpy.Message:
        """Asks beside this thread, which holds its node's lock; nothing is asked while the last question is open."""
        found: list[genpy.Message | Exception] = []

        def note() -> None:
            try:
                found.append(ask())
            except Exception as error:  # of whoever asked
                found.append(error)

        if not self._asking.is_alive():
            self._asking = threading.Thread(target=note, daemon=True)
            self._asking.start()
            self._asking.join(limit_s)
        if not found:
            raise rospy.ServiceException(f"{self._name} does not answer within {limit_s:g} s")
        if isinstance(found[0], Exception):
            raise found[0]
        return found[0]

    def _ask(self, arguments: tuple[object, ...]) -> genpy.Message:
        deadline_s = time.monotonic() + self._patience_s
        while True:
            is_old = self._proxy is not None
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
                if rospy.core.is_shutdown_requested() or (time.monotonic() > deadline_s and not is_old):
                    raise rospy.ServiceException(f"{self._name} does not answer: {error}") from error
            if not is_old:  # whose server may long be there anew
                time.sleep(_AGAIN_S)
