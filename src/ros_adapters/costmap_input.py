"""What goes into the follower's costmap: terrain, scans and lines, each from where the robot was at its time."""

import math
from collections.abc import Iterable

import numpy as np
from sensor_msgs.msg import LaserScan

from local_terrain_costmap import CostmapView, LocalCostmap
from octomap_server_3dnav.navigation.local_grid import TerrainGrid
from rigid_geometry import PoseHistory, transform_points
from rigid_geometry.transforms import Transform
from ros_adapters.conversions import scan_points
from sweep_assembly import Line


class CostmapInput:
    """Puts into the costmap what the robot sees. Lines mark nothing while nobody knows where it is."""

    def __init__(self, costmap: LocalCostmap, T_base_laser: Transform, *, driving: bool, displaced_s: float | None = None) -> None:
        """T_base_laser (4, 4): of horizontal scans. `driving`: sweeps are mapped while it drives. `displaced_s`: as it was known before."""
        self._costmap, self._T_base_laser, self._driving = costmap, T_base_laser, driving
        self.displaced_s = displaced_s  # when odometry last knew nothing of the way, until a sweep tells
        self._poses = PoseHistory()
        self._seen_scan_s: float | None = None
        self._knows_terrain, self._swept_s = False, -math.inf

    @property
    def view(self) -> CostmapView | None:
        """All layers together; None before the first terrain."""
        return self._costmap.master() if self._knows_terrain else None

    def displace(self, stamp_s: float) -> bool:
        """Nobody knows where the robot is, until a later sweep tells; whether that was known until now."""
        was_known, self.displaced_s = self.displaced_s is None, stamp_s
        return was_known

    def take_terrain(self, swept_s: float, grid: TerrainGrid) -> bool:
        """The terrain of the sweep that ended at `swept_s`; whether it tells where a displaced robot is.

        What was marked goes with it where it may lie elsewhere in the map: the robot was displaced, or stood, and the map was corrected.
        The same sweep's terrain once more, as when people clear a box, moves nothing.
        """
        is_found = self.displaced_s is not None and swept_s > self.displaced_s
        if is_found:
            self.displaced_s = None
        if is_found or (not self._driving and swept_s != self._swept_s):
            self._costmap.clear_obstacles()
        self._swept_s = swept_s
        self._costmap.set_terrain(grid.cost, grid.origin_xy, grid.resolution, grid.height, grid.distance)
        self._knows_terrain = True
        return is_found

    def add_odometry(self, stamp_s: float, T_odom_base: Transform) -> None:
        """The (4, 4) pose of base_link at a time."""
        self._poses.add(stamp_s, T_odom_base)

    def recenter(self, T_map_base: Transform) -> None:
        """Moves the window to the robot."""
        self._costmap.recenter(T_map_base[0, 3], T_map_base[1, 3])

    def add_scan(self, scan_s: float, scan: LaserScan, T_map_odom: Transform) -> None:
        """A horizontal scan, which counts once, from where the robot was in the middle of it. ValueError before the first odometry."""
        if scan_s == self._seen_scan_s:
            return
        self._seen_scan_s = scan_s
        T_map_laser = T_map_odom @ self._poses.nearest(scan_s + 0.5 * scan.time_increment * len(scan.ranges)) @ self._T_base_laser
        hits, free_ends = (transform_points(T_map_laser, points) for points in scan_points(scan))
        self._costmap.add_scan(hits[:, :2], free_ends[:, :2], tuple(T_map_laser[:2, 3]), hits[:, 2])

    def add_lines(self, lines: Iterable[Line], T_map_odom: Transform) -> None:
        """Lines in odom, each where the correction of now has it in map."""
        for line in lines if self.displaced_s is None else ():
            hits, free_ends = (transform_points(T_map_odom, ends.astype(np.float64)) for ends in (line.hits, line.free_ends))
            self._costmap.add_line(line.stamp_s, hits, free_ends, transform_points(T_map_odom, line.origin[None])[0])
