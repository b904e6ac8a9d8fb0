"""A spinning lidar's messages: its PointCloud2, with the fields that drivers of Velodyne lidars give, and the level scan made of it."""

import math
import sys

import numpy as np
import rospy
from numpy.typing import NDArray
from sensor_msgs.msg import LaserScan, PointCloud2, PointField

from point_cloud2 import read_beams
from ros_adapters.conversions import header, stamp_of
from sweep_assembly import LEVEL_BEAMS, LidarConfig, Revolution

_NAMES = ["x", "y", "z", "ring", "time"]
_LAYOUT = np.dtype({"names": _NAMES, "formats": ["<f4", "<f4", "<f4", "<u2", "<f4"], "offsets": [0, 4, 8, 12, 14], "itemsize": 18})
_FIELDS = [
    *(PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate("xyz")),
    PointField("ring", 12, PointField.UINT16, 1),
    PointField("time", 14, PointField.FLOAT32, 1),
]


def sensor_is_spinning(node: str) -> bool:
    """Whether the parameter /sensor says that a spinning lidar is in the laser's place; exit code 2 when it says neither."""
    sensor = str(rospy.get_param("sensor", "tilting"))
    if sensor not in ("tilting", "spinning"):
        sys.stderr.write(f"{node}: wrong parameter: {rospy.resolve_name('sensor')} = {sensor!r} is none of tilting, spinning\n")
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
    """The beams of a cloud; ValueError for another frame than `frame`, without rings or times, or when it cannot be read."""
    if message.header.frame_id.lstrip("/") != frame:
        raise ValueError(f"cloud in frame {message.header.frame_id!r}, expected {frame!r}")
    return Revolution.of(read_beams(message, stamp_of(message)))


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
