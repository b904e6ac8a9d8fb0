"""Scans of a 2-D laser, with joint samples, become filtered ones and the level scans of the obstacle layer.

Inputs come a message at a time, in order within a topic and in any order between topics; the outcome depends on the stamps only.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

from rigid_geometry import StampedBuffer
from robot_body import RobotBody
from sweep_assembly.geometry import TiltGeometry
from sweep_assembly.revolution_chain import BUFFER_S
from sweep_assembly.scan import Scan
from sweep_assembly.scan_filter import ScanFilter, ScanFilterConfig
from sweep_assembly.tilt_history import TiltHistory


@dataclass(frozen=True, eq=False)
class FilteredScan:
    """What became of a scan: the one of surfaces alone, and its short ranges, all NaN unless the laser was level."""

    stamp_s: float
    scan: Scan
    level: Scan


class ScanChain:
    """Lets every scan wait for the joint sample after its last beam, filters it, and gives it out in order."""

    def __init__(self, config: ScanFilterConfig, mount: TiltGeometry, robot: RobotBody) -> None:
        """ValueError when the configuration is wrong."""
        self._filter, self._max_range_m = ScanFilter(config, mount, robot), config.max_range_m
        self._tilts = TiltHistory()
        self.dropped: Counter[str] = Counter()
        self._waiting: StampedBuffer[Scan] = StampedBuffer("scan", BUFFER_S, self.dropped)

    def add_joint(self, stamp_s: float, tilt_rad: float) -> None:
        """Takes the tilt at a time; ValueError when it is not finite."""
        self._tilts.add(stamp_s, tilt_rad)

    def add_scan(self, stamp_s: float, scan: Scan) -> None:
        """Takes a scan with the stamp of its first beam. What is late is dropped and counted; time that jumps back lets go what waits."""
        if self._waiting.takes(stamp_s, self._waiting.clear):
            self._waiting.append(stamp_s, scan)

    def poll(self) -> Iterator[FilteredScan]:
        """What is complete by now, oldest first."""
        while (first := self._waiting.first()) is not None and self._tilts.reaches(first[0] + first[1].geometry.duration_s):
            self._waiting.drop_first()
            yield self._filtered(*first)

    def _filtered(self, stamp_s: float, scan: Scan) -> FilteredScan:
        tilts = self._tilts.at(stamp_s + scan.geometry.beam_times)
        range_max_m = min(scan.range_max_m, self._max_range_m)  # farther, a beam without an echo may have met something
        filtered = replace(scan, ranges=self._filter.filter(scan, tilts), range_max_m=range_max_m)
        return FilteredScan(stamp_s, filtered, self._filter.horizontal(filtered, tilts))
