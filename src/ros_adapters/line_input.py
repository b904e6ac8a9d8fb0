"""Single lines of a laser, or revolutions of a lidar, as a node hears them: for who cannot wait for the end of a sweep."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import rospy
from numpy.typing import NDArray
from sensor_msgs.msg import LaserScan, PointCloud2

from mount_calibration import TiltGeometry
from rigid_geometry import JUMP_BACK_S
from ros_adapters.conversions import scan_of, stamp_of
from ros_adapters.node import SILENT_AFTER_S, Node
from ros_adapters.revolution_messages import revolution_of, sensor_is_spinning
from ros_adapters.tilt_input import TiltInput
from stage_config import load_config
from sweep_assembly import LaserScans, LidarConfig, LidarRevolutions, Line, LineSource, SweepAssemblyConfig

_AS_SWEEPS = ("max_joint_gap_s", "max_odometry_gap_s", "free_range_m")


def _config_of_sweeps() -> SweepAssemblyConfig:
    """What a sweep's pauses and free beams are, its lines' are, too: told once, to the node that assembles sweeps."""
    values = {name: rospy.get_param(f"sweep_assembler_node/{name}", None) for name in _AS_SWEEPS}
    return load_config(SweepAssemblyConfig, {name: value for name, value in values.items() if value is not None})


class LineInput:
    """Subscribes what lines are made of, but for the odometry, which the node has."""

    def __init__(self, node: Node, lidar: LidarConfig, tilt_joint: str | None, mount: TiltGeometry, laser_frame: str) -> None:
        """`lidar`: where one spins in the laser's place; `tilt_joint` and `mount` are `mount_of_laser`'s."""
        spinning, self._laser_frame = sensor_is_spinning(node.name), laser_frame
        sensor = LidarRevolutions(lidar) if spinning else LaserScans()
        self._lines: LineSource[Any] = LineSource(_config_of_sweeps(), mount, sensor)
        self._tilt = TiltInput(node, tilt_joint, self._lines.add_joint)
        self._newest_s, self._seeing_s = -math.inf, -math.inf  # of lines, and of those with a valid beam
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
        for line in self._lines.poll():
            self._newest_s = line.stamp_s
            if len(line.hits) or len(line.free_ends):
                self._seeing_s = line.stamp_s
            yield line

    @property
    def seeing_s(self) -> float:
        """Stamp of the newest line that saw anything; -inf before the first."""
        return self._seeing_s

    def missing(self, stamp_s: float, max_age_s: float) -> str:
        """That no line so young sees, as words: nothing comes, it is dropped, or no beam is valid; empty while one does."""
        if -JUMP_BACK_S < stamp_s - self._seeing_s <= max_age_s:
            return ""
        topic = rospy.resolve_name(self.topics[-1])
        if -JUMP_BACK_S < stamp_s - self._newest_s <= max_age_s:
            return f"the laser sees nothing: no valid beam on {topic}"
        dropped = ", ".join(f"{n} x {what}" for what, n in sorted(self._lines.dropped.items()))
        return f"no line of {topic}" + (f" (dropped so far: {dropped})" if dropped else "")

    def _on_scan(self, message: LaserScan) -> None:
        self._lines.add_reading(stamp_of(message), scan_of(message))

    def _on_points(self, message: PointCloud2) -> None:
        self._lines.add_reading(stamp_of(message), revolution_of(message, self._laser_frame))
