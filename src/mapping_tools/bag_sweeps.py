"""Sweeps that a bag holds as clouds: sensor_msgs/PointCloud2 joined with nav_msgs/Odometry by stamp, as pose_graph_mapping_node does it."""

from __future__ import annotations

import math
from bisect import insort
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from mapping_tools.bag_records import BagMessage
from mapping_tools.messages import CLOUD_TYPE, ODOMETRY_TYPE, OdometryMessage, Stamped, frame_of, odometry_pose, stamp_s_of
from mapping_tools.recording import Recording
from mapping_tools.sweep_sources import LeftOut, Mount, SourceSweep, UnknownWays, Unreadable, never
from point_cloud2 import read_points
from rigid_geometry import OdometryHistory

Array = NDArray[np.float64]

TRACKED = "/odom_tracked"
MOST_WAITING_BYTES = 500_000_000  # 24 s of a lidar of 1.3 million points a second, each of 16 bytes
_NOT_REACHED = "odometry does not reach its stamp"
_Gravity = tuple[Array, float] | None


@dataclass(frozen=True)
class BagTopics:
    """Where clouds and odometry are; odometry None: there is none. `up`: odometry whose roll and pitch are gravity's; None: the same."""

    cloud: str = "/sweep_cloud"
    odometry: str | None = "/odom"
    up: str | None = None

    def tracked(self, recorded: Collection[str]) -> BagTopics:
        """With the tracked odometry, where a robot recorded it and no other is named: its clouds were de-skewed by it."""
        is_tracked = self.odometry == BagTopics.odometry and TRACKED in recorded
        return replace(self, odometry=TRACKED, up=self.odometry) if is_tracked else self


def gravity_of(T_odom_base: Array, covariance: Array) -> _Gravity:
    """Up in base_link and its sigma in radians, as the odometry's roll and pitch know it; None where its covariance (36,) knows nothing."""
    variance = max(covariance[21], covariance[28])
    return (T_odom_base[2, :3].copy(), math.sqrt(variance)) if 0.0 < variance < math.inf else None


class _WrongFrameError(ValueError):
    """Of a first cloud it says that a mount is missing, of a later one that this is another sensor's."""


@dataclass(frozen=True, eq=False)
class _Waiting:
    """A cloud until odometry reaches its stamp."""

    name: str
    stamp_s: float
    message: Any

    @property
    def size(self) -> int:
        """Bytes of its points."""
        return len(self.message.data)

    def given_up(self, reason: str) -> Unreadable:
        return Unreadable(self.name, self.stamp_s, reason)


