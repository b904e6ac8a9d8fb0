"""A node that may be started again: it says that it gets on, and is ready when all who listened to it do so again."""

import os
import sys
import threading
import time
import traceback
import xmlrpc.client
from collections.abc import Callable, Iterable

import rosgraph
import rospy

from node_life import Life
from ros_adapters.asking import is_waiting

_PERIOD_S = 0.5
_LISTENERS_WITHIN_S = 5.0  # one of them may have died as well


def pulse(life: Life, lock: threading.RLock, runs: Callable[[], bool]) -> None:  # type: ignore[valid-type]  # a function in typeshed
    """Beats for as long as the node works: as its lock, which all its callbacks take, is free now and then, or waits for a node or disk.

    Before it `runs` only waiting is work that can be seen here. When rospy is asked to shut down, it says that the node ends.
    """

    def run() -> None:
        while not rospy.core.is_shutdown_requested():
            if is_waiting():
                life.beat(starts=not runs())
            elif runs() and lock.acquire(timeout=_PERIOD_S):  # type: ignore[attr-defined]
                lock.release()  # type: ignore[attr-defined]
                life.beat()
            time.sleep(_PERIOD_S)

    def end() -> None:
        if threading.main_thread().is_alive():  # else an error has ended it, and rospy shuts down as the process goes
            life.ends()

    rospy.on_shutdown(end)
    threading.Thread(target=run, daemon=True).start()


def break_off(name: str, life: Life, error: Exception) -> None:
    """Ends this process at an error that nobody has thought of, or where no memory is left: what it knows may be half changed.

    Who waits for its word would wait for ever. The next process takes up what was kept. Where nobody would start one, the error is raised.
    """
    if isinstance(error, MemoryError):
        words = "no memory is left, by the limit of `ulimit -v` or of the machine"
    elif life.is_revived:
        words = f"it breaks off: {error!r}\n" + "".join(traceback.format_exception(error))
    else:
        raise error
    sys.stderr.write(f"[explore] {name}: {words}\n")
    sys.stderr.flush()
    os._exit(1)


def unless_busy(lock: threading.RLock, waits_for: Callable[[float], str]) -> str:  # type: ignore[valid-type]  # a function in typeshed
    """What a node waits for, asked under its lock by the steady clock; nothing while it works."""
    if not lock.acquire(blocking=False):  # type: ignore[attr-defined]
        return ""
    try:
        return waits_for(time.monotonic())
    finally:
        lock.release()  # type: ignore[attr-defined]


def wait_for_listeners(publishers: Iterable[rospy.Publisher]) -> None:
    """Until all who listen by the master's word are connected: what is sent from now on reaches them."""
    deadline_s = time.monotonic() + _LISTENERS_WITHIN_S
    publishers, me = list(publishers), rospy.get_name()
    while time.monotonic() < deadline_s and not rospy.core.is_shutdown_requested():
        try:
            heard_by = dict(rosgraph.Master(me).getSystemState()[1])
        except (OSError, xmlrpc.client.Error, rosgraph.MasterError):
            return
        if all(set(heard_by.get(p.resolved_name, ())) - {me} <= {c.endpoint_id for c in p.impl.connections} for p in publishers):
            return
        time.sleep(0.05)
