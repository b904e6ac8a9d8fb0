"""Cases for the benchmarks of registration: full sweeps of the tilting laser along seeded drives, each against the map of those before.

A drive is made once (a few seconds) and kept as a file in a cache folder. Sweeps go through the simulator's laser, the scan filter and
the sweep assembler, with the odometry that the filter makes of an IMU and wheels at rest, so that noise, veiled points, distortion and
beam origins are those of a run; the robot stands where the ground puts it.
"""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from registration_worlds import MOVED, drive_poses, with_moved_furniture, world_of

from odometry_fusion import OdometryConfig, OdometryFilter
from pose_graph_mapping.config import MappingConfig
from pose_graph_mapping.registration.cloud import NORMAL_NEIGHBOURS, PointCloud, merged, vertex_cloud
from pybullet_simulation.config import SimulationConfig
from pybullet_simulation.imu import Imu
from pybullet_simulation.laser import Laser, Motion
from pybullet_simulation.realism import IDEAL
from pybullet_simulation.robot_model import read_robot_model
from pybullet_simulation.sweep_profile import sweep_profile
from pybullet_simulation.tilt_mount import TiltMount
from pybullet_simulation.world import World
from robot_body import RobotBody
from sweep_assembly import LaserScans, Scan, ScanFilter, ScanFilterConfig, ScanGeometry, SweepAssembler, SweepAssemblyConfig, TiltGeometry

Array = NDArray[np.float64]

LAYOUT = 4  # of the cached files; to be raised when what is in them changes
REFERENCE_M = 8.0
SWEEPS_A_DRIVE = 11
STEP_S, SCAN_S, START_S = 0.005, 0.025, 0.25
IMU_HZ, WHEELS_EVERY = 100, 5
DRIVE_S, SPEED_MPS, ARRIVED_S = (2.0, 7.0), 0.5, 8.0  # from rest, before a sweep: what the odometry gathers its errors on
DEFAULT_CACHE = Path(tempfile.gettempdir()) / "registration_cases"


MOUNTS = {
    "nominal": IDEAL,
    "off": replace(IDEAL, mount_tilt_scale=1.005, mount_roll_rad=math.radians(0.2)),
    "hardware": SimulationConfig(),
}


@dataclass(frozen=True, eq=False)
class Case:
    """A match to be made: `reading` in base_link, `reference` in the map frame, and the truth T_map_base."""

    name: str
    world: str
    reference: PointCloud
    reading: PointCloud
    T_map_base: Array


class SweepingLaser:
    """Sweeps of a robot that stands still in a world, through the whole chain from beams to cloud."""

    def __init__(self, world: World, config: SimulationConfig, rng: np.random.Generator) -> None:
        self._config, self._rng = config, rng
        robot = read_robot_model(RobotBody())
        self._imu, self._R_base_imu = Imu(self._config, rng), robot.T_base_imu[:3, :3]
        self._laser, self._profile = Laser(self._config, robot, world, rng), sweep_profile(self._config)
        self._mount = TiltMount(self._config, rng) if self._config.tilt_offset_sigma_rad or self._config.tilt_backlash_rad else None
        layout = self._laser.geometry
        self._geometry = ScanGeometry(layout.angle_min, layout.angle_increment, layout.time_increment, layout.beams)
        self._tilt_geometry = TiltGeometry(robot.T_base_mount, robot.T_tilt_laser)
        self._filter = ScanFilter(ScanFilterConfig(), self._tilt_geometry, RobotBody())

    def sweep(self, T_map_base: Array) -> PointCloud:
        """Points and beam origins in base_link, as the robot believes them to be."""
        ticks = math.ceil((self._profile.duration_s + 2 * START_S) / SCAN_S)
        stamps = np.arange(ticks + 1, dtype=np.float64) * SCAN_S + ARRIVED_S
        ranges = self._laser.scans(self._motion(T_map_base, ticks), stamps[:-1] - ARRIVED_S)
        measured = self._profile.tilt_at(stamps - ARRIVED_S - START_S) + self._config.tilt_encoder_sigma_rad * self._rng.standard_normal(
            ticks + 1
        )
        assembler = SweepAssembler(SweepAssemblyConfig(), LaserScans(), self._tilt_geometry)
        odometry = self._odometry(T_map_base[:3, :3], stamps)
        for k, scan in enumerate(ranges):
            tilts = np.interp(stamps[k] + self._geometry.beam_times, stamps, measured)
            if k % 2 == 0:  # 20 Hz
                assembler.add_odometry(float(stamps[k]), odometry[k])
            assembler.add_joint(float(stamps[k]), float(measured[k]))
            assembler.add_scan(float(stamps[k]), self._filtered(scan, tilts))
        found = assembler.poll()
        if found is None:
            raise RuntimeError(f"no sweep came out of {ticks} scans: {assembler.dropped}")
        return PointCloud.of_finite(found.points, found.origins)

    def _filtered(self, ranges: NDArray[np.float32], tilts: Array) -> Scan:
        scan = Scan(self._geometry, ranges)
        return replace(scan, ranges=self._filter.filter(scan, tilts))

    def _odometry(self, R_map_base: Array, stamps: Array) -> list[Array]:
        """T_odom_base at each stamp as the filter estimates it while the robot stands, after a drive at the same attitude."""
        fusion = OdometryFilter(OdometryConfig(), RobotBody())
        for k in range(round(stamps[-1] * IMU_HZ) + 2 * WHEELS_EVERY):
            stamp_s = k / IMU_HZ
            before, now = (
                SPEED_MPS * math.sin(math.pi * np.clip((t - DRIVE_S[0]) / np.ptp(DRIVE_S), 0, 1)) for t in (stamp_s - 1 / IMU_HZ, stamp_s)
            )
            ahead = R_map_base[:, 0] * (now - before) * IMU_HZ
            sample = self._imu.sample(stamp_s, R_map_base @ self._R_base_imu, np.zeros(3), ahead)
            fusion.add_imu(stamp_s, self._R_base_imu @ sample.gyro, self._R_base_imu @ sample.accel)
            if k % WHEELS_EVERY == 0:
                fusion.add_wheels(stamp_s, now, 0.0)
        found = [fusion.estimate(float(stamp)) for stamp in stamps]
        return [estimate.T_odom_base for estimate in found if estimate is not None]

    def _motion(self, T_map_base: Array, ticks: int) -> Motion:
        """Standing still while the laser tilts."""
        steps = ticks * round(SCAN_S / STEP_S) + 1
        tilts = self._profile.tilt_at(np.arange(steps, dtype=np.float64) * STEP_S - START_S)
        true = tilts if self._mount is None else self._mount.true_tilts(tilts)
        return Motion(np.tile(T_map_base[:3, :3], (steps, 1, 1)), np.tile(T_map_base[:3, 3], (steps, 1)), true, STEP_S)


