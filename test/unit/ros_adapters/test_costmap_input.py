"""Where in the map readings are put, and what becomes of marks while nobody knows where the robot is."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sensor_msgs.msg import LaserScan

from local_terrain_costmap import LETHAL, CostmapConfig, LocalCostmap
from octomap_server_3dnav.navigation.local_grid import TerrainGrid
from rigid_geometry import transform_from_rpy
from robot_body import RobotBody
from ros_adapters.costmap_input import CostmapInput
from sweep_assembly import Line

CONFIG = CostmapConfig(size_m=6.0, resolution_m=0.1, inflation_radius_m=0.0)
HERE = transform_from_rpy((0.0, 0.0, 0.0))


def ground() -> TerrainGrid:
    """Six metres of it, level."""
    flat = np.zeros((60, 60), np.float32)
    return TerrainGrid(flat.astype(np.int8), flat, flat + np.inf, (-3.0, -3.0), 0.1)


def scan(range_m: float) -> LaserScan:
    """A beam ahead, and as long as it takes for one."""
    return LaserScan(angle_min=0.0, angle_increment=0.1, time_increment=0.1, range_max=10.0, ranges=[range_m, math.nan])


def line(stamp_s: float, x: float) -> Line:
    """Hits beside each other ahead, above the ground."""
    hits = np.array([[x, 0.05, 0.55], [x + 0.01, 0.05, 0.55]], np.float32)
    return Line(stamp_s, hits, np.empty((0, 3), np.float32), np.array([0.0, 0.0, 0.5]))


class Fed:
    """A costmap with ground, and what goes into it."""

    def __init__(self, *, driving: bool = False, displaced_s: float | None = None) -> None:
        self.costmap = LocalCostmap(CONFIG, replace(RobotBody(), width_m=0.0))
        self.sensed = CostmapInput(self.costmap, transform_from_rpy((0.2, 0.0, 0.5)), driving=driving, displaced_s=displaced_s)
        self.sensed.add_odometry(1.0, HERE)
        self.sensed.add_odometry(1.2, transform_from_rpy((0.4, 0.0, 0.0)))

    def marks(self) -> list[float]:
        """x of every lethal cell of the row ahead."""
        view = self.costmap.master()
        row = view.cost[round((0.05 - view.origin_xy[1]) / 0.1 - 0.5)]
        return [round(float(v), 2) for v in view.origin_xy[0] + 0.1 * (np.flatnonzero(row == LETHAL) + 0.5)]


def test_scan_is_put_where_the_robot_was_in_its_middle_and_counts_once() -> None:
    fed = Fed()
    fed.sensed.take_terrain(0.5, ground())
    for _ in range(2):
        fed.sensed.add_scan(1.0, scan(1.52), transform_from_rpy((0.0, 0.05, 0.0)))  # two beams: its middle is at 1.1 s, x = 0.2
    assert fed.marks() == [1.95]


def test_view_is_there_from_the_first_terrain_on() -> None:
    fed = Fed()
    assert fed.sensed.view is None
    fed.sensed.take_terrain(0.5, ground())
    assert fed.sensed.view is fed.costmap.master()


@pytest.mark.parametrize(("driving", "left"), [(False, []), (True, [1.05])])
def test_marks_outlive_a_terrain_only_of_a_robot_that_did_not_stand_for_it(driving: bool, left: list[float]) -> None:
    fed = Fed(driving=driving)
    fed.sensed.take_terrain(0.5, ground())
    fed.sensed.add_lines([line(1.0, 1.05)], HERE)
    assert fed.marks() == [1.05]
    assert not fed.sensed.take_terrain(0.5, ground())  # drawn again
    assert fed.marks() == [1.05]
    assert not fed.sensed.take_terrain(2.0, ground())
    assert fed.marks() == left


def test_displaced_robot_marks_nothing_until_a_later_sweep_tells_where_it_is() -> None:
    fed = Fed(driving=True)
    fed.sensed.take_terrain(0.5, ground())
    fed.sensed.add_lines([line(1.0, 1.05)], HERE)
    assert (fed.sensed.displace(2.0), fed.sensed.displace(2.5)) == (True, False)
    fed.sensed.add_lines([line(2.5, 2.05)], HERE)
    assert not fed.sensed.take_terrain(2.4, ground())  # of a sweep that ended before
    assert fed.marks() == [1.05]
    assert fed.sensed.take_terrain(3.0, ground())
    assert (fed.marks(), fed.sensed.displaced_s) == ([], None)


def test_process_that_begins_displaced_waits_for_the_sweep_too() -> None:
    fed = Fed(driving=True, displaced_s=2.0)
    assert not fed.sensed.take_terrain(1.0, ground())
    assert fed.sensed.take_terrain(2.5, ground())
