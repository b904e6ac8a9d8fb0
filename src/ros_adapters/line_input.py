"""Single lines of a laser, or revolutions of a lidar, as a node hears them: for who cannot wait for the end of a sweep."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import LaserScan, PointCloud2

from mount_calibration import TiltGeometry
from ros_adapters.conversions import scan_of, stamp_of
from ros_adapters.node import SILENT_AFTER_S, Node
from ros_adapters.revolution_messages import revolution_of, sensor_is_spinning
from ros_adapters.tilt_input import TiltInput
from sweep_assembly import LaserScans, LidarConfig, LidarRevolutions, Line, LineSource, SweepAssemblyConfig


class LineInput:
    """Subscribes what lines are made of, but for the odometry, which the node has."""

    def __init__(self, node: Node, lidar: LidarConfig, tilt_joint: str | None, mount: TiltGeometry, laser_frame: str) -> None:
        """`lidar`: where one spins in the laser's place; `tilt_joint` and `mount` are `mount_of_laser`'s."""
        spinning, self._laser_frame = sensor_is_spinning(node.name), laser_frame
        sensor = LidarRevolutions(lidar) if spinning else LaserScans()
        self._lines: LineSource[Any] = LineSource(SweepAssemblyConfig(), mount, sensor)
        self._tilt = TiltInput(node, tilt_joint, self._lines.add_joint)
        self.topics = (*self._tilt.topics, "points_filtered" if spinning else "scan_filtered")
        if spinning:
            node.subscribe("points_filtered", PointCloud2, self._on_points, silent_after_s=SILENT_AFTER_S)
        else:
            node.subscribe("scan_filtered", LaserScan, self._on_scan, silent_after_s=SILENT_AFTER_S)

    def add_odometry(self, stamp_s: float, T_odom_base: NDArray[np.float64]) -> None:
        """The (4, 4) pose of base_link at a time."""
        self._lines.add_odometry(stamp_s, T_odom_base)
        self._tilt.add_odometry(stamp_s)

    def poll(self) -> Iterator[Line]:
        """Lines, in odom, that are complete by now."""
        return self._lines.poll()

    def _on_scan(self, message: LaserScan) -> None:
        self._lines.add_reading(stamp_of(message), scan_of(message))

    def _on_points(self, message: PointCloud2) -> None:
        self._lines.add_reading(stamp_of(message), revolution_of(message, self._laser_frame))
