"""Which nodes do not answer: asked through their slave API, as rosnode ping does."""

import socket
import threading
import time
import xmlrpc.client
from collections.abc import Sequence

import rosgraph
import rospy

_TIMEOUT_S = 3.0


class Liveness:
    """Watches nodes from their first registration on; one that has not come after a while counts as gone, too."""

    def __init__(self, names: Sequence[str], start_limit_s: float = 40.0) -> None:
        self._names = list(names)
        self._addresses: dict[str, tuple[str, int]] = {}
        self._deadline = time.monotonic() + start_limit_s
        self._master = rosgraph.Master(rospy.get_name())

    def gone(self) -> list[str]:
        """Names of nodes whose process is gone or never came; empty when the master itself cannot be asked."""
        try:
            return [name for name in self._names if self._is_gone(name)]
        except (OSError, xmlrpc.client.Error):
            return []

    def _is_gone(self, name: str) -> bool:
        if name in self._addresses and self._answers(self._addresses[name]):
            return False  # as long as it answers where it was, the master need not be asked
        try:
            host, _, port = self._master.lookupNode(f"/{name}").rstrip("/").rpartition("//")[2].partition(":")
        except rosgraph.MasterError:
            return name in self._addresses or time.monotonic() > self._deadline
        self._addresses[name] = (host, int(port))
        return not self._answers(self._addresses[name])

    def _answers(self, address: tuple[str, int]) -> bool:
        try:
            with socket.create_connection(address, timeout=_TIMEOUT_S):
                return True
        except ConnectionRefusedError:
            return False
        except OSError:
            return True  # slow is not dead

    def end_all(self) -> None:
        """Asks every watched node to end, as rosnode kill does, without waiting for it."""
        threading.Thread(target=self._ask_to_end, daemon=True).start()

    def _ask_to_end(self) -> None:
        for name in self._names:
            try:
                xmlrpc.client.ServerProxy(self._master.lookupNode(f"/{name}")).shutdown(rospy.get_name(), "the run has ended")
            except (OSError, xmlrpc.client.Error, rosgraph.MasterError):
                continue  # it is gone already
