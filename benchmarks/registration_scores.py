"""What the benchmarks of registration share: guesses drawn with an honest covariance, errors in the held directions, tables, files."""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import gtsam
import numpy as np
from numpy.typing import NDArray
from registration_cases import DEFAULT_CACHE, MOUNTS, Case

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.cloud import PointCloud, voxel_downsample
from pose_graph_mapping.registration.matching import Registration, RegistrationResult, Verdict
from rigid_geometry import inverse, transform_from_rpy

Array = NDArray[np.float64]

RIGHT_M, RIGHT_DEG = 0.05, 0.5
FAR_OFF_M, FAR_OFF_DEG = 0.20, 3.0
TILT_SIGMA_RAD = math.radians(0.5)  # of roll and pitch: gravity is known
Z_SHARE = 0.3  # of the horizontal shift


@dataclass(frozen=True)
class Guess:
    """A disturbed T_map_base, and the covariance (6, 6) that is claimed for it: rotation, translation, in its body frame; or None."""

    T_map_base: Array
    covariance: Array | None


def uniform_guess(rng: np.random.Generator, T_true: Array, yaw_rad: float, shift_m: float, claimed: bool) -> Guess:
    """Yaw off by up to `yaw_rad` to either side, shifted within a disc of `shift_m` and by up to 0.3 of it in height."""
    bearing, radius = rng.uniform(-math.pi, math.pi), shift_m * math.sqrt(rng.random())
    shift = np.array([radius * math.cos(bearing), radius * math.sin(bearing), rng.uniform(-1.0, 1.0) * Z_SHARE * shift_m])
    yaw = rng.choice([-1.0, 1.0]) * rng.uniform(0.0, yaw_rad)
    T_guess = disturbed(T_true, float(yaw), shift, rng.normal(0.0, TILT_SIGMA_RAD, 2))
    return Guess(T_guess, claimed_covariance(T_guess, yaw_rad / 2, shift_m / 2) if claimed else None)


def normal_guess(rng: np.random.Generator, T_true: Array, yaw_sigma_rad: float, shift_sigma_m: float) -> Guess:
    """Normally distributed errors of yaw, of x and y each, and 0.3 of that in height, with the covariance that they have."""
    shift = rng.normal(0.0, shift_sigma_m, 3) * [1.0, 1.0, Z_SHARE]
    T_guess = disturbed(T_true, float(rng.normal(0.0, yaw_sigma_rad)), shift, rng.normal(0.0, TILT_SIGMA_RAD, 2))
    return Guess(T_guess, claimed_covariance(T_guess, yaw_sigma_rad, shift_sigma_m))


def disturbed(T_true: Array, yaw_rad: float, shift_m: Array, tilt_rad: Array) -> Array:
    """Turned about the vertical through the robot, shifted by (3,) in map, then rolled and pitched in its own frame by (2,)."""
    T = T_true @ transform_from_rpy((0.0, 0.0, 0.0), (float(tilt_rad[0]), float(tilt_rad[1]), 0.0))
    T[:3, :3] = transform_from_rpy((0.0, 0.0, 0.0), (0.0, 0.0, yaw_rad))[:3, :3] @ T[:3, :3]
    T[:3, 3] = T_true[:3, 3] + shift_m
    return T


def claimed_covariance(T_guess: Array, yaw_sigma_rad: float, shift_sigma_m: float) -> Array:
    """(6, 6) in the body frame of sigmas about and along the axes of map."""
    R = T_guess[:3, :3]
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = R.T @ np.diag([TILT_SIGMA_RAD**2, TILT_SIGMA_RAD**2, yaw_sigma_rad**2]) @ R
    covariance[3:, 3:] = R.T @ np.diag([1.0, 1.0, Z_SHARE**2]) @ R * shift_sigma_m**2
    return covariance


