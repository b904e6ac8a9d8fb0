"""How well the mount is calibrated, and what it is worth: mounts that are off, seeds and worlds, through the simulator's own laser.

No physics: the robot stands where the ground puts it, and turns on the spot between the places. The true tilt follows the measured one
by scale, offset and backlash; mount and noise are drawn from the seed.

    python benchmarks/mount_accuracy.py --worlds rooms,ramp,moon --seeds 1-10
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from registration_worlds import drive_poses, world_of

from exploration_evaluation.scores import map_error
from mount_calibration import (
    MountCalibrationConfig,
    Place,
    TiltCalibration,
    TiltedBeams,
    TiltGeometry,
    estimate_mount,
    steady_directions,
    tilt_directions,
)
from pybullet_simulation.config import SimulationConfig
from pybullet_simulation.laser import Laser, Motion
from pybullet_simulation.robot_model import read_robot_model
from pybullet_simulation.sweep_profile import sweep_profile
from pybullet_simulation.world import World
from rigid_geometry import transform_from_rpy
from robot_body import RobotBody
from sweep_assembly import Scan, ScanFilter, ScanFilterConfig, ScanGeometry

Array = NDArray[np.float64]
STEP_S, SCAN_S, REST_S = 0.005, 0.025, 0.25
COLUMNS = ("offset", "scale", "backlash", "roll")
UNITS = np.array([180 / math.pi, 100, 180 / math.pi, 180 / math.pi, 180 / math.pi])
ROBOT = read_robot_model(RobotBody())
GEOMETRY = TiltGeometry(ROBOT.T_base_mount, ROBOT.T_tilt_laser)
ODOMETRY_LEVEL_RAD = 0.002


@dataclass(frozen=True, eq=False)
class BentMount:
    """The simulated laser on a mount that is off by a calibration, in one world."""

    world: World
    truth: TiltCalibration
    seed: int

    def sweep(self, T_map_base: Array, index: int) -> TiltedBeams:
        """All hits of one sweep, with what the encoder says."""
        rng = np.random.default_rng([self.seed, 77, index])
        config = SimulationConfig(mount_roll_rad=self.truth.mount_roll_rad, tilt_backlash_rad=0.0, tilt_offset_sigma_rad=0.0)
        laser, profile = Laser(config, ROBOT, self.world, rng), sweep_profile(config)
        ticks = math.ceil((profile.duration_s + 2 * REST_S) / SCAN_S)
        steps = np.arange(ticks * round(SCAN_S / STEP_S) + 1, dtype=np.float64) * STEP_S
        commanded = profile.tilt_at(steps - REST_S)
        bent = self.truth.true_tilt(commanded, tilt_directions(commanded, self.truth.backlash_rad))
        motion = Motion(np.tile(T_map_base[:3, :3], (len(steps), 1, 1)), np.tile(T_map_base[:3, 3], (len(steps), 1)), bent, STEP_S)
        stamps = np.arange(ticks + 1, dtype=np.float64) * SCAN_S
        scans = np.stack(laser.scans(motion, stamps[:-1]))
        measured = profile.tilt_at(stamps - REST_S) + config.tilt_encoder_sigma_rad * rng.standard_normal(ticks + 1)
        times = stamps[:-1, None] + np.arange(laser.geometry.beams) * laser.geometry.time_increment
        layout = ScanGeometry(laser.geometry.angle_min, laser.geometry.angle_increment, laser.geometry.time_increment, laser.geometry.beams)
        cleaning = ScanFilter(ScanFilterConfig(), GEOMETRY, RobotBody())
        beam_tilts = np.interp(times, stamps, measured)
        scans = np.stack([cleaning.filter(Scan(layout, scan), tilt) for scan, tilt in zip(scans, beam_tilts, strict=True)])
        hit = np.isfinite(scans)
        angles = np.broadcast_to(laser.geometry.angles, scans.shape)[hit]
        points = scans[hit][:, None] * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])
        tilts = beam_tilts[hit]
        return TiltedBeams(points.astype(np.float32), tilts, steady_directions(stamps, measured, times[hit]))


def drawn_mount(seed: int) -> TiltCalibration:
    """0.5 % of scale, 0.4 degrees of offset and of roll, each of either sign, and 0.3 degrees of backlash."""
    signs = np.random.default_rng([seed, 78]).choice([-1.0, 1.0], 3)
    return TiltCalibration(math.radians(0.4) * signs[0], 1.0 + 0.005 * signs[1], math.radians(0.3), math.radians(0.4) * signs[2])


def headings(T_map_base: Array, count: int) -> list[Array]:
    """A turn on the spot, in even steps."""
    return [T_map_base @ transform_from_rpy((0, 0, 0), (0, 0, 2 * math.pi * k / count)) for k in range(count)]


def odometry(poses: list[Array], seed: int) -> list[Array]:
    """What the odometry says of these poses: a level that is off alike at all of them, noise from one to the next."""
    rng = np.random.default_rng([seed, 79])
    level = rng.normal(0.0, ODOMETRY_LEVEL_RAD, 2)
    found = []
    for k, T in enumerate(poses):
        noise = rng.normal(0.0, (0.0005, 0.0005, 0.02 if k else 0.0))
        shift = rng.normal(0.0, 0.03 if k else 0.0, 3)
        found.append(T @ transform_from_rpy(shift, (level[0] + noise[0], level[1] + noise[1], noise[2])))
    return found


@dataclass(frozen=True, eq=False)
class Outcome:
    """Errors and sigmas of the four parameters, in degrees and percent, and the map's RMS distance from the truth in mm, by mount."""

    errors: Array
    sigmas: Array
    rms_mm: dict[str, float]


