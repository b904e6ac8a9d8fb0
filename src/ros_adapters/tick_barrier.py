"""The barrier of a simulation in lock-step: a tick ends when all nodes have answered it, and the command is what they answered.

While a node is away the clock stands; when it is ready again, the last tick is told once more, as a recount.
"""

import math
import sys
import threading
import time
from collections.abc import Callable, Iterable
from functools import partial

import rospy
from explore_3dnav.msg import SimulationTick
from geometry_msgs.msg import Twist
from std_msgs.msg import String

from pybullet_simulation import TICK_S, Simulation
from ros_adapters.connections import heard_publishers
from ros_adapters.diagnostics import Diagnostics
from ros_adapters.kernel_loading import LOADING_TOPIC
from ros_adapters.node import READY_TOPIC, TICK_TOPIC
from ros_adapters.simulation_messages import TickPublisher
from ros_adapters.tick_answers import COMMAND_TOPIC, TickAnswers

_MOST_TICKS_AHEAD = 4  # of the answers, while the robot stands and its laser sweeps: any more, and queues downstream could fill
_CONNECTED_S = 0.3  # the publishers' side of a connection is complete a moment after the subscriber's
_RECOUNT_AGAIN_S = 3.0  # a tick soon after a node came back waits no longer for a message that went to a connection not yet made
_SOON_TICKS = 40
_MOST_WAITS = 3.0  # for a tick: so many timeouts, however many nodes come back meanwhile
_TRACKER = "scan_tracking_node"  # what it makes of a scan hangs on when the scan comes: it hears of no tick before its time
_WITNESS = "exploration_monitor_node"  # what it does not hear of a run nobody can judge
_LAST_OF_SWEEP_S = 0.5  # answered tick by tick again, so that nobody has heard of the time after a sweep before its map
_STANDS = (0.0, 0.0)


