"""Sweeps of a mount that is off, in a room whose walls, floor and ceiling are planes: ranges in closed form."""

import math

import numpy as np
from numpy.typing import NDArray

from mount_calibration import Place, TiltCalibration, TiltedBeams, TiltGeometry, steady_directions, tilt_directions
from rigid_geometry import transform_from_rpy

Array = NDArray[np.float64]
BASE_HEIGHT_M = 0.132
T_BASE_MOUNT, T_TILT_LASER = transform_from_rpy((0.20, 0.0, 0.75)), transform_from_rpy((0.03, 0.0, 0.04))
GEOMETRY = TiltGeometry(T_BASE_MOUNT, T_TILT_LASER)
LOW, HIGH = np.array([-3.6, -2.1, 0.0]), np.array([2.6, 3.1, 2.6])  # of the room, in the map
SCAN_S, BEAMS = 0.025, 541
AT = transform_from_rpy((0.0, 0.0, BASE_HEIGHT_M))
ANGLES = np.linspace(-0.75 * math.pi, 0.75 * math.pi, BEAMS)


def commanded() -> Array:
    """Measured tilts at the scans' starts: up fast, down slowly, and back to level."""
    up, down = np.arange(0.0, 2.88, 0.085), np.arange(2.88, -0.61, -0.03)
    return np.concatenate([np.zeros(3), up, down, np.arange(-0.61, 0.0, 0.085), np.zeros(3)])


def sweep(truth: TiltCalibration, T_map_base: Array = AT, seed: int = 1, noise_m: float = 0.01, step_m: float = 0.0) -> TiltedBeams:
    """All hits of one sweep; `step_m`: how much higher the floor lies in squares of 0.9 m, like those of a chess board."""
    rng, tilts = np.random.default_rng(seed), commanded()
    stamps = np.arange(len(tilts)) * SCAN_S
    true_tilts = TiltGeometry(T_BASE_MOUNT, T_TILT_LASER, truth)
    directions = tilt_directions(tilts, truth.backlash_rad)
    T = np.asarray(T_map_base) @ true_tilts.base_from_laser(tilts, directions)
    rays = np.column_stack([np.cos(ANGLES), np.sin(ANGLES), np.zeros(BEAMS)])
    toward = np.einsum("kij,nj->kni", T[:, :3, :3], rays)
    ranges = np.stack([_first_hit(T[k, :3, 3], toward[k], step_m) for k in range(len(tilts))])
    ranges += noise_m * rng.standard_normal(ranges.shape)
    times = np.repeat(stamps, BEAMS)
    return TiltedBeams(
        (ranges[:, :, None] * rays).reshape(-1, 3).astype(np.float32),
        np.repeat(tilts + 1e-4 * rng.standard_normal(len(tilts)), BEAMS),
        steady_directions(stamps, tilts, times),
    )


def place(truth: TiltCalibration, T_map_base: Array = AT, **more: float) -> Place:
    """One sweep, and a pose without error."""
    return Place(sweep(truth, T_map_base, **more), np.asarray(T_map_base))  # type: ignore[arg-type]


def _first_hit(origin: Array, toward: Array, step_m: float) -> Array:
    walls = np.where(toward > 0.0, HIGH - origin, LOW - origin) / np.where(toward == 0.0, np.nan, toward)
    walls = np.nan_to_num(walls, nan=np.inf)
    ranges = walls.min(axis=1)
    if step_m:
        on_floor = walls.argmin(axis=1) == 2
        xy = np.floor((origin + ranges[:, None] * toward)[:, :2] / 0.9).astype(int)
        raised = on_floor & (toward[:, 2] < 0.0) & (xy.sum(axis=1) % 2 == 0)
        ranges[raised] = (step_m - origin[2]) / toward[raised, 2]
    return np.asarray(ranges)