class BagSweeps:
    """See `SweepSource`. A cloud waits for odometry that reaches its stamp; clouds in another frame than its child's need T_base_cloud."""

    def __init__(self, recording: Recording, topics: BagTopics, T_base_cloud: Array | None, sensor: Array | None) -> None:
        """ValueError when a topic is not there or holds something else."""
        self._bag, self._topics, self._T_base_cloud = recording, topics, T_base_cloud
        self._sensor = np.zeros(3) if sensor is None else sensor
        self._odometry, self._child_frame, self._ways = OdometryHistory[_Gravity](), "", UnknownWays()
        self._odometry_s, self._waiting = -math.inf, list[_Waiting]()  # by their stamps
        self._clouds, self._joined_one, self._left_out = 0, False, LeftOut()
        recording.check(topics.cloud, CLOUD_TYPE)
        if topics.odometry is not None:
            recording.check(topics.odometry, ODOMETRY_TYPE, "; --no-odometry maps without")

    @property
    def problem(self) -> str | None:
        return self._bag.problem

    @property
    def progress(self) -> float:
        return self._bag.progress

    @property
    def notes(self) -> list[str]:
        """Odometry that was left out, and why."""
        return self._left_out.notes

    def sweeps(self, is_stopping: Callable[[], bool] = never) -> Iterator[SourceSweep | Unreadable]:
        """As odometry reaches their stamps, and in the order of these where it reaches several at once.

        ValueError when there is no cloud, or the first needs a mount.
        """
        topics = {self._topics.cloud, self._topics.odometry or "", self._topics.up or ""}
        for record in self._bag.messages(topics, is_stopping):
            if record.topic == self._topics.cloud:
                yield from self._take_cloud(record)
                yield from self._reached()
                yield from self._too_many()
            else:
                yield from self._take_odometry(record)
                yield from self._reached()
        if not self._clouds:
            raise ValueError(f"topic {self._topics.cloud} is in it without a message")
        yield from (cloud.given_up(_NOT_REACHED) for cloud in self._waiting)

    def _take_cloud(self, record: BagMessage) -> Iterator[Unreadable]:
        self._clouds += 1
        name = f"{self._topics.cloud} {self._clouds - 1}"
        try:
            message = record.message()
        except ValueError as error:
            yield Unreadable(name, None, str(error))
            return
        insort(self._waiting, _Waiting(name, stamp_s_of(cast(Stamped, message)), message), key=lambda cloud: cloud.stamp_s)

    def _reached(self) -> Iterator[SourceSweep | Unreadable]:
        """Each is decided by its own stamp, which may be a bad one, so that none holds up others."""
        due = list(takewhile(lambda cloud: self._topics.odometry is None or self._odometry.reaches(cloud.stamp_s), self._waiting))
        del self._waiting[: len(due)]
        yield from (self._joined(cloud) for cloud in due)

    def _too_many(self) -> Iterator[Unreadable]:
        """Those that are farthest ahead of the odometry, whose stamps may be bad, are given up where too many wait."""
        surplus = sum(cloud.size for cloud in self._waiting) - MOST_WAITING_BYTES
        while surplus > 0:
            surplus -= self._waiting[-1].size
            yield self._waiting.pop().given_up(f"more clouds than {MOST_WAITING_BYTES / 1e6:.0f} MB wait for odometry")

    def _lose_waiting(self, stamp_s: float) -> Iterator[Unreadable]:
        """Clouds from before the clock was set back to a stamp: where they were made nobody knows any more."""
        late = [cloud for cloud in self._waiting if cloud.stamp_s > stamp_s]
        self._waiting = [cloud for cloud in self._waiting if cloud not in late]
        yield from (cloud.given_up("the clock was set back before odometry reached its stamp") for cloud in late)

    def _take_odometry(self, record: BagMessage) -> Iterator[Unreadable]:
        """A message that is damaged and a pose that is none are left out and counted, as the node does it."""
        try:
            message = cast(OdometryMessage, record.message())
            T_odom_base = odometry_pose(message)
            is_newer = record.topic == self._topics.odometry and self._odometry.add_pose(stamp_s_of(message), T_odom_base)
        except ValueError as error:
            self._left_out.add(record.topic, error)
            return
        self._child_frame = message.child_frame_id.lstrip("/")
        if is_newer:
            if stamp_s_of(message) < self._odometry_s:
                yield from self._lose_waiting(stamp_s_of(message))
            self._odometry_s = stamp_s_of(message)
            self._ways.add(stamp_s_of(message), np.asarray(message.pose.covariance))
        if record.topic == (self._topics.up or self._topics.odometry):
            self._odometry.add_up(stamp_s_of(message), gravity_of(T_odom_base, message.pose.covariance))

    def _joined(self, cloud: _Waiting) -> SourceSweep | Unreadable:
        name, stamp_s, message = cloud.name, cloud.stamp_s, cloud.message
        try:
            mount = self._mount_of(frame_of(message))
            table = read_points(message)
            points, origins = mount.placed(table.points, table.origins)
            T_odom_base, gravity = (None, None) if self._topics.odometry is None else self._odometry.at(stamp_s)
        except _WrongFrameError as error:
            if not self._joined_one:
                raise
            return Unreadable(name, stamp_s, str(error))
        except ValueError as error:
            return Unreadable(name, stamp_s, str(error))
        self._joined_one = True
        up, sigma = gravity or (None, None)
        lost = self._ways.until(stamp_s)
        return SourceSweep(name, stamp_s, points, origins, T_odom_base, up, sigma, lost=lost)

    def _mount_of(self, frame: str) -> Mount:
        if self._T_base_cloud is not None:
            return Mount(self._T_base_cloud, self._sensor)
        if self._topics.odometry is not None and frame != self._child_frame:
            raise _WrongFrameError(f"clouds are in frame {frame!r}, odometry is of {self._child_frame!r}: --mount has to say how they lie")
        return Mount(np.eye(4), self._sensor)
