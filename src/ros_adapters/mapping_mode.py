"""Whether the robot maps while it drives, and when the results of a sweep take effect then."""

import math
import sys
from collections.abc import Callable

import rospy

MODES = ("stop_and_go", "driving")
RESULTS_AFTER_S = 0.5  # a sweep's end; a robot's computer takes as long for most of them
CLOUD_WITHIN_S = 0.3  # of its end a sweep's cloud is out


def maps_while_driving(node: str) -> bool:
    """What /mapping says; a wrong value ends the node with exit code 2."""
    mode = rospy.get_param("/mapping", MODES[0])
    if mode not in MODES:
        sys.stderr.write(f"{node}: wrong parameter: /mapping is {mode!r}, not one of {', '.join(MODES)}\n")
        sys.exit(2)
    return bool(mode == "driving")


class Results:
    """Results of sweeps. In lock-step, while the robot drives, each waits for its time, so that no run depends on a machine's haste."""

    def __init__(self, *, lockstep: bool, driving: bool) -> None:
        self._delay_s = RESULTS_AFTER_S if lockstep and driving else 0.0
        self._waiting: list[tuple[float, Callable[[], None]]] = []

    def add(self, swept_s: float, take: Callable[[], None]) -> None:
        """`take` is what the result of the sweep that ended at `swept_s` does: now, or when its time has come."""
        if self._delay_s:
            self._waiting.append((swept_s + self._delay_s, take))
        else:
            take()

    def take_until(self, now_s: float) -> None:
        """Takes those whose time has come by `now_s`, in the order in which they came."""
        due = [take for due_s, take in self._waiting if due_s <= now_s + 1e-6]
        self._waiting = [(due_s, take) for due_s, take in self._waiting if due_s > now_s + 1e-6]
        for take in due:
            take()


class OpenSweeps:
    """Sweeps whose clouds are out and about which nothing is decided yet, as a tick's counts tell."""

    def __init__(self, *, driving: bool) -> None:
        self._patience_s = RESULTS_AFTER_S - CLOUD_WITHIN_S if driving else 0.0
        self._seen_s: list[float] = []
        self._decided = 0

    def tick(self, stamp_s: float, clouds: int) -> None:
        """`clouds` were out by the end of a tick."""
        self._seen_s += [stamp_s] * (clouds - len(self._seen_s))

    def decide(self) -> None:
        """There is a decision about one more of them."""
        self._decided += 1

    def must_be_decided(self, stamp_s: float) -> bool:
        """Whether a tick may not be answered before the next decision."""
        oldest_s = self._seen_s[self._decided] if self._decided < len(self._seen_s) else math.inf
        return oldest_s + self._patience_s <= stamp_s + 1e-6
