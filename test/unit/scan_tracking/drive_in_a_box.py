"""A robot that drives through an empty box: what its laser, mount and odometry say, and the map of the walls."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from rigid_geometry import transform_from_rpy
from scan_tracking import ScanTracker, ScanTrackingConfig
from sweep_assembly import LaserScans, Scan, ScanGeometry, TiltGeometry

GEOMETRY = ScanGeometry(math.radians(-135.0), math.radians(1.0), 0.025 / 360, 271)
MOUNT = TiltGeometry(transform_from_rpy((0.20, 0.0, 0.75)), transform_from_rpy((0.03, 0.0, 0.04)))
ROOM = np.array([[-3.0, -2.0, -0.132], [5.0, 4.0, 3.0]])
CORRIDOR = np.array([[-100.0, -1.2, -0.132], [100.0, 1.2, 2.4]])
Pose = Callable[[float], np.ndarray]


def still(t: float) -> np.ndarray:
    return transform_from_rpy((0.5, 0.3, 0.0), (0.0, 0.0, 0.2))


def ahead(t: float) -> np.ndarray:
    """Half a metre a second along x."""
    return transform_from_rpy((0.5 * t, 0.0, 0.0))


def bend(t: float) -> np.ndarray:
    return transform_from_rpy((0.4 * t, 0.1 * t, 0.0), (0.0, 0.0, 0.3 * t))


def nod(t: float) -> float:
    """The mount's tilt: up and down between 0.6 rad below and 0.4 above the horizon."""
    return 0.1 + 0.5 * math.sin(2.0 * math.pi * t / 3.0)


def level(t: float) -> float:
    return 0.0


@dataclass(frozen=True)
class Drive:
    """From 0 to `end_s` along `pose`, with `tilt`; `slip` (4, 4) is what odometry misses every second, `range_sigma_m` noise."""

    box: np.ndarray = field(default_factory=lambda: ROOM)
    pose: Pose = ahead
    tilt: Callable[[float], float] = nod
    end_s: float = 2.0
    slip: Pose = lambda t: np.eye(4)
    range_sigma_m: float = 0.0
    seed: int = 0

    def odometry(self, t: float) -> np.ndarray:
        return self.slip(t) @ self.pose(t)

    def scan(self, stamp_s: float) -> Scan:
        times = stamp_s + GEOMETRY.beam_times
        T = np.stack([self.pose(t) @ MOUNT.base_from_laser(self.tilt(t))[0] for t in times])
        ranges = self.ranges(T, GEOMETRY.directions)
        noise = np.random.default_rng([self.seed, round(stamp_s * 1000)]).normal(0.0, 1.0, len(ranges))
        return Scan(GEOMETRY, ranges + self.range_sigma_m * noise)

    def ranges(self, T: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """(n,) distances to the box from (n, 4, 4) poses of the laser along (n, 3) directions."""
        heading = np.einsum("nij,nj->ni", T[:, :3, :3], directions)
        heading[heading == 0.0] = 1e-12
        origin = T[:, :3, 3]
        return np.where(heading > 0, (self.box[1] - origin) / heading, (self.box[0] - origin) / heading).min(axis=1)

    def into(self, tracker: ScanTracker, begin_s: float = 0.0, without: tuple[float, ...] = ()) -> list:
        """All tracked poses, asked for at every odometry sample with what has come by then; odometry of some stamps is lost."""
        poses = []
        for k in range(round(begin_s / 0.025), round(self.end_s / 0.025) + 1):
            t = k * 0.025
            tracker.add_tilt(t, self.tilt(t))
            if k % 2 == 0 and not any(math.isclose(t, stamp_s) for stamp_s in without):
                tracker.add_odometry(t, self.odometry(t))
            if k:
                tracker.add_scan(t - 0.025, self.scan(t - 0.025))
            poses += tracker.advance(t)
        return poses


def walls(box: np.ndarray, spacing_m: float = 0.08, around_m: float = 14.0) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) points on the inner faces of a box, as far as `around_m` from the origin, and their normals."""
    low, high = np.maximum(box[0], -around_m), np.minimum(box[1], around_m)
    grids = [np.arange(a + spacing_m / 2, b, spacing_m) for a, b in zip(low, high, strict=True)]
    points, normals = [], []
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        u, v = (g.ravel() for g in np.meshgrid(*(grids[k] for k in others), indexing="ij"))
        for side in range(2):
            if abs(box[side, axis]) > around_m:
                continue
            face, normal = np.empty((len(u), 3)), np.zeros((len(u), 3))
            face[:, others[0]], face[:, others[1]], face[:, axis] = u, v, box[side, axis]
            normal[:, axis] = 1.0 if side == 0 else -1.0
            points.append(face)
            normals.append(normal)
    return np.concatenate(points), np.concatenate(normals)


def tracker_in(box: np.ndarray | None, covariance: np.ndarray | None = None, **changes) -> ScanTracker:
    """For this laser, with the walls of a box for its map."""
    tracker = ScanTracker(ScanTrackingConfig(**changes), LaserScans(), MOUNT)
    if box is not None:
        tracker.set_map(*walls(box), np.eye(4), covariance)
    return tracker
