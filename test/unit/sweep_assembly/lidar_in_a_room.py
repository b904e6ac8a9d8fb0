"""A made-up spinning lidar in an empty room: every beam's true range in closed form."""

import math

import numpy as np

from rigid_geometry import transform_from_rpy
from sweep_assembly import LidarConfig, Revolution, TiltGeometry

LIDAR = LidarConfig()
COLUMNS = 120
TILT = TiltGeometry(transform_from_rpy((0.20, 0.0, 0.75)), transform_from_rpy((0.03, 0.0, 0.04)))
ROOM_LOW, ROOM_HIGH = np.array([-3.0, -2.0, -0.132]), np.array([5.0, 4.0, 3.0])


def beams(columns: int = COLUMNS, sense: float = -1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit directions (N, 3), rings (N,) and times (N,) of a revolution, a column after the other."""
    column, ring = (v.ravel() for v in np.meshgrid(np.arange(columns), np.arange(LIDAR.rings), indexing="ij"))
    azimuth, elevation = 1.0 + sense * 2.0 * math.pi * column / columns, LIDAR.elevations[ring]
    flat = np.cos(elevation)
    directions = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=1)
    return directions, ring.astype(np.uint16), column * LIDAR.duration_s / columns


def room_ranges(T_odom_laser: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(N,) distances to the room's walls; T is (N, 4, 4), a beam each."""
    heading = np.einsum("nij,nj->ni", T_odom_laser[:, :3, :3], directions)
    heading[heading == 0.0] = 1e-12
    origin = T_odom_laser[:, :3, 3]
    return np.where(heading > 0, (ROOM_HIGH - origin) / heading, (ROOM_LOW - origin) / heading).min(axis=1)


def revolution(stamp: float, pose, tilt_at) -> Revolution:
    """What the lidar sees of the room from a robot that moves as `pose` says."""
    directions, rings, times = beams()
    by_column = [pose(stamp + t) @ TILT.base_from_laser(tilt_at(stamp + t))[0] for t in times[:: LIDAR.rings]]
    T = np.repeat(np.stack(by_column), LIDAR.rings, axis=0)
    return Revolution((room_ranges(T, directions)[:, None] * directions).astype(np.float32), rings, times)


def with_points(points: np.ndarray, ring: int = 7) -> Revolution:
    """A revolution that holds these points only, of one ring, fired evenly."""
    return Revolution(points.astype(np.float32), np.full(len(points), ring, np.uint16), np.linspace(0.0, 0.05, len(points)))
