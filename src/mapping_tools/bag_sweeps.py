"""Sweeps of a rosbag 1: sensor_msgs/PointCloud2 joined with nav_msgs/Odometry by their stamps, as pose_graph_mapping_node does it."""

from __future__ import annotations

import math
import struct
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from mapping_tools.bag_records import BagMessage, BagRecords
from mapping_tools.sweep_sources import Mount, SourceSweep, Unreadable
from rigid_geometry import PoseHistory, transform_from_quat

Array = NDArray[np.float64]

CLOUD_TYPE, ODOMETRY_TYPE = "sensor_msgs/msg/PointCloud2", "nav_msgs/msg/Odometry"
_FLOATS = {7: "<f4", 8: "<f8"}  # sensor_msgs/PointField
_POINT, _ORIGIN = ("x", "y", "z"), ("vp_x", "vp_y", "vp_z")
_KEPT_GRAVITIES = 400


@dataclass(frozen=True)
class BagTopics:
    """Where clouds and odometry are; odometry None: there is none."""

    cloud: str = "/sweep_cloud"
    odometry: str | None = "/odom"


class CloudField(Protocol):
    """A PointField."""

    name: str
    datatype: int
    offset: int


class CloudMessage(Protocol):
    """A PointCloud2, of whichever library."""

    fields: Sequence[CloudField]
    width: int
    height: int
    point_step: int
    row_step: int
    is_bigendian: bool
    data: bytes


def cloud_columns(message: CloudMessage) -> tuple[Array, Array | None]:
    """(N, 3) points of a PointCloud2 and, where it has vp_x, vp_y, vp_z, the starts of their beams; ValueError when it cannot be read."""
    layout = {f.name: (_FLOATS[f.datatype], f.offset) for f in message.fields if f.datatype in _FLOATS}
    missing = [name for name in _POINT if name not in layout]
    if missing:
        raise ValueError(f"a cloud without float fields {', '.join(missing)}")
    names = _POINT + _ORIGIN if set(_ORIGIN) <= set(layout) else _POINT
    count, data = message.width * message.height, bytes(message.data)
    step, row_step = message.point_step, message.row_step or message.point_step * message.width
    ends = max(layout[name][1] + int(layout[name][0][-1]) for name in names)
    if message.is_bigendian or step < ends or row_step < step * message.width or len(data) < row_step * message.height or not count:
        raise ValueError(f"a cloud of {message.height} x {message.width} points of {step} bytes in {len(data)} bytes")
    rows = np.frombuffer(data, np.uint8, row_step * message.height).reshape(message.height, row_step)[:, : step * message.width]
    formats, offsets = zip(*(layout[name] for name in names), strict=True)
    record = np.dtype({"names": list(names), "formats": list(formats), "offsets": list(offsets), "itemsize": step})
    table = np.ascontiguousarray(rows).reshape(-1).view(record)
    columns = np.stack([table[name].astype(np.float64) for name in names], axis=1)
    return columns[:, :3], columns[:, 3:] if len(names) > 3 else None


def gravity_of(T_odom_base: Array, covariance: Array) -> tuple[Array, float] | None:
    """Up in base_link and its sigma in radians, as the odometry's roll and pitch know it; None where its covariance (36,) knows nothing."""
    variance = max(covariance[21], covariance[28])
    return (T_odom_base[2, :3].copy(), math.sqrt(variance)) if 0.0 < variance < math.inf else None


