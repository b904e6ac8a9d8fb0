"""What a node does with a message at once, beside its lock, while the rest of it waits for the lock.

rospy reads a topic in one thread, whatever number of subscribers a node has: a callback that waits holds up all others of the topic.
"""

import traceback
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from typing import TypeVar

import rospy

M = TypeVar("M")


def beside(at_once: Callable[[M], object], take_in: Callable[[M], None]) -> Callable[[M], None]:
    """A callback that calls `at_once` in rospy's thread, and `take_in`, which may wait, in a thread of its own, in order."""
    later = ThreadPoolExecutor(1)
    rospy.on_shutdown(partial(later.shutdown, wait=False, cancel_futures=True))

    def receive(message: M) -> None:
        at_once(message)
        with suppress(RuntimeError):  # the node ends
            later.submit(take_in, message).add_done_callback(_tell_error)

    return receive


def _tell_error(done: Future[None]) -> None:
    """As rospy does with the error of a callback: the node lives on."""
    if not done.cancelled() and (error := done.exception()) is not None:
        rospy.logerr("bad callback: %s", "".join(traceback.format_exception(error)))
