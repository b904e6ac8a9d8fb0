"""Drives through the simulator, as the stages behind scan filter and odometry hear them, with the truth beside: kept in a cache folder.

The robot follows straight legs between places that can be stood on, by the truth, at 0.5 m/s, and turns on the spot between them. It either
stops every so many metres for a whole sweep and drives with its laser level, or nods without a pause once it has swept at the start.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import pickle
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from registration_worlds import Ground, next_spot, world_of

from odometry_fusion import FusedOdometry, OdometryConfig, OdometryEstimate
from pybullet_simulation import TICK_S, Simulation, SimulationConfig, World, load_world
from pybullet_simulation.robot_model import read_robot_model
from pybullet_simulation.trace import Tilts
from rigid_geometry import angle_difference, interpolate_transforms, yaw_of
from robot_body import RobotBody
from sensor_checks import ImuLimits
from sweep_assembly import Scan, ScanChain, ScanFilterConfig, ScanGeometry, TiltGeometry

Array = NDArray[np.float64]

LAYOUT = 2  # of the cached files; to be raised when what is in them changes
TILT_JOINT = read_robot_model(RobotBody()).tilt_joint
CLEAR_S, REST_S = 1.0, 1.5
NEAR_M, TURN_RPS, ALIGNED_RAD = 0.15, 0.8, 0.1
TICKS_A_METRE = 300  # after which a robot that is not there has stuck


@dataclass(frozen=True)
class DriveRequest:
    """What is driven: a world and a seed, so many metres; `stop_every_m` 0 nods instead, half a period taking `half_period_s`."""

    world: str
    seed: int
    length_m: float = 30.0
    stop_every_m: float = 10.0
    half_period_s: float = 2.75
    speed_mps: float = 0.5
    simulation: SimulationConfig = field(default_factory=SimulationConfig)


@dataclass(frozen=True, eq=False)
class Tick:
    """What came in a tick: tilts, odometry and filtered scans with their stamps, and whether the robot sweeps standing."""

    stamp_s: float
    tilts: list[tuple[float, float]]
    odometry: list[OdometryEstimate]
    scans: list[tuple[float, Scan]]
    sweeping: bool


@dataclass(frozen=True, eq=False)
class DrivenRecord:
    """All ticks of a drive, the mount, and the truth at the end of every tick: (T,) stamps, (T, 4, 4) T_world_base."""

    ticks: list[Tick]
    mount: TiltGeometry
    truth_stamps_s: Array
    truth: Array

    def truth_at(self, stamps_s: Array) -> Array:
        """(K, 4, 4) true poses at (K,) times."""
        return interpolate_transforms(self.truth_stamps_s, self.truth, np.clip(stamps_s, self.truth_stamps_s[0], self.truth_stamps_s[-1]))


class Nodding(Simulation):
    """The same robot, with a mount that nods between the ends of its sweep from `nod_from_s` on; no request for a sweep is heard then."""

    nod_from_s = math.inf
    half_period_s = 2.75

    def _tilts(self, times_s: Array) -> Tilts:
        if times_s[-1] <= self.nod_from_s:
            return super()._tilts(times_s)
        grid, tilts = _half_nod(self._config, self.half_period_s)
        level_s = float(np.interp(0.0, tilts, grid))

        def tilt(times: Array) -> Array:
            phase = (times - self.nod_from_s + level_s) % (2.0 * self.half_period_s)
            return np.interp(np.where(phase > self.half_period_s, 2.0 * self.half_period_s - phase, phase), grid, tilts)

        measured = np.where(times_s < self.nod_from_s, 0.0, tilt(times_s))
        rates = (tilt(times_s + 1e-3) - tilt(times_s - 1e-3)) / 2e-3
        return Tilts(self._mount.true_tilts(measured), measured, rates)


def _half_nod(config: SimulationConfig, half_period_s: float) -> tuple[Array, Array]:
    """Times and tilts of half a nod: from up in front to down behind, by the sweep's law of even lines."""
    tilts = np.linspace(config.sweep_end_rad, config.sweep_start_rad, 2000)
    slow = config.sweep_min_rate_rps + (config.sweep_max_rate_rps - config.sweep_min_rate_rps) * np.sin(tilts) ** 2
    times = np.concatenate([[0.0], np.cumsum(np.diff(tilts) / (0.5 * (slow[1:] + slow[:-1])))])
    return times * half_period_s / times[-1], tilts


def driven_record(request: DriveRequest, cache: Path) -> DrivenRecord:
    """The drive, made anew where the cache folder does not have it; ValueError for an unknown world, or where no such drive was found."""
    key = hashlib.sha256(repr((LAYOUT, sorted(asdict(request).items()))).encode()).hexdigest()[:16]
    path = cache / f"driven_{Path(request.world).stem}_{request.seed}_{key}.pickle"
    if path.is_file():
        found: DrivenRecord = pickle.loads(path.read_bytes())
        return found
    record = _drive(request)
    cache.mkdir(parents=True, exist_ok=True)
    path.write_bytes(pickle.dumps(record, protocol=pickle.HIGHEST_PROTOCOL))
    return record


def _world(request: DriveRequest) -> World:
    is_file = Path(request.world).is_file()
    return load_world(request.world, request.seed, start=(0.0, 0.0, 0.0)) if is_file else world_of(request.world, request.seed)


