"""Whether the robot maps, while it drives or not, and is tracked on the map, and when the results of a sweep take effect then."""

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import rospy

from stage_config import ConfigError, check_below, check_ranges, load_config, parameter

STOP_AND_GO, DRIVING, OFF = MODES = ("stop_and_go", "driving", "off")


@dataclass(frozen=True)
class ResultTimes:
    """When what comes of a sweep takes effect while the robot drives in lock-step; all nodes share it."""

    after_s: float = parameter(0.5, "s", "after a sweep's end; a robot's computer takes as long for most of them", low=0.05, high=10.0)
    cloud_within_s: float = parameter(0.3, "s", "of its end a sweep's cloud is out", low=0.0, high=10.0)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self) + check_below(self, "cloud_within_s", "after_s")


def result_times(node: str) -> ResultTimes:
    """What /results says; a wrong value ends the node with exit code 2."""
    try:
        return load_config(ResultTimes, rospy.get_param("results", {}))
    except ConfigError as error:
        sys.stderr.write(f"{node}: wrong parameter: {'; '.join(str(error).splitlines())}\n")
        sys.exit(2)


def mapping_mode(node: str) -> str:
    """What /mapping says, or stop_and_go; a wrong value ends the node with exit code 2."""
    mode = str(rospy.get_param("mapping", STOP_AND_GO))
    if mode not in MODES:
        sys.stderr.write(f"{node}: wrong parameter: {rospy.resolve_name('mapping')} is {mode!r}, not one of {', '.join(MODES)}\n")
        sys.exit(2)
    return mode


def maps_while_driving(node: str) -> bool:
    """Whether sweeps are made while the robot drives; those of a robot that is only localised are, too."""
    return mapping_mode(node) != STOP_AND_GO


def only_localises(node: str) -> bool:
    """Whether `mapping_mode` is off: the robot is localised in a finished map, which stays as it is, and explores nothing."""
    return mapping_mode(node) == OFF


def finished_map(node: str) -> Path:
    """The folder that /finished_map names, for a robot that is only localised; one that holds no map ends the node with exit code 2."""
    folder = Path(str(rospy.get_param("finished_map", "")))
    if not (folder / "sweeps/index.json").is_file():
        asked = f"{rospy.resolve_name('finished_map')} {str(folder)!r}"
        sys.stderr.write(f"{node}: wrong parameter: {asked} holds no sweeps/index.json: name the folder of a run\n")
        sys.exit(2)
    return folder


def is_tracking() -> bool:
    """Whether scan_tracking_node stands between the odometry and who uses it, as /tracking says."""
    return bool(rospy.get_param("tracking", False))


def odometry_topic() -> str:
    """Where the robot's odometry is: as tracked on the map, or as fused."""
    return "odom_tracked" if is_tracking() else "odom"


class Results:
    """Results of sweeps. In lock-step, while the robot drives, each waits for its time, so that no run depends on a machine's haste."""

    def __init__(self, times: ResultTimes, *, lockstep: bool, driving: bool) -> None:
        self._delay_s = times.after_s if lockstep and driving else 0.0
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

    def __init__(self, times: ResultTimes, *, driving: bool) -> None:
        self._patience_s = times.after_s - times.cloud_within_s if driving else 0.0
        self._seen_s: list[float] = []
        self._decided = 0
        self._given_up_s = -math.inf

    def tick(self, stamp_s: float, clouds: int) -> None:
        """`clouds` were out by the end of a tick."""
        self._seen_s += [stamp_s] * (clouds - len(self._seen_s))

    def decide(self, swept_s: float) -> None:
        """There is a decision about one more of them, whose sweep ended then."""
        self._decided += swept_s > self._given_up_s

    def give_up(self) -> None:
        """Nobody waits any longer for a decision about one that is out."""
        self._decided = max(self._decided, len(self._seen_s))
        self._given_up_s = self._seen_s[-1] if self._seen_s else -math.inf

    def must_be_decided(self, stamp_s: float) -> bool:
        """Whether a tick may not be answered before the next decision."""
        oldest_s = self._seen_s[self._decided] if self._decided < len(self._seen_s) else math.inf
        return oldest_s + self._patience_s <= stamp_s + 1e-6
