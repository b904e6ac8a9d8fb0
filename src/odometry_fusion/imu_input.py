"""From an IMU in any mounting to samples in base_link; one that cannot be right is refused, with the reason."""

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sensor_checks import ImuLimits, gravity_fault, turning_fault

FloatArray = NDArray[np.float64]
_MOST_HELD = 4000  # samples of the time that is judged


@dataclass(frozen=True, eq=False)
class ImuSample:
    """Angular velocity (3,) rad/s and specific force (3,) m/s^2 in base_link."""

    stamp_s: float
    gyro: FloatArray
    accel: FloatArray


@dataclass(eq=False)
class _Imu:
    """What is known of the IMU of one frame: its mounting, and the samples that are held until gravity speaks for it.

    `last` is its newest sample, and `turned_rad` how far the wheels had turned the robot when another came last.
    """

    R_base_imu: FloatArray
    held: deque[ImuSample] = field(default_factory=lambda: deque(maxlen=_MOST_HELD))
    trusted: bool = False
    last: bytes = b""
    turned_rad: float = 0.0


class ImuInput:
    """Takes raw samples and hands out those of an IMU that gravity and wheels speak for."""

    def __init__(self, limits: ImuLimits, rotation_of: Callable[[str], FloatArray]) -> None:
        """`rotation_of(frame)`: the (3, 3) rotation R_base_imu of a frame, or ValueError."""
        self._limits, self._rotation_of = limits, rotation_of
        self._imus: dict[str, _Imu] = {}
        self._turning = _Turning(limits.turned_rad)

    def add(self, stamp_s: float, frame: str, gyro: Sequence[float], accel: Sequence[float]) -> list[ImuSample]:
        """The samples that may be used now, oldest first: this one, none, or with it those that were held.

        `gyro` and `accel` in rad/s and m/s^2, in `frame`. ValueError, one line with advice: an unknown frame, units or mounting that
        contradict gravity for as long as they are judged, rates that contradict the wheels, or a sample that stays the same while these
        turn the robot. Numbers that are not finite go through.
        """
        imu = self._imu(frame.lstrip("/"))
        rows = np.array([gyro, accel], dtype=np.float64)
        if not (math.isfinite(stamp_s) and np.isfinite(rows).all()):
            return [ImuSample(stamp_s, *rows)]
        sample = ImuSample(stamp_s, *rows @ imu.R_base_imu.T)
        self._turning.add_imu(stamp_s, float(sample.gyro[2]))
        if fault := self._turning.fault() or self._frozen(imu, rows.tobytes()):
            raise ValueError(fault)
        return [sample] if imu.trusted else self._judged(imu, sample, frame)

    def add_wheels(self, stamp_s: float, yaw_rate: float) -> None:
        """Takes the wheels' yaw rate in rad/s, by which the unit of the IMU's rates is judged."""
        self._turning.add_wheels(stamp_s, yaw_rate)

    def _frozen(self, imu: _Imu, sample: bytes) -> str | None:
        """What it says against the IMU that it sends the very sample that it sent before; None where the robot has hardly turned since."""
        if sample != imu.last:
            imu.last, imu.turned_rad = sample, self._turning.all_rad
        if self._turning.all_rad - imu.turned_rad < self._limits.frozen_rad:
            return None
        turned = f"while the wheels turned by {self._limits.frozen_rad:g} rad"
        return f"the IMU sends the same sample again and again {turned}: its driver reads it no more; see its cable, and start it again"

    def _imu(self, frame: str) -> _Imu:
        if frame not in self._imus:
            self._imus[frame] = _Imu(self._rotation_of(frame))
        return self._imus[frame]

    def _judged(self, imu: _Imu, sample: ImuSample, frame: str) -> list[ImuSample]:
        """All that is held, once its mean is gravity; ValueError when it is not after the time of judgement."""
        if imu.held and sample.stamp_s < imu.held[0].stamp_s - self._limits.judged_s:
            imu.held.clear()  # time jumped back
        imu.held.append(sample)
        fault = gravity_fault(np.mean([s.accel for s in imu.held], axis=0), frame, self._limits)
        if fault is None:
            found, imu.trusted = list(imu.held), True
            imu.held.clear()
            return found
        if sample.stamp_s - imu.held[0].stamp_s < self._limits.judged_s:
            return []
        while sample.stamp_s - imu.held[0].stamp_s > self._limits.judged_s:
            imu.held.popleft()
        raise ValueError(fault)


_LONGEST_S = 0.5  # so long the wheels turn as they said last
_TURNS_RPS = 0.1  # slower, wheels that slip and noise say as much as the turn


class _Turning:
    """How many times as fast as the wheels the IMU turns, by least squares over the latest turns of the wheels."""

    def __init__(self, turned_rad: float) -> None:
        self._turned_rad = turned_rad
        self._wheel_rate = 0.0
        self._wheel_stamp_s = self._imu_stamp_s = -math.inf
        self._turned = self._together = self._squared = 0.0
        self._fault: str | None = None
        self.all_rad = 0.0
        """How far the wheels have turned the robot, to either side."""

    def add_wheels(self, stamp_s: float, yaw_rate: float) -> None:
        if math.isfinite(stamp_s) and math.isfinite(yaw_rate):
            if 0.0 < stamp_s - self._wheel_stamp_s < _LONGEST_S:
                self.all_rad += abs(yaw_rate) * (stamp_s - self._wheel_stamp_s)
            self._wheel_stamp_s, self._wheel_rate = stamp_s, yaw_rate

    def add_imu(self, stamp_s: float, yaw_rate: float) -> None:
        duration_s, self._imu_stamp_s = stamp_s - self._imu_stamp_s, stamp_s
        turns = abs(self._wheel_rate) >= _TURNS_RPS
        if not (turns and 0.0 < duration_s < 0.2 and abs(stamp_s - self._wheel_stamp_s) < _LONGEST_S):
            return
        self._turned += abs(self._wheel_rate) * duration_s
        self._together += self._wheel_rate * yaw_rate * duration_s
        self._squared += self._wheel_rate**2 * duration_s
        if self._turned >= self._turned_rad:
            self._fault = turning_fault(self._together / self._squared)
            self._turned = self._together = self._squared = 0.0

    def fault(self) -> str | None:
        """What the latest turn said against the IMU: it holds until a turn says otherwise."""
        return self._fault
