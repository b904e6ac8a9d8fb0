"""A spinning lidar's messages: its PointCloud2, with the fields that drivers of Velodyne lidars give, and the level scan made of it."""

import math
import sys

import numpy as np
import rospy
from numpy.typing import NDArray
from sensor_msgs.msg import LaserScan, PointCloud2, PointField

from ros_adapters.conversions import header
from sweep_assembly import LEVEL_BEAMS, LidarConfig, Revolution

_NUMPY_TYPE = {PointField.UINT8: "u1", PointField.UINT16: "<u2", PointField.FLOAT32: "<f4"}
_NAMES = ["x", "y", "z", "ring", "time"]
_LAYOUT = np.dtype({"names": _NAMES, "formats": ["<f4", "<f4", "<f4", "<u2", "<f4"], "offsets": [0, 4, 8, 12, 14], "itemsize": 18})
_FIELDS = [
    *(PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate("xyz")),
    PointField("ring", 12, PointField.UINT16, 1),
    PointField("time", 14, PointField.FLOAT32, 1),
]


def sensor_is_spinning(node: str) -> bool:
    """Whether the parameter /sensor says that a spinning lidar is in the laser's place; exit code 2 when it says neither."""
    sensor = str(rospy.get_param("/sensor", "tilting"))
    if sensor not in ("tilting", "spinning"):
        sys.stderr.write(f"{node}: wrong parameter: /sensor = {sensor!r} is none of tilting, spinning\n")
        sys.exit(2)
    return sensor == "spinning"


def revolution_message(
    stamp_s: float, frame: str, points: NDArray[np.floating], rings: NDArray[np.integer], times_s: NDArray[np.floating]
) -> PointCloud2:
    """(N, 3) points in the laser's `frame`, NaN for beams that met nothing, their (N,) rings and seconds after the stamp."""
    table = np.zeros(len(points), _LAYOUT)
    for i, name in enumerate("xyz"):
        table[name] = points[:, i]
    table["ring"], table["time"] = rings, times_s
    return PointCloud2(
        header=header(stamp_s, frame),
        height=1,
        width=len(table),
        fields=_FIELDS,
        is_bigendian=False,
        point_step=_LAYOUT.itemsize,
        row_step=table.nbytes,
        data=table.tobytes(),
        is_dense=False,
    )


def revolution_of(message: PointCloud2, frame: str) -> Revolution:
    """The beams of a cloud; ValueError for another frame than `frame`, without x y z ring time, or a cut buffer."""
    if message.header.frame_id != frame:
        raise ValueError(f"cloud in frame {message.header.frame_id!r}, expected {frame!r}")
    found = {f.name: f for f in message.fields if f.datatype in _NUMPY_TYPE}
    missing = [name for name in _NAMES if name not in found]
    if missing:
        raise ValueError(f"cloud without fields {', '.join(missing)}")
    fields = [found[name] for name in _NAMES]
    count, formats = message.width * message.height, [_NUMPY_TYPE[f.datatype] for f in fields]
    reach = max(f.offset + np.dtype(kind).itemsize for f, kind in zip(fields, formats, strict=True))
    if message.is_bigendian or len(message.data) < count * message.point_step or message.point_step < reach:
        raise ValueError(f"cloud of {count} points with {len(message.data)} bytes of step {message.point_step} cannot be read")
    layout = np.dtype({"names": _NAMES, "formats": formats, "offsets": [f.offset for f in fields], "itemsize": message.point_step})
    table = np.frombuffer(message.data, layout, count)
    points = np.stack([table[name] for name in "xyz"], axis=1).astype(np.float32)
    points[~np.isfinite(points).all(axis=1)] = np.nan
    return Revolution(points, table["ring"].astype(np.uint16), table["time"].astype(np.float64))


def level_scan_message(end_stamp_s: float, frame: str, ranges: NDArray[np.float32], lidar: LidarConfig, range_max: float) -> LaserScan:
    """(450,) ranges around the laser's `frame` as it stood at `end_stamp_s`, its stamp: no beam is later."""
    step = 2.0 * math.pi / LEVEL_BEAMS
    return LaserScan(
        header=header(end_stamp_s, frame),
        angle_min=-math.pi + step / 2,
        angle_max=math.pi - step / 2,
        angle_increment=step,
        time_increment=0.0,
        scan_time=lidar.duration_s,
        range_min=0.0,
        range_max=range_max,
        ranges=ranges.tolist(),
    )
