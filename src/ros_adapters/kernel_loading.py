"""Kernels are loaded before a node is ready. numba compiles those that its cache does not hold; then the node says so."""

import sys
import threading
from collections.abc import Callable

import rospy
from std_msgs.msg import String

LOADING_TOPIC = "simulation/loading"  # who waits for a node goes on waiting while it speaks here
_TELL_AFTER_S = 3.0  # a full cache is read by then
_TELL_EVERY_S = 1.0


def load_kernels(node_name: str, *loads: Callable[[], None]) -> None:
    """Calls each of `loads`; a node that takes long says so in one line, and once a second on LOADING_TOPIC."""
    done = threading.Event()
    teller = threading.Thread(target=_tell_until, args=(done, node_name), daemon=True)
    teller.start()
    try:
        for load in loads:
            load()
    finally:
        done.set()
        teller.join()


def _tell_until(done: threading.Event, node_name: str) -> None:
    if done.wait(_TELL_AFTER_S):
        return
    sys.stderr.write(f"{node_name}: loads its kernels; numba compiles those that are new, once, in some minutes\n")
    topic = rospy.Publisher(LOADING_TOPIC, String, queue_size=1)
    while not done.wait(_TELL_EVERY_S):
        topic.publish(String(node_name))
    topic.unregister()