def outcome(name: str, seed: int, turns: int, spread: int) -> Outcome:
    """Calibrates at the start of a drive, and maps `spread` sweeps of it with a perfect mount, uncalibrated and calibrated."""
    world, truth = world_of(name, seed), drawn_mount(seed)
    mount, drive = BentMount(world, truth, seed), drive_poses(world, seed, max(spread, 1))
    poses = headings(drive[0], turns)
    places = [Place(mount.sweep(T, k), T_odom) for k, (T, T_odom) in enumerate(zip(poses, odometry(poses, seed), strict=True))]
    found = estimate_mount(places, GEOMETRY, MountCalibrationConfig(), RobotBody()).calibration
    calibrated = TiltGeometry(GEOMETRY.T_base_mount, GEOMETRY.T_tilt_laser, found)
    bent = [mount.sweep(T, 100 + k) for k, T in enumerate(drive[:spread])]
    straight = [BentMount(world, TiltCalibration(), seed).sweep(T, 100 + k) for k, T in enumerate(drive[:spread])]
    rms_mm = {
        "perfect": map_rms_mm(world, straight, drive, GEOMETRY),
        "uncalibrated": map_rms_mm(world, bent, drive, GEOMETRY),
        "calibrated": map_rms_mm(world, bent, drive, calibrated),
    }
    return Outcome(((found.values - truth.values) * UNITS)[:4], (found.sigmas * UNITS)[:4], rms_mm if spread else {})


def map_rms_mm(world: World, sweeps: list[TiltedBeams], poses: Array, mount: TiltGeometry) -> float:
    """RMS distance of the hits from the world's surfaces, by the judge's measure; the robot's poses are the true ones."""
    clouds = [mount.points_in_base(s.points_laser.astype(np.float64), s.tilts_rad, s.directions) for s in sweeps]
    placed = [cloud @ T[:3, :3].T + T[:3, 3] for cloud, T in zip(clouds, poses, strict=False)]
    return 1000.0 * map_error(np.concatenate(placed), world.vertices, world.triangles).rms_m if placed else math.nan


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--worlds", default="rooms,ramp")
    parser.add_argument("--seeds", default="1-3")
    parser.add_argument("--headings", type=int, default=1, help="places at which it is calibrated: a turn on the spot in so many steps")
    parser.add_argument("--sweeps", type=int, default=0, help="of the drive that is mapped; 0: none")
    arguments = parser.parse_args()
    low, _, high = arguments.seeds.partition("-")
    for name in arguments.worlds.split(","):
        found = []
        for seed in range(int(low), int(high or low) + 1):
            begin = time.perf_counter()
            one = outcome(name, seed, arguments.headings, arguments.sweeps)
            found.append(one)
            columns = [f"{n} {e:+.3f} ({s:.3f})" for n, e, s in zip(COLUMNS, one.errors, one.sigmas, strict=True)]
            print(
                name,
                seed,
                *columns,
                *(f"{k} {v:.1f} mm" for k, v in one.rms_mm.items()),
                f"{time.perf_counter() - begin:.0f} s",
                flush=True,
            )
        errors = np.array([np.where(np.isfinite(one.sigmas), one.errors, np.nan) for one in found])
        rms = np.sqrt(np.nanmean(errors**2, axis=0))
        print(
            name,
            "rms of errors:",
            *(f"{n} {e:.3f}" for n, e in zip(COLUMNS, rms, strict=True)),
            "most:",
            *(f"{e:.3f}" for e in np.nanmax(np.abs(errors), axis=0)),
            "of",
            np.isfinite(errors).sum(axis=0),
            flush=True,
        )


if __name__ == "__main__":
    main()
