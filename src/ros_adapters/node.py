"""What every node does the same way: parameters, subscriptions under one lock, the barrier, diagnostics, and the word that it is ready."""

import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar

import rospy
from explore_3dnav.msg import SimulationTick
from rospy.numpy_msg import numpy_msg
from std_msgs.msg import String

from node_life import Life
from robot_body import RobotBody
from ros_adapters.aliases import ALIASES
from ros_adapters.asking import NO_ANSWER
from ros_adapters.at_once import beside
from ros_adapters.barrier import Barrier, Tick
from ros_adapters.connections import is_heard
from ros_adapters.conversions import header
from ros_adapters.counting_publisher import CountingPublisher
from ros_adapters.diagnostics import Diagnostics
from ros_adapters.inputs import InputWatch
from ros_adapters.memory_use import give_back_free_memory
from ros_adapters.restarts import break_off, pulse, unless_busy, wait_for_listeners
from ros_adapters.results_folder import results_folder
from ros_adapters.urdf_mount import robot_of_parameters
from stage_config import ConfigError, load_config
from whole_files import words_end_nobody

C = TypeVar("C")
M = TypeVar("M")
R = TypeVar("R")

READY_TOPIC = "simulation/ready"
TICK_TOPIC = "simulation/tick"
SILENT_AFTER_S = 0.3  # a sensor that pauses longer is silent
SIMULATOR = ""  # among those whose ticks a node acts after
_QUEUE = 100  # small messages
_WATCH_PERIOD_S = 0.05  # on the steady clock


