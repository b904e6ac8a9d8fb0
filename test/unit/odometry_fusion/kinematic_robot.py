"""A robot that follows a list of motions exactly, and the IMU and wheels that watch it: the oracle of the odometry's tests."""

from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from odometry_fusion.error_state import exp_rotation

GRAVITY = 9.81
IMU_S = 0.01


@dataclass(frozen=True)
class Motion:
    """For `duration_s`: forward speed, and body rates of yaw and pitch (nose down positive)."""

    duration_s: float
    forward_mps: float = 0.0
    yaw_rate: float = 0.0
    pitch_rate: float = 0.0


@dataclass(frozen=True)
class Errors:
    """What is wrong with the sensors; all zero is perfect."""

    gyro_bias: np.ndarray = field(default_factory=lambda: np.zeros(3))
    gyro_noise: float = 0.0
    accel_bias: np.ndarray = field(default_factory=lambda: np.zeros(3))
    accel_noise: float = 0.0
    forward_slip: float = 0.0
    turning_slip: float = 0.0
    skid_m: float = 0.0

    @staticmethod
    def drawn(rng: np.random.Generator) -> "Errors":
        """Errors of a cheap IMU and a skid-steered robot."""
        return Errors(
            gyro_bias=rng.normal(0.0, 0.0015, 3),
            gyro_noise=0.005,
            accel_bias=rng.normal(0.0, 0.03, 3),
            accel_noise=0.05,
            forward_slip=rng.normal(0.0, 0.02),
            turning_slip=rng.normal(0.10, 0.02),
            skid_m=0.1,
        )


@dataclass(frozen=True)
class Drive:
    """`imu`: (stamp, gyro, accel) at 100 Hz; `wheels`: (stamp, v, w) at 20 Hz; `truth`: T_world_base at every wheel stamp."""

    imu: list
    wheels: list
    truth: dict[float, np.ndarray]
    path_m: float


def smooth(motions: list[Motion]) -> np.ndarray:
    """(N, 3) forward speed, yaw rate and pitch rate a 10 ms step; speed and yaw rate ramped over 0.3 s."""
    rows = np.concatenate([np.tile([m.forward_mps, m.yaw_rate, m.pitch_rate], (round(m.duration_s / IMU_S), 1)) for m in motions])
    window = np.ones(30) / 30
    for column in (0, 1):
        rows[:, column] = np.convolve(rows[:, column], window)[: len(rows)]
    return rows


def skid(errors: Errors, yaw_rates: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(N, 3) velocity of skidding in m/s, forward and sideways: `skid_m` for every rad/s of turning, lasting about a second."""
    keep = np.exp(-IMU_S / 1.0)
    kicks = rng.normal(0.0, errors.skid_m * np.sqrt(1.0 - keep**2), (len(yaw_rates), 2))
    walk = lfilter([1.0], [1.0, -keep], kicks, axis=0)
    return np.column_stack([np.abs(yaw_rates)[:, None] * walk, np.zeros(len(yaw_rates))])


def simulate(motions: list[Motion], errors: Errors, rng: np.random.Generator, R_start=None, begin_s: float = 1.0) -> Drive:
    """Exact motion of base_link from the origin, starting at rest; begins at `begin_s`, the first messages one step later."""
    rows = smooth(motions)
    skidding = skid(errors, rows[:, 1], rng)
    R = np.eye(3) if R_start is None else R_start
    position, velocity = np.zeros(3), np.zeros(3)
    imu, wheels, truth, path = [], [], {}, 0.0
    for i, (speed, yaw_rate, pitch_rate) in enumerate(rows, start=1):
        rate = np.array([0.0, pitch_rate, yaw_rate])
        R_next = R @ exp_rotation(rate * IMU_S)
        velocity_base = np.array([speed, 0.0, 0.0]) + skidding[i - 1]
        position = position + 0.5 * (R + R_next) @ velocity_base * IMU_S
        velocity_next = R_next @ velocity_base
        force = R_next.T @ ((velocity_next - velocity) / IMU_S + np.array([0.0, 0.0, GRAVITY]))
        R, velocity, path = R_next, velocity_next, path + abs(speed) * IMU_S
        stamp = round(begin_s + i * IMU_S, 6)
        gyro = rate + errors.gyro_bias + rng.normal(0.0, 1.0, 3) * errors.gyro_noise
        imu.append((stamp, gyro, force + errors.accel_bias + rng.normal(0.0, 1.0, 3) * errors.accel_noise))
        if i % 5 == 0:
            wheels.append((stamp, speed / (1.0 - errors.forward_slip), yaw_rate / (1.0 - errors.turning_slip)))
            T = np.eye(4)
            T[:3, :3], T[:3, 3] = R, position
            truth[stamp] = T
    return Drive(imu, wheels, truth, path)