class BagSweeps:
    """See `SweepSource`. A cloud waits for odometry that reaches its stamp; clouds in another frame than its child's need T_base_cloud."""

    def __init__(self, path: Path, topics: BagTopics, T_base_cloud: Array | None, sensor: Array | None) -> None:
        """ValueError when the file is no bag, OSError when it cannot be opened."""
        self._bag, self._topics, self._T_base_cloud = BagRecords(path), topics, T_base_cloud
        self._sensor = np.zeros(3) if sensor is None else sensor
        self._types = get_typestore(Stores.ROS1_NOETIC)
        self._odometry, self._child_frame = PoseHistory(), ""
        self._gravities: deque[tuple[float, tuple[Array, float] | None]] = deque(maxlen=_KEPT_GRAVITIES)
        self._clouds = 0

    notes: tuple[str, ...] = ()

    @property
    def problem(self) -> str | None:
        return self._bag.problem

    @property
    def progress(self) -> float:
        return self._bag.position / self._bag.size

    def sweeps(self) -> Iterator[SourceSweep | Unreadable]:
        """In the order of the bag; ValueError when a topic is not there or holds something else."""
        waiting: deque[tuple[str, Any]] = deque()
        with self._bag:
            for record in self._bag.messages():
                if record.topic == self._topics.cloud:
                    self._clouds += 1
                    name, message = f"{self._topics.cloud} {self._clouds - 1}", self._message(record, CLOUD_TYPE)
                    if message is None:
                        yield Unreadable(name, None, "the message is damaged")
                        continue
                    waiting.append((name, message))
                elif record.topic == self._topics.odometry:
                    self._take_odometry(self._message(record, ODOMETRY_TYPE))
                while waiting and (self._topics.odometry is None or self._odometry.reaches(_stamp_s(waiting[0][1]))):
                    yield self._joined(*waiting.popleft())
            self._check_topics()
            for name, message in waiting:
                yield Unreadable(name, _stamp_s(message), "odometry does not reach its stamp")

    def _message(self, record: BagMessage, wanted: str) -> Any:
        if record.msgtype != wanted:
            raise ValueError(f"topic {record.topic} holds {record.msgtype}, not {wanted}")
        try:
            return self._types.deserialize_ros1(record.data, record.msgtype)
        except (SerdeError, struct.error, IndexError, ValueError, AssertionError):
            return None

    def _take_odometry(self, message: Any) -> None:
        """A message that is damaged and a pose that is none are left out, as the node does it."""
        if message is None:
            return
        p, q = message.pose.pose.position, message.pose.pose.orientation
        try:
            T_odom_base = transform_from_quat((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))
            self._odometry.add(_stamp_s(message), T_odom_base)
        except ValueError:
            return
        self._child_frame = message.child_frame_id.lstrip("/")
        if self._gravities and _stamp_s(message) <= self._gravities[-1][0]:
            self._gravities.clear()
        self._gravities.append((_stamp_s(message), gravity_of(T_odom_base, message.pose.covariance)))

    def _joined(self, name: str, message: Any) -> SourceSweep | Unreadable:
        stamp_s = _stamp_s(message)
        mount = self._mount_of(message.header.frame_id.lstrip("/"))
        try:
            points, origins = mount.placed(*cloud_columns(message))
            if self._topics.odometry is None:
                return SourceSweep(name, stamp_s, points, origins)
            T_odom_base = np.asarray(self._odometry.at(stamp_s))
        except ValueError as error:
            return Unreadable(name, stamp_s, str(error))
        up, sigma = next((g for s, g in self._gravities if s >= stamp_s - 1e-6), None) or (None, None)
        return SourceSweep(name, stamp_s, points, origins, T_odom_base, up, sigma)

    def _mount_of(self, frame: str) -> Mount:
        if self._T_base_cloud is not None:
            return Mount(self._T_base_cloud, self._sensor)
        if self._topics.odometry is not None and frame != self._child_frame:
            raise ValueError(f"clouds are in frame {frame!r}, odometry is of {self._child_frame!r}: --mount has to say how they lie")
        return Mount(np.eye(4), self._sensor)

    def _check_topics(self) -> None:
        there = ", ".join(sorted(self._bag.topics)) or "none"
        if not self._clouds:
            raise ValueError(f"no cloud on topic {self._topics.cloud}; topics in it: {there}")
        if self._topics.odometry is not None and self._topics.odometry not in self._bag.topics:
            raise ValueError(f"no odometry on topic {self._topics.odometry}; topics in it: {there}; --no-odometry maps without")


def _stamp_s(message: Any) -> float:
    return float(message.header.stamp.sec) + 1e-9 * float(message.header.stamp.nanosec)
