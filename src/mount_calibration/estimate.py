"""The calibration of a tilting mount from sweeps: hits that were measured twice, in different ways, lie on the same planes.

A mount that turns by more than half a turn measures some directions twice, in front of the laser and over its back: the scale. What was
measured while the tilt rose and while it fell: the backlash. Offset and roll turn all of one place's hits alike: only the ground
below the wheels tells them, or places of other headings together with the odometry. A pitch of the mount is a turn about the axis of the
tilt, and no measurement tells it from the offset: it is never estimated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mount_calibration.config import MountCalibrationConfig
from mount_calibration.geometry import TiltGeometry
from mount_calibration.ground_plane import ground_equations
from mount_calibration.plane_cells import FloatArray, IntArray, plane_equations
from mount_calibration.tilt_calibration import PARAMETERS, TiltCalibration
from mount_calibration.tilted_beams import Place, TiltedBeams, points_and_jacobian
from rigid_geometry import as_transform, tilt_angle, transform_from_rpy
from robot_body import RobotBody

ESTIMATED = 4  # of PARAMETERS, the first ones: all but the pitch
BIAS = slice(4, 6)
WEAK_SIGMAS = (0.1, 0.05, 0.05, 0.1)  # what a mount may be off before anything is measured
SETTLED = 1e-5  # a step so short, in rad and m, ends the fit
_USABLE_SIGMA_RAD = 0.004  # an angle known less well is not observable: 0.23 deg, half of what mounts are off by
_USABLE_SIGMA_SCALE = 0.001  # the same for the scale: at a tilt of a radian the same angle


@dataclass(frozen=True, eq=False)
class MountEstimate:
    """What sweeps say of the mount.

    `calibration`: with inf variance where something was not observable. `before_m`, `after_m`: rms distance of hits from the planes they
    share, as it was with the calibration that the estimate started from and with the new one. `planes`: how many. `reason`: why there
    is none, empty otherwise.
    """

    calibration: TiltCalibration
    before_m: float
    after_m: float
    planes: int
    reason: str = ""


def estimate_mount(places: Sequence[Place], geometry: TiltGeometry, config: MountCalibrationConfig, robot: RobotBody) -> MountEstimate:
    """The calibration that makes the planes of all places thinnest, searched from the one that `geometry` has.

    `robot` says where its wheels stand. ValueError when there is no place or a pose is not rigid.
    """
    if not places:
        raise ValueError("a calibration needs the sweeps of at least one place")
    return _Fit(places, geometry, config, robot).solved()


class _Fit:
    """One estimate under way: the state is (4 parameters, 2 biases of the odometry's level, 6 for each place but the first)."""

    def __init__(self, places: Sequence[Place], geometry: TiltGeometry, config: MountCalibrationConfig, robot: RobotBody) -> None:
        self._geometry, self._config, self._robot = geometry, config, robot
        self._beams = [_thinned(place.beams, config.most_beams // len(places), config.max_range_m) for place in places]
        self._odometry = [as_transform(place.T_map_base) for place in places]
        self._kinds = np.concatenate([4 * k + _kinds(beams) for k, beams in enumerate(self._beams)])
        self._size = 6 + 6 * (len(places) - 1)

    def solved(self) -> MountEstimate:
        """Gauss-Newton until it stands; at each step planes and ground are looked for afresh."""
        start, state = self._geometry.calibration, np.zeros(self._size)
        state[:ESTIMATED] = start.values[:ESTIMATED]
        first_m, thickness_m, planes = np.nan, np.nan, 0
        covariance = np.full((self._size, self._size), np.nan)
        for _ in range(self._config.iterations):
            points, jacobians = self._points(state)
            equations = plane_equations(*self._in_map(state, points, jacobians), self._kinds)
            if equations is None:
                return MountEstimate(start, first_m, np.nan, 0, "no plane was seen twice: rising and falling, or over the laser's back")
            first_m = equations.thickness_m if np.isnan(first_m) else first_m
            thickness_m, planes = equations.thickness_m, equations.cells
            precision = 1.0 / max(equations.sigma_m, 1e-4) ** 2
            others, pull = self._prior(state)
            for information, gradient in self._grounds(points, jacobians):
                others[:ESTIMATED, :ESTIMATED] += information
                pull[:ESTIMATED] += gradient
            inverse = np.linalg.inv(precision * equations.information + others)
            covariance = inverse @ (precision**2 * equations.scatter + others) @ inverse
            step = -inverse @ (precision * equations.gradient + pull)
            state = state + step
            if problems := self._of(state).validate():
                return MountEstimate(start, first_m, np.nan, 0, f"the sweeps fit no mount that can be: {problems[0]}")
            if np.abs(step).max() < SETTLED:
                break
        return MountEstimate(self._calibration(state, covariance), first_m, thickness_m, planes)

    def _of(self, state: FloatArray) -> TiltCalibration:
        return TiltCalibration.of_values([*state[:ESTIMATED], self._geometry.calibration.mount_pitch_rad])

    def _points(self, state: FloatArray) -> tuple[list[FloatArray], list[FloatArray]]:
        """Hits of each place in base_link, and their derivatives by the mount's parameters."""
        mount = TiltGeometry(self._geometry.T_base_mount, self._geometry.T_tilt_laser, self._of(state))
        pairs = [points_and_jacobian(beams, mount) for beams in self._beams]
        return [points for points, _ in pairs], [jacobian for _, jacobian in pairs]

    def _in_map(self, state: FloatArray, points: list[FloatArray], jacobians: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
        """All hits in the map, and their derivatives by the whole state."""
        moved, by = [], []
        for k, (base, jacobian) in enumerate(zip(points, jacobians, strict=True)):
            pose = self._pose(state, k)
            full = np.zeros((len(base), 3, self._size))
            full[:, :, :ESTIMATED] = np.einsum("ij,njp->nip", pose[:3, :3], jacobian)
            if k:
                at = 6 * k
                full[:, :, at : at + 3] = pose[:3, :3]
                full[:, :, at + 3 : at + 6] = -pose[:3, :3] @ _cross(base)
            moved.append(base @ pose[:3, :3].T + pose[:3, 3])
            by.append(full)
        return np.concatenate(moved), np.concatenate(by)

    def _pose(self, state: FloatArray, k: int) -> FloatArray:
        if k == 0:
            return self._odometry[0]
        shift = state[6 * k : 6 * k + 6]
        return np.asarray(self._odometry[k] @ transform_from_rpy(shift[:3], (float(shift[3]), float(shift[4]), float(shift[5]))))

    def _prior(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Information and gradient of what is known beforehand: how far off a mount may be, and what the odometry says."""
        config = self._config
        rows = [np.eye(self._size)[i] / sigma for i, sigma in enumerate((*WEAK_SIGMAS, *(2 * (max(config.attitude_bias_rad, 1e-9),))))]
        wanted = [0.0, 1.0 / WEAK_SIGMAS[1], 0.0, 0.0, 0.0, 0.0]
        for k in range(1, len(self._odometry)):
            turned = self._odometry[k][:3, :3].T @ self._odometry[0][:3, :3] - np.eye(3)
            sigmas = [config.position_sigma_m] * 3 + [config.attitude_sigma_rad] * 2 + [config.yaw_sigma_rad]
            for i, sigma in enumerate(sigmas):
                row = np.zeros(self._size)
                row[6 * k + i] = 1.0
                if i in (3, 4):
                    row[BIAS] = -turned[i - 3, :2]
                rows.append(row / sigma)
                wanted.append(0.0)
        A = np.array(rows)
        return A.T @ A, A.T @ (A @ state - np.array(wanted))

    def _grounds(self, points: list[FloatArray], jacobians: list[FloatArray]) -> list[tuple[FloatArray, FloatArray]]:
        """What the ground says at the places where the robot stands level: elsewhere a wheel may stand on a stone."""
        found = (
            ground_equations(base, jacobian, self._geometry.T_base_mount[:2, 3], self._robot)
            for base, jacobian, pose in zip(points, jacobians, self._odometry, strict=True)
            if tilt_angle(pose) <= self._config.level_rad
        )
        return [equations for equations in found if equations is not None]

    def _calibration(self, state: FloatArray, covariance: FloatArray) -> TiltCalibration:
        """What is known well enough; of the rest the value stays where it was, and its variance is inf."""
        start = self._geometry.calibration
        limits = np.full(ESTIMATED, _USABLE_SIGMA_RAD)
        limits[PARAMETERS.index("scale")] = _USABLE_SIGMA_SCALE
        usable = np.sqrt(np.diag(covariance)[:ESTIMATED]) <= limits
        values = np.where(usable, state[:ESTIMATED], start.values[:ESTIMATED])
        full = np.zeros((len(PARAMETERS), len(PARAMETERS)))
        full[:ESTIMATED, :ESTIMATED] = np.where(np.outer(usable, usable), covariance[:ESTIMATED, :ESTIMATED], 0.0)
        unknown = np.append(~usable, True)
        full[unknown, unknown] = np.inf
        values[2] = max(values[2], 0.0)
        return TiltCalibration.of_values([*values, start.mount_pitch_rad], full)


def _thinned(beams: TiltedBeams, most: int, max_range_m: float) -> TiltedBeams:
    """At most so many near hits whose direction is known, half of them rising where there are so many."""
    near = (beams.directions != 0) & (np.linalg.norm(beams.points_laser, axis=1) <= max_range_m)
    rising, falling = (np.flatnonzero(near & (beams.directions == sign)) for sign in (1, -1))
    few = min(len(rising), len(falling), most // 2)
    return beams.chosen(np.sort(np.concatenate([_every(one, few if len(one) == few else most - few) for one in (rising, falling)])))


def _every(indices: IntArray, most: int) -> IntArray:
    """At most `most` of the indices, evenly."""
    return indices if len(indices) <= most else indices[np.linspace(0, len(indices) - 1, most).astype(np.intp)]


def _kinds(beams: TiltedBeams) -> IntArray:
    """(N,) 0 to 3: falling or rising, in front of the laser or over its back."""
    return (2 * (beams.directions > 0) + (beams.points_laser[:, 0] < 0)).astype(np.intp)


def _cross(vectors: FloatArray) -> FloatArray:
    """(N, 3, 3) matrices of the cross product with (N, 3) vectors."""
    out = np.zeros((len(vectors), 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -vectors[:, 2], vectors[:, 1], -vectors[:, 0]
    return out - out.transpose(0, 2, 1)