class TickBarrier:
    """Of one simulation. `changed` guards the simulation, too: its services take it."""

    def __init__(self, simulation: Simulation, publish: TickPublisher, diagnostics: Diagnostics, wait_for: Iterable[str]) -> None:
        """wait_for: names of the nodes without which it does not begin."""
        self.changed = threading.Condition()
        self._simulation, self._publish, self._diagnostics = simulation, publish, diagnostics
        self._wait_for = set(wait_for)
        self._most_ahead = 0 if _TRACKER in self._wait_for else _MOST_TICKS_AHEAD
        self._ready: set[str] = set()
        self._loading_s = time.monotonic()  # when a node last said that it loads its kernels
        self._answered = TickAnswers()
        self._command = _STANDS
        self._ticks = 0
        self._newcomer_s = math.inf  # by the steady clock, when a node that was away is there
        self._recounted_tick = self._came_back_tick = -_SOON_TICKS
        self._witnessed = (0, 0) if _WITNESS in self._wait_for else None  # tick and recount that the judge's ear has heard of
        heard = [(COMMAND_TOPIC, Twist, self._on_command), ("simulation/tick_done", SimulationTick, self._on_tick_done)]
        if self._witnessed is not None:
            heard.append((f"{TICK_TOPIC}/{_WITNESS}", SimulationTick, self._on_witness))
        self._answers = [rospy.Subscriber(*topic, queue_size=None, tcp_nodelay=True) for topic in heard]
        rospy.Subscriber(READY_TOPIC, String, self._on_ready, queue_size=20)
        rospy.Subscriber(LOADING_TOPIC, String, self._on_loading, queue_size=20)

    def take_command(self) -> tuple[float, float] | None:
        """The newest command (m/s, rad/s) for the tick that begins, once; None when none has come since."""
        self._ticks += 1
        return self._answered.take_command()

    def wait_for_nodes(self, timeout_s: float) -> None:
        """Until all are ready and connected; the process ends with 1 when none has loaded anything for `timeout_s`."""

        def given_up() -> bool:
            return time.monotonic() > self._loading_s + timeout_s

        self._wait_until(lambda: self._all_connected() or given_up(), math.inf)
        if not self._all_connected():
            missing = sorted(self._wait_for - self._ready) or ["stop_scan_and_go_node's topics"]
            self._fail(f"not ready after {timeout_s:.0f} s: {', '.join(missing)}")
        time.sleep(_CONNECTED_S)

    def wait_for_answer(self, timeout_s: float) -> None:
        """Until the last tick is answered, told anew to a node that comes back; the process ends with 1 when none has for `timeout_s`.

        Nor is it waited for longer than `_MOST_WAITS` of that: what comes back again and again does not get on.
        """
        deadline_s, last_s = (time.monotonic() + n * timeout_s for n in (1.0, _MOST_WAITS))
        while True:
            is_soon = self._ticks - self._came_back_tick < _SOON_TICKS
            again_s = time.monotonic() + _RECOUNT_AGAIN_S if is_soon else math.inf
            if not self._wait_until(partial(self._is_over, again_s), deadline_s - time.monotonic()):
                break
            if self._is_answered() and time.monotonic() < self._newcomer_s:
                return
            if time.monotonic() >= self._newcomer_s:  # one is back: others may be away yet
                deadline_s = min(time.monotonic() + timeout_s, last_s)
            self._recount()
        waited_s = time.monotonic() - last_s + _MOST_WAITS * timeout_s
        self._fail(f"tick {self._ticks} at {self._simulation.stamp_s:.2f} s was not answered within {waited_s:.0f} s: {self._answered}")

    def _on_command(self, message: Twist) -> None:
        command = (message.linear.x, message.angular.z)
        with self.changed:
            if not all(map(math.isfinite, command)):  # an answer all the same, by which the robot stands
                self._diagnostics.dropped("bad Twist", f"{command} is no command")
                command = _STANDS
            self._command = command
            self._answered.add_command(*command)
            self.changed.notify()

    def _on_tick_done(self, message: SimulationTick) -> None:
        with self.changed:
            tick = self._tick_of(message)
            if 0 < tick <= self._ticks:
                try:
                    self._answered.add_answer(tick, message.topics, message.counts, message.recount)
                except ValueError as error:
                    self._diagnostics.dropped("bad SimulationTick", str(error))
                self.changed.notify()

    def _on_witness(self, message: SimulationTick) -> None:
        with self.changed:
            self._witnessed = self._tick_of(message), message.recount
            self.changed.notify()

    def _on_ready(self, message: String) -> None:
        with self.changed:
            if self._ticks and message.data in self._ready:
                self._newcomer_s = time.monotonic() + _CONNECTED_S
            self._ready.add(message.data)
            self.changed.notify()

    def _on_loading(self, _message: String) -> None:
        self._loading_s = time.monotonic()

    def _tick_of(self, message: SimulationTick) -> int:
        return self._ticks - int(round((self._simulation.stamp_s - message.header.stamp.to_sec()) / TICK_S))

    def _all_connected(self) -> bool:
        return self._wait_for <= self._ready and all(heard_publishers(s) for s in self._answers)

    def _ticks_ahead(self) -> int:
        """How many answers may be missing: a robot that stands for a sweep gets the same command from each."""
        is_sweeping = self._command == _STANDS and self._simulation.sweep_left_s > _LAST_OF_SWEEP_S
        return self._most_ahead if is_sweeping and self._recounted_tick != self._ticks else 0

    def _is_answered(self) -> bool:
        heard = self._witnessed
        witnessed = heard is None or (heard[0] >= self._ticks - _MOST_TICKS_AHEAD and heard[1] == self._publish.recounts)
        return witnessed and self._answered.holds(self._ticks - self._ticks_ahead(), self._publish.recounts)

    def _is_over(self, again_s: float) -> bool:
        return self._is_answered() or time.monotonic() >= min(again_s, self._newcomer_s)

    def _recount(self) -> None:
        with self.changed:
            if time.monotonic() >= self._newcomer_s:
                self._newcomer_s, self._came_back_tick = math.inf, self._ticks
            self._recounted_tick = self._ticks
        self._publish.recount()

    def _wait_until(self, done: Callable[[], bool], timeout_s: float) -> bool:
        deadline = time.monotonic() + timeout_s
        with self.changed:
            while not done():
                left = deadline - time.monotonic()
                if left <= 0 or rospy.is_shutdown():
                    return False
                self.changed.wait(min(left, 0.2))
        return True

    def _fail(self, text: str) -> None:
        if not rospy.is_shutdown():
            rospy.logfatal(text)
            sys.stderr.write(f"pybullet_sim_node: {text}\n")
            sys.exit(1)
