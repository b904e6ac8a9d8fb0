"""Single filtered scans, or revolutions of a lidar, as points in odom: what the costmap takes while the robot drives.

Stands beside the assembler, which waits for a whole sweep. Inputs come a message at a time, in order within a topic and in any order
between topics; a line is given out when joint samples and odometry reach its last beam, and depends on the stamps only.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Generic

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mount_calibration import TiltDirection
from rigid_geometry import STAMP_TOLERANCE_S, StampedBuffer, as_transform, interpolate_transforms
from sweep_assembly.assembler import along_nodes
from sweep_assembly.assembly_config import SweepAssemblyConfig
from sweep_assembly.beams import FreeBeams, Reading, Sensor
from sweep_assembly.geometry import FloatArray, TiltGeometry

BUFFER_S = 5.0
NODE_S = 0.005  # the laser's pose is linear between nodes: 3 rad/s bends a beam of 3 m by 0.1 mm


@dataclass(frozen=True, eq=False)
class Line:
    """(N, 3) `hits` and (M, 3) `free_ends` of beams that met nothing, metres in odom, each from where the robot was at its time.

    `stamp_s`: of the last beam; `origin` (3,): where the laser was in the middle of them.
    """

    stamp_s: float
    hits: NDArray[np.float32]
    free_ends: NDArray[np.float32]
    origin: FloatArray


class LineSource(Generic[Reading]):
    """Lets every reading wait for the joint sample and the odometry after its last beam, and gives it out in order."""

    def __init__(self, config: SweepAssemblyConfig, mount: TiltGeometry, sensor: Sensor[Reading]) -> None:
        """Of `config` the gaps that are stood and how free beams are thinned."""
        self._config, self._mount, self._sensor = config, mount, sensor
        self._free = FreeBeams(config.free_range_m, config.free_beam_stride)
        self.dropped: Counter[str] = Counter()
        self._reset()

    def _reset(self) -> None:
        self._joints: StampedBuffer[tuple[float, float]] = StampedBuffer("joint", BUFFER_S, self.dropped)
        self._odometry: StampedBuffer[FloatArray] = StampedBuffer("odometry", BUFFER_S, self.dropped)
        self._waiting: StampedBuffer[Reading] = StampedBuffer("scan", BUFFER_S, self.dropped)
        self._direction = TiltDirection(self._mount.calibration.backlash_rad)

    def add_joint(self, stamp_s: float, tilt_rad: float) -> None:
        """Takes the tilt at a time; ValueError when it is not finite. What is late is dropped and counted."""
        if not np.isfinite([stamp_s, tilt_rad]).all():
            raise ValueError(f"tilt {tilt_rad} rad at {stamp_s} s: both must be finite")
        if self._joints.takes(stamp_s, self._reset):
            self._joints.append(stamp_s, (tilt_rad, self._direction.after(tilt_rad)))

    def add_odometry(self, stamp_s: float, T_odom_base: ArrayLike) -> None:
        """Takes the (4, 4) pose of base_link at a time; ValueError when it is none. What is late is dropped and counted."""
        pose = as_transform(T_odom_base)
        if self._odometry.takes(stamp_s, self._reset):
            self._odometry.append(stamp_s, pose)

    def add_reading(self, stamp_s: float, filtered: object) -> None:
        """Takes a filtered scan or revolution with the stamp of its first beam; ValueError for one of another sensor.

        What is late is dropped and counted.
        """
        reading = self._sensor.checked(filtered)
        if self._waiting.takes(stamp_s, self._reset):
            self._waiting.append(stamp_s, reading)

    def poll(self) -> Iterator[Line]:
        """What is complete by now, oldest first."""
        while (first := self._waiting.first()) is not None and self._reached(first[0] + self._sensor.duration_of(first[1])):
            self._waiting.drop_first()
            line = self._line(*first)
            if line is not None:
                yield line
            self._joints.forget_before(first[0])
            self._odometry.forget_before(first[0])

    def _reached(self, stamp_s: float) -> bool:
        newest = self._joints.last_stamp_s, self._odometry.last_stamp_s
        return all(last is not None and last >= stamp_s - STAMP_TOLERANCE_S for last in newest)

    def _line(self, stamp_s: float, reading: Reading) -> Line | None:
        span_s = stamp_s, stamp_s + self._sensor.duration_of(reading)
        joints_s, joints = self._joints.around(*span_s)
        odometry_s, poses = self._odometry.around(*span_s)
        if not _covers(joints_s, span_s, self._config.max_joint_gap_s):
            self.dropped["scan_without_joints"] += 1
            return None
        if not _covers(odometry_s, span_s, self._config.max_odometry_gap_s):
            self.dropped["scan_without_odometry"] += 1
            return None
        nodes = np.linspace(*span_s, int(np.ceil((span_s[1] - span_s[0]) / NODE_S)) + 1)
        T_odom_base = interpolate_transforms(odometry_s, np.stack(poses), np.clip(nodes, odometry_s[0], odometry_s[-1]))
        tilts, directions = (np.interp(nodes, joints_s, values) for values in np.array(joints).T)
        T_odom_laser = T_odom_base @ self._mount.base_from_laser(tilts, directions)
        beams = self._sensor.beams(np.array([stamp_s]), [reading], span_s, self._free)
        hits, _ = along_nodes(nodes, T_odom_laser, beams.times_s, beams.hits)
        free_ends, _ = along_nodes(nodes, T_odom_laser, beams.free_times_s, beams.free_ends)
        return Line(span_s[1], hits, free_ends, T_odom_laser[len(nodes) // 2, :3, 3])


def _covers(stamps_s: FloatArray, span_s: tuple[float, float], longest_gap_s: float) -> bool:
    """Whether samples reach over a span of time without a longer pause."""
    if not stamps_s.size or stamps_s[0] > span_s[0] + STAMP_TOLERANCE_S or stamps_s[-1] < span_s[1] - STAMP_TOLERANCE_S:
        return False
    return stamps_s.size < 2 or float(np.diff(stamps_s).max()) <= longest_gap_s
