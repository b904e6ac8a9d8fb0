"""Which nodes do not answer: asked through their slave API, as rosnode ping does; and which of these are started again.

`/revival/NODE`, set by the process above a node (`node_revival`): its pid, how many times it started the node again, and why it gave up.
"""

import socket
import threading
import time
import xmlrpc.client
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import rosgraph
import rospy

from ros_adapters.memory_use import Revived, memory_mb

_TIMEOUT_S = 3.0
_START_LIMIT_S = 40.0
_AWAY_S = 60.0  # a process that takes longer to begin does not come


def why_it_stays_away(name: str, revived: Revived, away_s: float) -> str:
    """Why nobody waits any longer for a node that has not answered for so long, as words; empty while it is being started again."""
    above = revived.get(name)
    if above is None:
        return name  # nobody starts it again
    if why := above.get("gave_up"):
        return f"{name} ({why})"
    if not Path(f"/proc/{above.get('pid')}").exists():
        return f"{name}, and what starts it again"
    return f"{name} (away for {away_s:.0f} s)" if away_s > _AWAY_S else ""


class Liveness:
    """Watches nodes from their first registration on; one that has not come after a while counts as gone, too."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = list(names)
        self._addresses: dict[str, tuple[str, int]] = {}
        self._away_since_s: dict[str, float] = {}
        self._restarts: dict[str, int] = {}
        self._asking: threading.Thread | None = None
        self._deadline = time.monotonic() + _START_LIMIT_S
        self._master = rosgraph.Master(rospy.get_name())

    def gone(self) -> dict[str, str]:
        """Nodes that are gone for good or never came, each with why, as words; empty when the master itself cannot be asked."""
        try:
            revived, now_s = self.revived(), time.monotonic()
            away = [name for name in self._names if revived.get(name, {}).get("gave_up") or self._is_gone(name)]
            self._away_since_s = {name: self._away_since_s.get(name, now_s) for name in away}
            why = {name: why_it_stays_away(name, revived, now_s - since_s) for name, since_s in self._away_since_s.items()}
            return {name: words for name, words in why.items() if words}
        except (OSError, xmlrpc.client.Error):
            return {}

    def restarts(self) -> dict[str, int]:
        """How often each node was started again, of those that were; as heard last where the master cannot be asked."""
        with suppress(OSError, xmlrpc.client.Error):
            self._restarts = {name: int(above["times"]) for name, above in self.revived().items() if "times" in above}
        return self._restarts

    def memory_mb(self) -> dict[str, dict[str, float]]:
        """Of each node that somebody starts again, as `memory_use` tells; empty where the master cannot be asked."""
        try:
            return memory_mb(self.revived())
        except (OSError, xmlrpc.client.Error):
            return {}

    def revived(self) -> Revived:
        """What the processes above nodes say on the parameter server."""
        try:
            found = self._master.getParam(rospy.resolve_name("revival"))
        except rosgraph.MasterError:
            return {}
        return found if isinstance(found, dict) else {}

    def _is_gone(self, name: str) -> bool:
        if name in self._addresses and self._answers(self._addresses[name]):
            return False  # as long as it answers where it was, the master need not be asked
        try:
            host, _, port = self._master.lookupNode(rospy.resolve_name(name)).rstrip("/").rpartition("//")[2].partition(":")
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
        self._asking = threading.Thread(target=self._ask_to_end, daemon=True)
        self._asking.start()

    def wait_until_asked(self) -> None:
        """Until `end_all` has asked everybody, as long as one of them may take to answer."""
        if self._asking is not None:
            self._asking.join(_TIMEOUT_S)

    def _ask_to_end(self) -> None:
        for name in self._names:
            try:
                xmlrpc.client.ServerProxy(self._master.lookupNode(rospy.resolve_name(name))).shutdown(rospy.get_name(), "the run has ended")
            except (OSError, xmlrpc.client.Error, rosgraph.MasterError):
                continue  # it is gone already
