"""How the laser tilts: a sweep goes fast over the nose to behind the robot, slowly back to above the horizon, then level.

A nod goes to and fro in front of the robot.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.config import SimulationConfig
from pybullet_simulation.lidar_config import SpinningLidarConfig
from pybullet_simulation.records import LidarGeometry

Array = NDArray[np.float64]
RateLaw = Callable[[float], float]

STEP_S = 0.001


@dataclass(frozen=True)
class SweepProfile:
    """Tilt (rad) and tilt rate (rad/s) over the time since the start of a move of the mount, (M,) each; it ends at rest."""

    times_s: Array
    tilts_rad: Array
    rates_rps: Array

    @property
    def duration_s(self) -> float:
        """Time from rest to rest."""
        return float(self.times_s[-1])

    def tilt_at(self, elapsed_s: Array) -> Array:
        """Tilt at times since the start; that of its ends before and after."""
        return np.interp(elapsed_s, self.times_s, self.tilts_rad)

    def rate_at(self, elapsed_s: Array) -> Array:
        """Tilt rate at times since the start; zero before and after."""
        return np.interp(elapsed_s, self.times_s, self.rates_rps)


@dataclass(frozen=True)
class Nod:
    """The moves of a mount that nods: from level to its lowest tilt, up, down, and from either end back to level."""

    begin: SweepProfile
    up: SweepProfile
    down: SweepProfile
    ends: tuple[SweepProfile, SweepProfile]

    def after(self, tilt_rad: float) -> SweepProfile:
        """The move that follows on the one that has ended at a tilt."""
        if tilt_rad == 0.0:
            return self.begin
        return self.up if tilt_rad == self.up.tilts_rad[0] else self.down

    def to_level(self, tilt_rad: float) -> SweepProfile:
        """The way back from the end that the mount is at."""
        return self.ends[0] if tilt_rad == self.up.tilts_rad[0] else self.ends[1]


def within_limits(
    config: SimulationConfig, lidar: SpinningLidarConfig | None, limits_rad: tuple[float, float]
) -> tuple[SimulationConfig, SpinningLidarConfig | None]:
    """Both with sweeps and nods that end where the joint's limits are, where these are nearer."""
    least, most = limits_rad
    starts, ends = min(config.sweep_start_rad, most), max(config.sweep_end_rad, least)
    lowest, highest = min(config.nod_lowest_rad, most), max(config.nod_highest_rad, least)
    config = replace(config, sweep_start_rad=starts, sweep_end_rad=ends, nod_lowest_rad=lowest, nod_highest_rad=highest)
    if lidar is None:
        return config, None
    return config, replace(lidar, sweep_start_rad=min(lidar.sweep_start_rad, most), sweep_end_rad=max(lidar.sweep_end_rad, least))


def nod_moves(config: SimulationConfig) -> Nod:
    """The nod of a config: the law of the sweep, as many times faster or slower as its half-period asks for."""
    low, high = config.nod_lowest_rad, config.nod_highest_rad
    law, tilts = _even_lines(config), np.linspace(high, low, 2000)
    factor = float(np.trapezoid([1.0 / law(tilt) for tilt in tilts], tilts)) / config.nod_half_period_s

    def scaled(tilt: float) -> float:
        return min(factor * law(tilt), config.slew_rate_rps)

    def move(start: float, goal: float) -> SweepProfile:
        moved = [start], [0.0]
        _append_move(*moved, goal, scaled, config.tilt_acceleration_rps2)
        return _profile(*moved)

    return Nod(move(0.0, low), move(low, high), move(high, low), (move(low, 0.0), move(high, 0.0)))


def sweep_profile(config: SimulationConfig) -> SweepProfile:
    """The profile of a config; its slow part goes with sin^2(tilt), for a ground line lies h / tan(tilt) ahead and lines shall be even."""

    return _sweep(config, config.sweep_start_rad, config.sweep_end_rad, _even_lines(config))


def spinning_sweep_profile(config: SimulationConfig, lidar: SpinningLidarConfig) -> SweepProfile:
    """The profile with a spinning lidar: the same law, as many times faster or slower as `revolutions` ask for."""
    law = _even_lines(config)
    tilts = np.linspace(lidar.sweep_end_rad, lidar.sweep_start_rad, 2000)
    nominal_s = float(np.trapezoid([1.0 / law(tilt) for tilt in tilts], tilts))
    factor = nominal_s / (lidar.revolutions * LidarGeometry.duration_s)
    return _sweep(config, lidar.sweep_start_rad, lidar.sweep_end_rad, lambda tilt: min(factor * law(tilt), config.slew_rate_rps))


def _even_lines(config: SimulationConfig) -> RateLaw:
    """Tilt rate by tilt: slow where the scan plane is level."""

    def law(tilt: float) -> float:
        return config.sweep_min_rate_rps + (config.sweep_max_rate_rps - config.sweep_min_rate_rps) * math.sin(tilt) ** 2

    return law


def _sweep(config: SimulationConfig, start_rad: float, end_rad: float, slow: RateLaw) -> SweepProfile:
    """From level fast to the start, by the slow law to the end, and fast back to level."""

    def slew(tilt: float) -> float:
        return config.slew_rate_rps

    tilts, rates = [0.0], [0.0]
    for goal, law in ((start_rad, slew), (end_rad, slow), (0.0, slew)):
        _append_move(tilts, rates, goal, law, config.tilt_acceleration_rps2)
    return _profile(tilts, rates)


def _profile(tilts: list[float], rates: list[float]) -> SweepProfile:
    return SweepProfile(np.arange(len(tilts), dtype=np.float64) * STEP_S, np.array(tilts), np.array(rates))


def _append_move(tilts: list[float], rates: list[float], goal: float, law: RateLaw, acceleration: float) -> None:
    """Extend the samples by a move from rest to rest that follows the rate law as far as the acceleration allows."""
    sign = 1.0 if goal > tilts[-1] else -1.0
    tilt, speed = tilts[-1], 0.0
    while True:
        left = (goal - tilt) * sign
        speed = min(speed + acceleration * STEP_S, law(tilt), math.sqrt(2.0 * acceleration * left))
        if left <= speed * STEP_S or left < 1e-5:
            break
        tilt += sign * speed * STEP_S
        tilts.append(tilt)
        rates.append(sign * speed)
    tilts.append(goal)
    rates.append(0.0)