@dataclass(eq=False)
class Drive:
    """Sweeps along a drive, `points` and `origins` in base_link at `poses` (K, 4, 4); float32, as a session keeps them."""

    world: str
    seed: int
    poses: Array
    points: list[NDArray[np.float32]]
    origins: list[NDArray[np.float32]]
    _vertices: dict[int, PointCloud] = field(default_factory=dict)

    def reading(self, index: int) -> PointCloud:
        """A full sweep in base_link."""
        return PointCloud.of_finite(self.points[index], self.origins[index])

    def reference(self, index: int) -> PointCloud:
        """Vertex clouds of all sweeps before `index` within 8 m of it, in the map frame."""
        here = self.poses[index, :3, 3]
        near = [k for k in range(index) if np.linalg.norm(self.poses[k, :3, 3] - here) <= REFERENCE_M]
        return merged([self._vertex(k).transformed(self.poses[k]) for k in near])

    def case(self, index: int) -> Case:
        """Sweep `index` (1 or more) against those before."""
        return Case(f"{self.world}/{self.seed}/{index}", self.world, self.reference(index), self.reading(index), self.poses[index])

    def _vertex(self, index: int) -> PointCloud:
        if index not in self._vertices:
            config = MappingConfig()
            self._vertices[index] = vertex_cloud(self.reading(index), config.vertex_voxel_m, NORMAL_NEIGHBOURS)
        return self._vertices[index]


@lru_cache(maxsize=24)
def drive(world: str, seed: int, mount: str = "nominal", cache: Path = DEFAULT_CACHE, sweeps: int = SWEEPS_A_DRIVE) -> Drive:
    """A drive from the cache, made and stored when it is not there."""
    path = cache / f"{world}-{seed}-{mount}-{sweeps}-{LAYOUT}.npz"
    if not path.exists():
        _store(path, _make(world, seed, MOUNTS[mount], sweeps))
    with np.load(path) as data:
        ends = np.cumsum(data["counts"])[:-1]
        return Drive(world, seed, data["poses"], np.split(data["points"], ends), np.split(data["origins"], ends))


def _make(name: str, seed: int, config: SimulationConfig, sweeps: int) -> Drive:
    """A world with moved furniture is driven as the world itself is."""
    world = world_of(name.removesuffix(MOVED), seed)
    poses = drive_poses(world, seed, sweeps)
    if name.endswith(MOVED):
        world = with_moved_furniture(world, seed, poses[:, :2, 3])
    laser = SweepingLaser(world, config, np.random.default_rng([seed, 33]))
    clouds = [laser.sweep(T) for T in poses]
    origins = [c.origins.astype(np.float32) for c in clouds if c.origins is not None]
    return Drive(name, seed, poses, [c.points.astype(np.float32) for c in clouds], origins)


def _store(path: Path, made: Drive) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(f".{os.getpid()}.npz")
    counts = [len(p) for p in made.points]
    np.savez_compressed(
        unfinished, poses=made.poses, counts=counts, points=np.concatenate(made.points), origins=np.concatenate(made.origins)
    )
    unfinished.replace(path)


def case_of(world: str, k: int, mount: str = "nominal", cache: Path = DEFAULT_CACHE, sweeps: int = SWEEPS_A_DRIVE) -> Case:
    """The k-th case of a world: one a sweep but the first of each drive, drives by seed from 1."""
    return drive(world, 1 + k // (sweeps - 1), mount, cache, sweeps).case(1 + k % (sweeps - 1))


def cases(world: str, count: int, mount: str = "nominal", cache: Path = DEFAULT_CACHE) -> Iterator[Case]:
    """The first `count` cases of a world, one at a time."""
    return (case_of(world, k, mount, cache) for k in range(count))
