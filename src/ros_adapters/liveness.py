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
        self._seen: set[str] = set()
        self._deadline = time.monotonic() + start_limit_s
        self._master = rosgraph.Master(rospy.get_name())

    def gone(self) -> list[str]:
        """Names of nodes whose process is gone or never came; empty when the master itself cannot be asked."""
        try:
            return [name for name in self._names if self._is_gone(name)]
        except (OSError, xmlrpc.client.Error):
            return []

    def _is_gone(self, name: str) -> bool:
        try:
            uri = self._master.lookupNode(f"/{name}")
        except rosgraph.MasterError:
            return name in self._seen or time.monotonic() > self._deadline
        self._seen.add(name)
        host, _, port = uri.rstrip("/").rpartition("//")[2].partition(":")
        try:
            with socket.create_connection((host, int(port)), timeout=_TIMEOUT_S):
                return False
        except ConnectionRefusedError:
            return True
        except OSError:
            return False  # slow is not dead

    def end_all(self) -> None:
        """Asks every watched node to end, as rosnode kill does, without waiting for it."""
        threading.Thread(target=self._ask_to_end, daemon=True).start()

    def _ask_to_end(self) -> None:
        for name in self._names:
            try:
                xmlrpc.client.ServerProxy(self._master.lookupNode(f"/{name}")).shutdown(rospy.get_name(), "the run has ended")
            except (OSError, xmlrpc.client.Error, rosgraph.MasterError):
                continue  # it is gone already
