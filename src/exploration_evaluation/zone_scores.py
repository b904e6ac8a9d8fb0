"""What bounds and no-go zones mean for the judge: which ground counts, and whether the robot kept to them.

For `run_folder`. Zones are in map; the judge's ground and poses are in the world, and T_world_map is what the scores were aligned by.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from exploration_evaluation.config import RobotShape
from exploration_evaluation.run_files import Trajectory
from map_zones import NO_ZONES, Zones, read_zones
from rigid_geometry import inverse, transform_points

Floats = NDArray[np.float64]
FILE = "zones.yaml"
_SPACING_M = 0.05  # of points along the robot's outline
_EVERY_S = 0.1  # a pose is looked at


def zones_of(folder: Path) -> Zones:
    """Those that the run had, by its zones.yaml; none where there is no such file. ValueError for one that is none."""
    return read_zones(folder / FILE) if (folder / FILE).exists() else NO_ZONES


def closed_in_world(zones: Zones, T_world_map: Floats | None) -> Callable[[Floats], NDArray[np.bool_]] | None:
    """Tells of points (N, 3) in the world whether the robot may not be there; None where it may be everywhere, or nobody knows."""
    if T_world_map is None or not zones.are_set:
        return None
    T_map_world = inverse(T_world_map)
    return lambda xyz: zones.closed(np.asarray(transform_points(T_map_world, xyz), dtype=np.float64))


def farthest_outside_m(zones: Zones, T_world_map: Floats | None, truth: Trajectory | None, robot: RobotShape) -> float | None:
    """Metres by which the robot's outline came at most to where it may not be, by its true poses; None where that is not known."""
    if truth is None or T_world_map is None or not zones.are_set:
        return None
    stamps, poses = truth
    T_map_world = inverse(T_world_map)
    seen = poses[np.unique(np.searchsorted(stamps, np.arange(stamps[0], stamps[-1], _EVERY_S)))]
    points = np.einsum("kij,nj->kni", seen[:, :3, :3], _outline(robot)) + seen[:, None, :3, 3]
    in_map = np.asarray(transform_points(T_map_world, points.reshape(-1, 3)), dtype=np.float64)
    return float(zones.depth_m(in_map).max())


def _outline(robot: RobotShape) -> Floats:
    """(N, 3) points of its border on the ground, in base_link."""
    x, y = robot.length_m / 2.0, robot.width_m / 2.0
    along, across = (np.linspace(-half, half, 2 + int(2.0 * half / _SPACING_M)) for half in (x, y))
    sides = [np.stack([along, np.full_like(along, s * y)], axis=1) for s in (-1, 1)]
    sides += [np.stack([np.full_like(across, s * x), across], axis=1) for s in (-1, 1)]
    xy = np.concatenate(sides)
    return np.column_stack([xy, np.full(len(xy), -robot.base_height_m)])