def _spots(world: World, request: DriveRequest) -> list[Array]:
    """Places (x, y, z, yaw) one after the other, from the start on, until the way is long enough."""
    ground, (x, y, yaw) = Ground(world), world.start_xyyaw
    for attempt in range(20):
        rng, length = np.random.default_rng([request.seed, 33, attempt]), 0.0
        spots = [np.array([x, y, world.start_z, yaw])]
        while length < request.length_m and (spot := next_spot(ground, spots, rng)) is not None:
            length += float(np.linalg.norm(spot[:2] - spots[-1][:2]))
            spots.append(spot)
        if length >= request.length_m:
            return spots[1:]
    raise ValueError(f"no drive of {request.length_m} m was found in {world.name}")


class _Chain:
    """The simulator's messages through scan filter and odometry."""

    def __init__(self, mount: TiltGeometry, R_base_imu: Array, geometry: ScanGeometry) -> None:
        self._scans = ScanChain(ScanFilterConfig(), mount, RobotBody())
        self._fused = FusedOdometry(OdometryConfig(), ImuLimits(), RobotBody(), lambda frame: R_base_imu)
        self._geometry = geometry

    def tick(self, simulation: Simulation, v: float, w: float) -> tuple[Tick, Array]:
        data = simulation.tick(v, w)
        tilts = [(j.stamp_s, j.positions[j.names.index(TILT_JOINT)]) for j in data.joints]
        for stamp_s, tilt in tilts:
            self._scans.add_joint(stamp_s, tilt)
        for scan in data.scans:
            limits = simulation.scan_geometry
            self._scans.add_scan(scan.stamp_s, Scan(self._geometry, scan.ranges, limits.range_min, limits.range_max, limits.scan_time))
        for sample in data.imu:
            with contextlib.suppress(ValueError):  # the node drops such a sample, too
                self._fused.add_imu(sample.stamp_s, "imu_link", sample.gyro.tolist(), sample.accel.tolist())
        for wheels in data.wheel_odometry:
            self._fused.add_wheels(wheels.stamp_s, wheels.v, wheels.w)
        scans = [(done.stamp_s, done.scan) for done in self._scans.poll()]
        return Tick(data.stamp_s, tilts, list(self._fused.poll()), scans, data.sweeping), data.truth.T_world_base


def _drive(request: DriveRequest) -> DrivenRecord:
    world = _world(request)
    simulation = Nodding(request.simulation, world, request.seed)
    simulation.half_period_s = request.half_period_s
    robot, layout = read_robot_model(RobotBody()), simulation.scan_geometry
    mount = TiltGeometry(robot.T_base_mount, robot.T_tilt_laser)
    chain = _Chain(
        mount, robot.T_base_imu[:3, :3], ScanGeometry(layout.angle_min, layout.angle_increment, layout.time_increment, layout.beams)
    )
    ticks, truth = [], []
    for v, w in _commands(simulation, _spots(world, request), request):
        tick, T_world_base = chain.tick(simulation, v, w)
        ticks.append(tick)
        truth.append(T_world_base)
    simulation.close()
    return DrivenRecord(ticks, mount, np.array([tick.stamp_s for tick in ticks]), np.array(truth))


def _commands(simulation: Nodding, spots: list[Array], request: DriveRequest) -> Iterator[tuple[float, float]]:
    """One a tick: a sweep at the start, the way with what sweeps it needs, and one at the end."""
    yield from _standing_sweep(simulation)
    if not request.stop_every_m:
        simulation.nod_from_s = simulation.stamp_s
    gone, last, patience = 0.0, simulation.T_world_base[:2, 3], round(TICKS_A_METRE * request.length_m)
    for spot in spots:
        while (left := float(np.linalg.norm(spot[:2] - simulation.T_world_base[:2, 3]))) > NEAR_M and (patience := patience - 1):
            here = simulation.T_world_base
            gone, last = gone + float(np.linalg.norm(here[:2, 3] - last)), here[:2, 3]
            if request.stop_every_m and gone >= request.stop_every_m:
                yield from _standing_sweep(simulation)
                gone = 0.0
            off = angle_difference(math.atan2(*(spot[:2] - here[:2, 3])[::-1]), yaw_of(here))
            forward = min(request.speed_mps, left) if abs(off) < ALIGNED_RAD or left < 2 * NEAR_M else 0.0
            yield forward, float(np.clip(2.0 * off, -TURN_RPS, TURN_RPS))
    if not patience:
        raise ValueError(f"the robot stuck in {request.world}, seed {request.seed}, at {simulation.T_world_base[:3, 3].round(2)}")
    if request.stop_every_m:
        yield from _standing_sweep(simulation)
    else:
        yield from [(0.0, 0.0)] * round(REST_S / TICK_S)


def _standing_sweep(simulation: Simulation) -> Iterator[tuple[float, float]]:
    yield from [(0.0, 0.0)] * round(CLEAR_S / TICK_S)
    simulation.start_sweep()
    yield 0.0, 0.0
    while simulation.sweeping:
        yield 0.0, 0.0
    yield from [(0.0, 0.0)] * round(REST_S / TICK_S)
