"""Which nodes do not answer: asked through their slave API, as rosnode ping does."""

import socket
import xmlrpc.client
from collections.abc import Sequence

import rosgraph
import rospy

_TIMEOUT_S = 3.0


def _answers(master: "rosgraph.Master", name: str) -> bool:
    """True unless the node's process is gone: unregistered, or its port refuses connections."""
    try:
        uri = master.lookupNode(name)
    except rosgraph.MasterError:
        return False
    host, _, port = uri.rstrip("/").rpartition("//")[2].partition(":")
    try:
        with socket.create_connection((host, int(port)), timeout=_TIMEOUT_S):
            return True
    except ConnectionRefusedError:
        return False
    except OSError:
        return True  # slow is not dead


def dead_nodes(names: Sequence[str]) -> list[str]:
    """The names whose processes are gone; empty when the master itself cannot be asked."""
    master = rosgraph.Master(rospy.get_name())
    try:
        return [name for name in names if not _answers(master, f"/{name}")]
    except (OSError, xmlrpc.client.Error):
        return []
