"""Listens to one input of a robot for a while, and keeps what a check of it needs: when messages came, and what they said."""

import threading
import time
from collections.abc import Callable
from typing import Any, Generic, TypeVar

import rospy
from rospy.numpy_msg import numpy_msg

from ros_adapters.conversions import sender_of
from sensor_checks import Heard

M = TypeVar("M")
R = TypeVar("R")


class HeardTopic(Generic[R]):
    """Subscribes from its start on; keeps times of all messages, and of at most `kept` of them what `read` makes of each."""

    def __init__(
        self,
        topic: str,
        message_type: type,
        read: Callable[[M], R | None],
        kept: int = 100_000,
        duration_of: Callable[[R], float] = lambda _: 0.0,
    ) -> None:
        """`read` gives None for a message that does not concern it; its ValueError is kept as a fault.

        `duration_of` what it read: seconds from the stamp to the last beam.
        """
        self.topic, self.type_name = rospy.resolve_name(topic), str(message_type._type)  # type: ignore[attr-defined]
        self._read, self._kept, self._duration_of, self._lock = read, kept, duration_of, threading.Lock()
        self._heard: list[Heard] = []
        self._contents: list[R] = []
        self._frames: set[str] = set()
        self._senders: set[str] = set()
        self._faults: dict[str, int] = {}
        self._other_messages = 0
        self._subscriber = rospy.Subscriber(
            topic, numpy_msg(message_type), self._on_message, queue_size=None, buff_size=2**24, tcp_nodelay=True
        )

    def _on_message(self, message: Any) -> None:
        arrival_s, clock_s = time.monotonic(), rospy.get_time()
        duration_s = 0.0
        with self._lock:
            try:
                content = self._read(message)
            except ValueError as error:
                self._faults[str(error)] = self._faults.get(str(error), 0) + 1
            else:
                if content is None:
                    self._other_messages += 1
                    return
                duration_s = self._duration_of(content)
                if len(self._contents) < self._kept:
                    self._contents.append(content)
            self._frames.add(message.header.frame_id)
            self._senders.add(sender_of(message))
            self._heard.append(Heard(arrival_s, clock_s, message.header.stamp.to_sec(), duration_s))

    def forget(self) -> None:
        """Starts afresh: the look begins now."""
        with self._lock:
            self._heard, self._contents, self._frames, self._faults, self._other_messages = [], [], set(), {}, 0
            self._senders = set()

    def stop(self) -> None:
        """Listens no more."""
        self._subscriber.unregister()

    @property
    def heard(self) -> list[Heard]:
        """When messages came."""
        return self._heard

    @property
    def contents(self) -> list[R]:
        """What they said."""
        return self._contents

    @property
    def frames(self) -> set[str]:
        """Their frames."""
        return self._frames

    @property
    def senders(self) -> set[str]:
        """The nodes that sent them."""
        return self._senders

    @property
    def faults(self) -> dict[str, int]:
        """Why messages could not be read, and how many."""
        return self._faults

    @property
    def other_messages(self) -> int:
        """How many messages of the topic did not concern this input."""
        return self._other_messages