@dataclass(frozen=True)
class Outcome:
    """One match judged by the truth: error in the directions that it claims to hold, its verdict, and how long it took."""

    case: str
    verdict: Verdict
    reason: str
    metres: float
    degrees: float
    milliseconds: float

    @property
    def usable(self) -> bool:
        return self.verdict in (Verdict.ACCEPTED, Verdict.DEGENERATE)

    @property
    def right(self) -> bool:
        """Usable, and within 5 cm and 0.5 deg of the truth."""
        return self.usable and self.metres < RIGHT_M and self.degrees < RIGHT_DEG

    @property
    def wrong(self) -> bool:
        """Usable, and not right."""
        return self.usable and not self.right

    @property
    def far_off(self) -> bool:
        """Usable, and more than 20 cm or 3 deg from the truth: what no map survives. NaN, for no truth at all, is far off too."""
        return self.usable and not (self.metres <= FAR_OFF_M and self.degrees <= FAR_OFF_DEG)


def body_error(T_true: Array, T_found: Array) -> Array:
    """(6,) logarithm of inverse(T_true) @ T_found: rotation in rad, translation in m."""
    return np.asarray(gtsam.Pose3.Logmap(gtsam.Pose3(inverse(T_true) @ T_found)))


def held_error(T_true: Array, result: RegistrationResult, reading: PointCloud) -> tuple[float, float]:
    """Metres and degrees that are left of the error when its part along the degenerate directions is taken out."""
    error = body_error(T_true, result.T_reference_reading)
    if len(result.degenerate_directions):
        points = voxel_downsample(reading, RegistrationConfig().voxel_m).points
        rms = math.sqrt(float(np.mean(np.sum(points**2, axis=1))))
        scaled = error * [rms, rms, rms, 1.0, 1.0, 1.0]
        basis = np.linalg.svd(result.degenerate_directions, full_matrices=False)[2]
        error = (scaled - basis.T @ (basis @ scaled)) / [rms, rms, rms, 1.0, 1.0, 1.0]
    left = gtsam.Pose3.Expmap(error).matrix()
    return float(np.linalg.norm(left[:3, 3])), math.degrees(float(np.linalg.norm(error[:3])))


def judged(name: str, matcher: Registration, case: Case, guess: Guess, T_true: Array | None) -> tuple[Outcome, RegistrationResult]:
    """Match a case from a guess, timed; without `T_true` nothing is right, and the error is NaN."""
    start = time.perf_counter()
    result = matcher.match(case.reference, case.reading, guess.T_map_base, guess.covariance)
    milliseconds = 1e3 * (time.perf_counter() - start)
    metres, degrees = (math.nan, math.nan) if T_true is None else held_error(T_true, result, case.reading)
    return Outcome(name, result.verdict, result.reason, metres, degrees, milliseconds), result


def share(flags: Sequence[bool]) -> float:
    """Percent of true ones; NaN of none."""
    return 100.0 * sum(flags) / len(flags) if flags else math.nan


def text_table(header: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Columns of plain text, the first to the left and the rest to the right; floats with one digit."""
    cells = [list(header), *([f"{c:.1f}" if isinstance(c, float) else str(c) for c in row] for row in rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(header))]
    lines = ["  ".join([row[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))]) for row in cells]
    return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:]])


def describe(outcome: Outcome) -> str:
    """One line about one match."""
    error = "no truth" if math.isnan(outcome.metres) else f"{100 * outcome.metres:.1f} cm {outcome.degrees:.2f} deg off"
    return f"{outcome.case}: {outcome.verdict.value}, {error}, {outcome.milliseconds:.0f} ms; {outcome.reason}"


def argument_parser(description: str | None) -> argparse.ArgumentParser:
    """What every benchmark of registration takes."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, default=DEFAULT_CACHE, help="folder for sweeps, about 35 MB a drive of ten pairs")
    parser.add_argument("--json", type=Path, metavar="FILE", help="all that was measured, for other programs")
    return parser


def matcher_parser(description: str | None) -> argparse.ArgumentParser:
    """What those take that measure one registration, with one mount, from seeded guesses."""
    parser = argument_parser(description)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--mount", choices=MOUNTS, default="nominal")
    parser.add_argument("--method", default=RegistrationConfig().method)
    return parser


def write_json(path: Path | None, content: object) -> None:
    """Writes what was measured, if a file was asked for; OSError when it cannot be written."""
    if path is not None:
        path.write_text(json.dumps(content, indent=1, default=str) + "\n", encoding="utf-8")
