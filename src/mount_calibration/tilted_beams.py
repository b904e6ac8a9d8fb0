"""Hits of the laser as the calibration takes them: in `laser`, each with the tilt that was measured and the way it moved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mount_calibration.geometry import TiltGeometry
from mount_calibration.tilt_calibration import FloatArray, tilt_directions
from rigid_geometry import as_transform, inverse, rotation_angle

REVERSAL_RAD = 0.04  # to be moved after a turn, half of it at the start: more than any play of use
REVERSED = 0.05  # noise of the encoder over REVERSAL_RAD: so near to the end of its play the mount counts as moved
SAME_M, SAME_RAD = 0.01, 0.005  # odometry of a robot that stands
INTERPOLATION_RAD = 2e-4  # a tenth of what is asked of the backlash


@dataclass(frozen=True, eq=False)
class TiltedBeams:
    """(N, 3) hits in `laser` (m), (N,) measured tilts (rad), and (N,) directions: +1 rising, -1 falling, 0 unknown or not steady."""

    points_laser: NDArray[np.float32]
    tilts_rad: FloatArray
    directions: NDArray[np.int8]

    def __len__(self) -> int:
        return len(self.points_laser)

    def chosen(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> TiltedBeams:
        """Some of the beams."""
        return TiltedBeams(self.points_laser[which], self.tilts_rad[which], self.directions[which])


@dataclass(frozen=True, eq=False)
class Place:
    """Sweeps that were made while the robot stood at one place: their beams, and the (4, 4) pose of base_link there.

    The pose is the odometry's or the map's. Its roll and pitch come of gravity.
    """

    beams: TiltedBeams
    T_map_base: FloatArray


def joined_places(places: Sequence[Place]) -> list[Place]:
    """Sweeps of a robot that stood still between them count as one place: what follows one another within `SAME_M` and `SAME_RAD`."""
    found: list[Place] = []
    for place in places:
        last = found[-1] if found else None
        apart = inverse(as_transform(last.T_map_base)) @ as_transform(place.T_map_base) if last else np.eye(4)
        if last is None or np.linalg.norm(apart[:3, 3]) > SAME_M or rotation_angle(apart) > SAME_RAD:
            found.append(place)
        else:
            found[-1] = Place(_together(last.beams, place.beams), last.T_map_base)
    return found


def _together(first: TiltedBeams, second: TiltedBeams) -> TiltedBeams:
    return TiltedBeams(
        np.concatenate([first.points_laser, second.points_laser]),
        np.concatenate([first.tilts_rad, second.tilts_rad]),
        np.concatenate([first.directions, second.directions]),
    )


def points_and_jacobian(beams: TiltedBeams, geometry: TiltGeometry) -> tuple[FloatArray, FloatArray]:
    """(N, 3) hits in base_link, and (N, 3, 4) their derivatives by offset, scale, backlash and roll of the geometry's calibration."""
    direction, none = beams.directions.astype(np.float64), np.zeros(len(beams))
    turned = geometry.turned(beams.points_laser.astype(np.float64), beams.tilts_rad, direction)
    R_base_mount, R_mount_true = geometry.T_base_mount[:3, :3], geometry.calibration.T_mount_true[:3, :3]
    leaning = turned @ R_mount_true.T
    by_offset = np.column_stack([turned[:, 2], none, -turned[:, 0]]) @ (R_base_mount @ R_mount_true).T
    by_roll = np.column_stack([none, -leaning[:, 2], leaning[:, 1]]) @ R_base_mount.T
    columns = [by_offset, beams.tilts_rad[:, None] * by_offset, -0.5 * direction[:, None] * by_offset, by_roll]
    return leaning @ R_base_mount.T + geometry.T_base_mount[:3, 3], np.stack(columns, axis=2)


def steady_directions(stamps_s: FloatArray, tilts_rad: FloatArray, times_s: FloatArray) -> NDArray[np.int8]:
    """(N,) directions at (N,) times of a mount whose (M,) joint samples are given, 0 where they do not say it.

    They do not right after a reversal, at rest before any motion, and where the mount speeds up so much that its tilt between two
    samples is not known.
    """
    step, rates = np.diff(tilts_rad), np.diff(tilts_rad) / np.diff(stamps_s)
    direction = np.trunc(tilt_directions(tilts_rad, REVERSAL_RAD) * (1.0 + REVERSED))
    change = np.abs(np.diff(rates, prepend=rates[0], append=rates[-1])) if len(rates) else np.zeros(len(tilts_rad))
    uneven = np.maximum(change[:-1], change[1:]) * np.diff(stamps_s) / 8.0 > INTERPOLATION_RAD
    between = np.where((direction[:-1] == direction[1:]) & ~uneven, direction[1:], 0).astype(np.int8)
    at = np.searchsorted(stamps_s, times_s, side="right") - 1
    inside = (at >= 0) & (at < len(step))
    return np.where(inside, between[np.clip(at, 0, max(len(step) - 1, 0))], np.int8(0)).astype(np.int8)
