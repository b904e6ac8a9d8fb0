"""What is known of the robot's pose: the pose, and how its error hangs together with that of the surfaces the tracker put down itself."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import rotation_angles, skew
from scan_tracking.config import ScanTrackingConfig

Array = NDArray[np.float64]

POSE, OWN = slice(0, 6), slice(6, 12)


@dataclass(frozen=True, eq=False)
class Estimate:
    """T (4, 4) in the tracked odometry frame, and (12, 12) `joint`: covariance of the error of this pose, then of all own surfaces.

    Both are errors as in `pose_error`: own surfaces are off as a robot at T would be that is off by so much. The robot was right where
    it put them down, as far as they know: their error is a copy of its own then (stochastic cloning, Roumeliotis and Burdick 2002).
    """

    T: Array
    joint: Array

    @classmethod
    def of(cls, T: Array, covariance: Array) -> Estimate:
        """With (6, 6) `covariance` of the pose, and no own surfaces."""
        joint = np.zeros((12, 12))
        joint[POSE, POSE] = joint[OWN, OWN] = covariance
        return cls(T, joint)

    @property
    def covariance(self) -> Array:
        """(6, 6) of the pose."""
        return np.asarray(self.joint[POSE, POSE])

    def moved(self, T: Array, config: ScanTrackingConfig) -> Estimate:
        """After a drive to T by odometry: errors are carried along, and the pose's grows."""
        step, R = T[:3, 3] - self.T[:3, 3], T[:3, :3]
        lever = np.eye(6)
        lever[:3, 3:] = -skew(step)
        carry = np.kron(np.eye(2), lever)
        way, turn = float(np.linalg.norm(step)), float(rotation_angles((self.T[:3, :3].T @ R)[None])[0])
        position = np.array([config.ground_walk, config.ground_walk, config.height_walk]) ** 2 * way
        position[:2] += config.skid_walk**2 * turn
        attitude = np.array([config.tilt_walk, config.tilt_walk, config.yaw_walk]) ** 2 * way
        attitude += np.array([config.tilt_walk, config.tilt_walk, config.gyro_walk]) ** 2 * turn
        joint = carry @ self.joint @ carry.T
        joint[:3, :3] += (R * position) @ R.T
        joint[3:6, 3:6] += (R * attitude) @ R.T
        return Estimate(T, joint)

    def placed(self, match: Array | None) -> Estimate:
        """After a match of (6, 6) covariance put the robot where T is, without own surfaces."""
        P = self.covariance
        fused = P if match is None else P - P @ np.linalg.solve(P + match, P)
        return Estimate.of(self.T, 0.5 * (fused + fused.T))

    def widened(self, sigmas: Array) -> Estimate:
        """With (6,) `sigmas` of an error that nothing is known of."""
        joint = self.joint.copy()
        joint[POSE, POSE] += np.diag(sigmas**2)
        return replace(self, joint=joint)

    def anchored(self, sigmas: Array) -> Estimate:
        """As own surfaces are put down here, each with an error of (6,) `sigmas` of its own."""
        joint = np.tile(self.covariance, (2, 2))
        joint[OWN, OWN] += np.diag(sigmas**2)
        return replace(self, joint=joint)
