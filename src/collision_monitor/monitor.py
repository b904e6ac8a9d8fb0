"""How much of a command is safe: the outline is moved along it until the robot would stand, and strangers come towards it meanwhile.

nav2's collision_monitor has this as its approach model (time to collision). Here what is not in the map may move, too (as in the
separation distance of ISO 13855): its room grows with time. What the map knows stands still, and is the follower's business.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.config import CollisionMonitorConfig
from robot_body import RobotBody

Array = NDArray[np.float64]

_SHARES = (1.0, 0.7)  # it slows, and then stands: slower it would only creep up to a stranger
_INSTANT_S = 0.05
_OLDEST_S = 2.0  # a look counts as no older: the robot stands long before
_LONGEST_PERIOD_S = 1.0  # between two commands; what is longer is a pause
_NEARER_M = 0.01  # the robot comes nearer by itself


@dataclass(frozen=True)
class Limited:
    """The command that is safe, its share of the one that was wanted, and why, empty for all of it."""

    v: float
    w: float
    share: float
    reason: str


def seen_from(points: ArrayLike, x: float, y: float, yaw: float) -> Array:
    """(N, 2) points in map, m, as they lie in base_link of a robot at `x`, `y` with `yaw` rad."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.asarray((np.asarray(points, dtype=np.float64).reshape(-1, 2) - (x, y)) @ np.array([[c, -s], [s, c]]))


class CollisionMonitor:
    """Limits commands one after the other; the share grows back slowly, so that the robot does not jerk."""

    def __init__(self, config: CollisionMonitorConfig, robot: RobotBody) -> None:
        """ValueError lists what is wrong with `config`."""
        self._robot = robot
        self.configure(config)
        self._half = np.array([robot.half_length_m, robot.half_width_m])
        self._share, self._stamp_s, self._reaction_s = 1.0, -math.inf, config.reaction_s

    def configure(self, config: CollisionMonitorConfig) -> None:
        """From the next command on, no braking stronger than the robot's. ValueError lists what is wrong with `config`."""
        if problems := config.validate():
            raise ValueError("; ".join(problems))
        self._config = replace(
            config,
            deceleration_mps2=min(config.deceleration_mps2, self._robot.max_acceleration_mps2),
            turn_deceleration_radps2=min(config.turn_deceleration_radps2, self._robot.max_turn_acceleration_radps2),
        )

    @property
    def memory_s(self) -> float:
        """For so long what was met is a stranger."""
        return self._config.memory_s

    @property
    def standing_s(self) -> float:
        """What was met at one place for longer is no stranger any more; 0: never so."""
        return self._config.standing_s

    def limited(self, stamp_s: float, v: float, w: float, strangers: ArrayLike, seen_ago_s: float | None = None) -> Limited:
        """As much of `v` m/s and `w` rad/s as is safe beside `strangers` (N, 2) in base_link, m: points that the map does not explain.

        `seen_ago_s`: age of the newest look at them, where it is measured; a greater one than reaction_s takes its place.
        """
        self._reaction_s = self._reaction(stamp_s, seen_ago_s)
        points = np.asarray(strangers, dtype=np.float64).reshape(-1, 2)
        grown = self._share + max(stamp_s - self._stamp_s, 0.0) / self._config.recovery_s
        safe = 1.0 if not len(points) or (v == 0.0 and w == 0.0) else self._safe_share(v, w, points)
        self._share, self._stamp_s = min(safe, grown, 1.0), stamp_s
        if self._share >= 1.0:
            return Limited(v, w, 1.0, "")
        told = "stands before" if self._share == 0.0 else f"goes at {self._share:.0%} before"
        return Limited(self._share * v, self._share * w, self._share, f"{told} what the map does not know")

    def _reaction(self, stamp_s: float, seen_ago_s: float | None) -> float:
        """Seconds from a beam to the brakes: a command holds until the next."""
        if seen_ago_s is None:
            return self._config.reaction_s
        period_s = stamp_s - self._stamp_s
        period_s = period_s if 0.0 <= period_s <= _LONGEST_PERIOD_S else 0.0
        age_s = _OLDEST_S if math.isnan(seen_ago_s) else min(max(seen_ago_s, 0.0), _OLDEST_S)
        return max(self._config.reaction_s, age_s + period_s)

    def _safe_share(self, v: float, w: float, points: Array) -> float:
        return next((share for share in _SHARES if self._is_safe(share * v, share * w, points)), 0.0)

    def _is_safe(self, v: float, w: float, points: Array) -> bool:
        """Whether the robot, told so now, stands before it comes too near to any point that it moves towards."""
        times, travelled = self._until_it_stands(v, w)
        gaps = self._gaps(v * travelled, w * travelled, points)
        kept = self._config.margin_m + self._config.approach_mps * times[:, None]
        return not bool(((gaps < kept) & (gaps < gaps[0] - _NEARER_M)).any())

    def _until_it_stands(self, v: float, w: float) -> tuple[Array, Array]:
        """(K,) instants, and (K,) seconds at full speed that take it as far."""
        c = self._config
        braking = max(abs(v) / c.deceleration_mps2, abs(w) / c.turn_deceleration_radps2)
        lasting = self._reaction_s + braking
        times = np.linspace(0.0, lasting, max(2, math.ceil(lasting / _INSTANT_S) + 1))
        since = np.maximum(times - self._reaction_s, 0.0)
        return times, times - since**2 / (2.0 * max(braking, 1e-9))

    def _gaps(self, way_m: Array, turned: Array, points: Array) -> Array:
        """(K, N) distances of the points from the outline after each part of an arc."""
        chord = way_m * np.sinc(turned / (2.0 * math.pi))
        middle = np.column_stack([chord * np.cos(turned / 2.0), chord * np.sin(turned / 2.0)])
        off = points[None] - middle[:, None]
        c, s = np.cos(turned)[:, None], np.sin(turned)[:, None]
        local = np.stack([c * off[..., 0] + s * off[..., 1], c * off[..., 1] - s * off[..., 0]], axis=-1)
        return np.asarray(np.linalg.norm(np.maximum(np.abs(local) - self._half, 0.0), axis=-1))
