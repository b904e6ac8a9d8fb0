"""How the robot sees a shape: full sweeps of the tilting laser through scan filter and assembler, at true poses."""

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from registration_worlds import Ground
from shape import Scene, Shape, Stand

from octomap_server_3dnav.octree.map_builder import Beams, MapBuilder, MapConfig
from octomap_server_3dnav.octree.octree import SensorModel
from pybullet_simulation import IDEAL
from pybullet_simulation.laser import Laser, Motion
from pybullet_simulation.robot_model import read_robot_model
from pybullet_simulation.solids import Solid
from pybullet_simulation.start_pose import Demand, StandingTest
from pybullet_simulation.sweep_profile import sweep_profile
from pybullet_simulation.world import World, joined
from rigid_geometry import transform_from_rpy
from robot_body import RobotBody
from sweep_assembly import LaserScans, Scan, ScanFilter, ScanFilterConfig, ScanGeometry, SweepAssembler, SweepAssemblyConfig, TiltGeometry

Array = NDArray[np.float64]

STEP_S, SCAN_S, START_S = 0.005, 0.025, 0.25
STAND_REACH_M = 0.15  # the ground lies so near to the height that a stand gives
BEFORE_M = 0.05  # what swallows a beam lies so much before what it hits: the robot's body does not, which is seen twice
CLIMBING = Demand(around_m=None, max_slope_rad=math.radians(25.1), max_roughness_m=0.10)


class StandingLaser:
    """Sweeps of a robot that stands still among solids; `mute` ones swallow the beams that meet them first."""

    def __init__(self, scene: Scene, rng: np.random.Generator) -> None:
        config, robot, self._rng = IDEAL, read_robot_model(RobotBody()), rng
        self._sigma_rad, self._profile = config.tilt_encoder_sigma_rad, sweep_profile(config)
        self._laser = Laser(config, robot, world_of(scene.solids), rng)
        self._swallow = Laser(config, robot, world_of(scene.mute), np.random.default_rng(0)) if scene.mute else None
        layout = self._laser.geometry
        self._geometry = ScanGeometry(layout.angle_min, layout.angle_increment, layout.time_increment, layout.beams)
        self._tilt_geometry = TiltGeometry(robot.T_base_mount, robot.T_tilt_laser)
        self._filter = ScanFilter(ScanFilterConfig(), self._tilt_geometry, RobotBody())

    def sweep(self, T_map_base: Array) -> Beams:
        """One sweep in base_link."""
        ticks = math.ceil((self._profile.duration_s + 2 * START_S) / SCAN_S)
        stamps = np.arange(ticks + 1, dtype=np.float64) * SCAN_S
        measured = self._profile.tilt_at(stamps - START_S) + self._sigma_rad * self._rng.standard_normal(ticks + 1)
        assembler = SweepAssembler(SweepAssemblyConfig(), LaserScans(), self._tilt_geometry)
        for stamp, tilt, scan in zip(stamps, measured, self._scans(T_map_base, stamps[:-1]), strict=False):
            tilts = np.interp(stamp + self._geometry.beam_times, stamps, measured)
            assembler.add_odometry(stamp, np.eye(4))
            assembler.add_joint(stamp, tilt)
            assembler.add_scan(stamp, self._filtered(scan, tilts))
        found = assembler.poll()
        if found is None:
            raise RuntimeError(f"no sweep came out of {ticks} scans: {assembler.dropped}")
        return Beams(found.points, found.origins, found.free_ends, found.free_origins)

    def _filtered(self, ranges: NDArray[np.float32], tilts: Array) -> Scan:
        scan = Scan(self._geometry, ranges)
        return replace(scan, ranges=self._filter.filter(scan, tilts))

    def _scans(self, T_map_base: Array, starts_s: Array) -> list[NDArray[np.float32]]:
        motion = self._motion(T_map_base, len(starts_s))
        scans = self._laser.scans(motion, starts_s)
        if self._swallow is None:
            return scans
        panes = self._swallow.scans(motion, starts_s)
        return [np.where(pane < scan - BEFORE_M, np.float32(np.inf), scan) for pane, scan in zip(panes, scans, strict=True)]

    def _motion(self, T_map_base: Array, ticks: int) -> Motion:
        steps = (ticks + 1) * round(SCAN_S / STEP_S) + 1
        tilts = self._profile.tilt_at(np.arange(steps, dtype=np.float64) * STEP_S - START_S)
        return Motion(np.tile(T_map_base[:3, :3], (steps, 1, 1)), np.tile(T_map_base[:3, 3], (steps, 1)), tilts, STEP_S)


def world_of(solids: Sequence[Solid]) -> World:
    """Solids as a world without a start."""
    vertices, triangles = joined(solids)
    extent = np.array([vertices.min(axis=0), vertices.max(axis=0)])
    return World("shape", tuple(solids), (), vertices, triangles, extent, (0.0, 0.0, 0.0), 0.0)


def poses_in(scene: Scene) -> list[Array]:
    """T_shape_base of the robot at every stand of a scene; ValueError where it could not stand."""
    world = world_of([*scene.solids, *scene.mute])
    test, ground = StandingTest(world.vertices, world.triangles, RobotBody()), Ground(world)
    return [_pose(test, ground, stand) for stand in scene.stands]


def _pose(test: StandingTest, ground: Ground, stand: Stand) -> Array:
    yaw = math.radians(stand.yaw_deg)
    levels = [z for z in test.ground_levels(stand.x, stand.y) if abs(z - stand.z) <= STAND_REACH_M]
    if not levels:
        raise ValueError(f"there is no ground to stand on at {stand}")
    why = test.obstruction(stand.x, stand.y, levels[0], yaw, CLIMBING)
    if why is not None:
        raise ValueError(f"the robot cannot stand at {stand}: {why}")
    return ground.pose(stand.x, stand.y, levels[0], yaw)


@dataclass(frozen=True, eq=False)
class Placement:
    """How a shape lies in the grid of voxels."""

    name: str
    T_map_shape: Array


# A shape is right when it is right wherever it lies: with its ground on a border of voxels and its edges along them, and with neither.
PLACEMENTS = (
    Placement("along the grid", np.eye(4)),
    Placement("turned", transform_from_rpy((0.03, 0.05, 0.035), (0.0, 0.0, math.radians(33.0)))),
)


@lru_cache(maxsize=4)
def sweeps_of(shape: Shape) -> list[tuple[Array, Beams]]:
    """T_shape_base and beams of every stand; the same at every call."""
    rng = np.random.default_rng(zlib.crc32(shape.name.encode()))
    found = []
    for scene in shape.scenes:
        laser = StandingLaser(scene, rng)
        found += [(T, laser.sweep(T)) for T in poses_in(scene)]
    return found


@lru_cache(maxsize=4)
def map_of(shape: Shape, placement: Placement, config: MapConfig, sensor_model: SensorModel) -> tuple[MapBuilder, Array]:
    """The map of all sweeps of a shape that stands somewhere in the voxel grid, and where the robot stands at last."""
    builder, poses = MapBuilder(config, sensor_model, RobotBody()), []
    for k, (T_shape_base, beams) in enumerate(sweeps_of(shape)):
        poses.append(placement.T_map_shape @ T_shape_base)
        builder.add_sweep(beams, k, np.array(poses))
    return builder, poses[-1]
