"""The drive of wheels on two sides: from commands to wheel speeds, from encoders to wheel odometry, and how both sides slip."""

import math

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.config import SimulationConfig
from robot_body import RobotBody

Array = NDArray[np.float64]


class SlipModel:
    """Slip of the left and right wheels as a share of their speed: a constant and a part that changes slowly (first-order Markov)."""

    def __init__(self, config: SimulationConfig, rng: np.random.Generator) -> None:
        """`rng` feeds this slip alone."""
        self._rng, self._sigma = rng, config.slip_sigma
        self._bias = config.slip_bias_sigma * rng.standard_normal(2)
        self._changing = config.slip_sigma * rng.standard_normal(2)
        self._tau_s = config.slip_correlation_s

    def step(self, dt_s: float) -> Array:
        """(2,) slip, left and right, `dt_s` later: encoders turn by 1 + slip times what the ground sees."""
        keep = math.exp(-dt_s / self._tau_s)
        self._changing = keep * self._changing + math.sqrt(1.0 - keep * keep) * self._sigma * self._rng.standard_normal(2)
        return np.asarray(self._bias + self._changing)


class Drive:
    """Limits commands as the robot's controller does, and converts between robot and wheel speeds."""

    def __init__(self, robot: RobotBody) -> None:
        """At rest."""
        self._robot = robot
        self._radius_m, self._track_m = robot.wheel_radius_m, robot.effective_track_m
        self._v, self._w = 0.0, 0.0

    def step(self, v: float, w: float, dt_s: float) -> Array:
        """(2,) wheel speeds in rad/s, left and right, on the way to a command (m/s, rad/s). ValueError when it is not finite."""
        if not (math.isfinite(v) and math.isfinite(w)):
            raise ValueError(f"command v {v!r} m/s, w {w!r} rad/s is not finite")
        self._v = _towards(self._v, _clipped(v, self._robot.max_speed_mps), self._robot.max_acceleration_mps2 * dt_s)
        self._w = _towards(self._w, _clipped(w, self._robot.max_turn_rate_radps), self._robot.max_turn_acceleration_radps2 * dt_s)
        half = self._w * self._track_m / 2.0
        return np.array([self._v - half, self._v + half]) / self._radius_m

    def velocity(self, left_rps: float, right_rps: float) -> tuple[float, float]:
        """(v, w) of the robot from wheel speeds in rad/s."""
        return self._radius_m * (left_rps + right_rps) / 2.0, self._radius_m * (right_rps - left_rps) / self._track_m


def _clipped(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


def _towards(value: float, goal: float, step: float) -> float:
    return value + _clipped(goal - value, step)