class Node:
    """A rospy node whose callbacks run one at a time, drop what is wrong, and live on.

    Small topics are received without a queue and with tcp_nodelay: in lock-step every hop counts. One re-entrant lock guards all
    callbacks of a node; no callback waits for ROS time, nor goes by it but to tell what is late: stamps come with the messages.
    Callbacks take in; `acts` names what the node does then. Running free it does so after every message, in lock-step at every tick.
    """

    def __init__(self, name: str) -> None:
        words_end_nobody()
        rospy.init_node(name, disable_rostime=True)
        self.name = name
        self.life = Life()
        self.life.show_stacks()
        self.lock = threading.RLock()
        self.lockstep = bool(rospy.get_param("lockstep", False))
        self.diagnostics = Diagnostics(name)
        self._required: list[Callable[[], bool]] = []
        self._barrier: Barrier | None = None
        self._acts: Sequence[Callable[[Tick | None], None]] = ()
        self._sent: dict[str, CountingPublisher] = {}
        self._tick_topic: CountingPublisher | None = None
        self._watchdog: Callable[[float], None] | None = None
        self.sent_otherwise: Counter[str] = Counter()
        self._runs = False
        pulse(self.life, self.lock, lambda: self._runs)
        give_back_free_memory()

    def parameters(self, cls: type[C], *, section: str = "", own: tuple[str, ...] = ("out",)) -> C:
        """The stage's configuration from the private parameters, or those below `section`; `own` are the node's, not the stage's.

        A wrong name or value ends the node with exit code 2.
        """
        try:
            values = {k: v for k, v in rospy.get_param("~" + section, {}).items() if k not in own}
            return load_config(cls, values, own)
        except ConfigError as error:
            sys.stderr.write(f"{self.name}: wrong parameter: {'; '.join(str(error).splitlines())}\n")
            sys.exit(2)

    def robot(self) -> RobotBody:
        """The robot that all nodes share; a wrong value ends the node with exit code 2."""
        return robot_of_parameters(self.name)

    def run_folder(self) -> Path | None:
        """The folder of ~out, made when it is not there; None when nothing is to be written."""
        return results_folder(self.name)

    def acts(
        self,
        act: Callable[[Tick | None], None],
        *,
        after: Sequence[str],
        on: Sequence[str],
        then: Callable[[Tick | None], None] = lambda _: None,
    ) -> None:
        """What the node does with what its callbacks took in: `act`, and then what nobody after it in the chain waits for.

        In lock-step (a tick is given) at the end of every tick, when those `after` whom it stands have told of it and all that was sent
        on the topics `on` is here; the next ones hear of the tick between `act` and `then`. Running free (None) after every message.
        """
        self._acts = (act, then)
        if not self.lockstep:
            return
        self._barrier = Barrier(after, [rospy.resolve_name(topic) for topic in on])
        self._tick_topic = CountingPublisher(f"{TICK_TOPIC}/{self.name}", SimulationTick, queue_size=None, tcp_nodelay=True)
        for upstream in after:
            topic = f"{TICK_TOPIC}/{upstream}".rstrip("/")
            told = partial(self._on_tick, upstream)
            subscriber = rospy.Subscriber(topic, SimulationTick, told, queue_size=None, tcp_nodelay=True)
            self.require(partial(is_heard, subscriber))

    def _on_tick(self, upstream: str, message: SimulationTick) -> None:
        with self.lock:
            assert self._barrier is not None
            counts = dict(zip(message.topics, message.counts, strict=True))
            self._barrier.told(upstream, Tick(message.header.stamp.to_sec(), counts, message.recount))
            self._proceed(message)

    def received(self, topic: str) -> None:
        """Counts a message that came otherwise than by a subscription to its topic."""
        topic = rospy.resolve_name(topic)
        self._heard(topic, time.monotonic())
        self._count_message(topic)

    def _heard(self, topic: str, now_s: float) -> None:
        for watch in self.diagnostics.inputs:
            if watch.topic == topic:
                watch.arrived(now_s)

    def _count_message(self, topic: str) -> None:
        if self._barrier is not None:
            self._barrier.received(topic)

    def _proceed(self, cause: object) -> None:
        """Acts on what is complete by now."""
        if not self._acts:
            return
        act, then = (self.dropping(step, cause) for step in self._acts)
        if self._barrier is None:
            act(None)
            then(None)
            return
        while (tick := self._barrier.next()) is not None:
            act(tick)
            self._pass_on(tick)
            then(tick)

    def waits_for(self, now_s: float) -> str:
        """What has been awaited for too long in lock-step, as words; asked under the lock."""
        return self._barrier.missing(now_s) if self._barrier is not None else ""

    def _pass_on(self, tick: Tick) -> None:
        counts = {**tick.counts, **{topic: p.sent for topic, p in self._sent.items()}, **self.sent_otherwise}
        assert self._tick_topic is not None
        self._tick_topic.publish(SimulationTick(header(tick.stamp_s, ""), list(counts), list(counts.values()), tick.recount))

    def dropping(self, callback: Callable[[M], R], cause: object = None) -> Callable[[M], R | None]:
        """`callback`, which drops what it cannot use: a ValueError is counted under the type of its message, as is a service that fails.

        Any other error is this program's, and breaks it off.
        """

        def run(message: M) -> R | None:
            try:
                return callback(message)
            except ValueError as error:
                name = getattr(cause if cause is not None else message, "_type", "").rpartition("/")[2]
                self.diagnostics.dropped(f"bad {name}", str(error))
            except NO_ANSWER as error:
                self.diagnostics.dropped("service that failed", str(error))
            except Exception as error:  # of whatever kind: it is told
                if not rospy.core.is_shutdown_requested():
                    break_off(self.name, self.life, error)
                elif not isinstance(error, rospy.ROSException):  # for topics are closed then
                    raise
            return None

        return run

    def guarded(self, callback: Callable[[M], R]) -> Callable[[M], R | None]:
        """`callback` under the node's lock; what it cannot use is dropped and counted."""
        guard = self.dropping(callback)

        def run(message: M) -> R | None:
            with self.lock:
                return guard(message)

        return run

    def subscribe(
        self,
        topic: str,
        message_type: type[M],
        callback: Callable[[M], object],
        *,
        large: bool = False,
        required: bool = True,
        silent_after_s: float | None = None,
        at_once: Callable[[M], object] | None = None,
    ) -> rospy.Subscriber:
        """Subscribes; `large` messages get a short queue, and what is not `required` need not be there when the clock starts.

        `at_once` is called beside the lock, also while the node is busy; `callback` follows when it is not.

        A pause longer than `silent_after_s` is told on /diagnostics. A callback that returns False says that the message was not for
        this node: it breaks no pause, and the barrier counts it. Arrays of numbers arrive as numpy arrays.
        """
        guard, name = self.dropping(callback), rospy.resolve_name(topic)

        def take_in(message: M) -> None:
            arrived_s = time.monotonic()
            with self.lock:
                if guard(message) is not False:
                    self._heard(name, arrived_s)
                self._count_message(name)
                self._proceed(message)

        receive = take_in if at_once is None else beside(at_once, take_in)
        self.watch(name, silent_after_s)
        subscriber = rospy.Subscriber(
            topic,
            numpy_msg(message_type),
            receive,
            queue_size=5 if large else None,
            buff_size=2**25 if large else 65536,
            tcp_nodelay=True,
        )
        if required:
            self.require(partial(is_heard, subscriber))
        return subscriber

    def serve(self, name: str, service_type: type, handler: Callable[[M], object], *, buff_size: int = 65536) -> rospy.Service:
        """Serves, also under a second name in ALIASES; a request that cannot be used is counted, and its caller is told why."""

        def answer(request: M) -> object:
            try:
                return handler(request)
            except ValueError as error:
                self.diagnostics.dropped(f"bad {name.rpartition('/')[2].lstrip('~')}", str(error))
                raise rospy.ServiceException(str(error)) from error

        if name in ALIASES:
            rospy.Service(ALIASES[name], service_type, answer, buff_size=buff_size)
        return rospy.Service(name, service_type, answer, buff_size=buff_size)

    def watch(self, topic: str, silent_after_s: float | None) -> None:
        """Tells on /diagnostics how often a topic speaks, and since when not. In lock-step the clock stands while nodes think."""
        silent_after_s = None if self.lockstep else silent_after_s
        self.diagnostics.inputs.append(InputWatch(topic, silent_after_s, time.monotonic()))

    def watchdog(self, look: Callable[[float], None]) -> None:
        """`look` is called twenty times a second with the steady clock."""
        self._watchdog = look

    def require(self, condition: Callable[[], bool]) -> None:
        """The node is not ready before `condition` holds."""
        self._required.append(condition)

    def publisher(
        self, topic: str, message_type: type, *, large: bool = False, latch: bool = False, listener: rospy.SubscribeListener | None = None
    ) -> rospy.Publisher:
        """A publisher whose messages the barrier counts; `listener` is told who subscribes.

        In lock-step without a queue, whose thread costs half of the machine; running free with one, or a subscriber that hangs stops all.
        """
        small = None if self.lockstep else _QUEUE
        publisher = CountingPublisher(
            topic, message_type, queue_size=5 if large else small, tcp_nodelay=True, latch=latch, subscriber_listener=listener
        )
        self._sent[rospy.resolve_name(topic)] = publisher
        return publisher

    def run(self) -> None:
        """Waits for what it listens to, says that it is ready, and serves until shutdown."""
        self._runs = True
        ready = rospy.Publisher(READY_TOPIC, String, latch=True, queue_size=1)
        if self.lockstep:
            while not rospy.is_shutdown() and not all(holds() for holds in self._required):
                time.sleep(0.02)
        if not self.life.is_first:
            wait_for_listeners([*self._sent.values(), *([self._tick_topic] if self._tick_topic else [])])
        self.life.begun()
        ready.publish(String(self.name))
        while not rospy.core.is_shutdown_requested():
            time.sleep(_WATCH_PERIOD_S)
            if self._watchdog is not None:
                self.guarded(self._watchdog)(time.monotonic())
            self.diagnostics.on_terminal("nothing is kept for a restart", self.life.problem)
            self.diagnostics.on_terminal("the clock stands", unless_busy(self.lock, self.waits_for))
            self.dropping(lambda _: self.diagnostics.report_news())(None)
