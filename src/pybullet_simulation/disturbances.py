"""What somebody does to the robot bodily, as a script: lifts and carries it, pushes it aside, tilts it, or puts ice under its wheels.

The robot's sensors feel it and nothing tells it. When it was done, and how far the robot came, is for the judge.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import inverse, rotation_from_rpy, translation_distance, yaw_of
from robot_body import RobotBody
from simulated_movers import OpenGround

Array = NDArray[np.float64]

DISTURBANCES_FILE = "disturbances.csv"
KINDS = ("lift", "push", "tilt", "ice")
_LIFT_M, _LIFT_S, _CARRY_MPS, _CARRY_RPS = 0.3, 1.0, 0.7, 1.0
_PUSH_MPS, _PUSH_S = 1.0, 0.3  # on average, and the least that a push takes
_TILT_S, _HELD_S = 0.5, 2.0
_STOPS_S = 0.3  # whoever takes hold of a robot that drives stops it within
_ICE_GRIP = 0.06  # share of the wheels' grip: rubber on ice
_FREE_M = 0.15  # around the outline of a robot that is put down, and beside one that is pushed
_DROP_M = 0.01  # it is let go so high
_DIFFERENCE_S = 1e-4  # of two poses, for a velocity


@dataclass(frozen=True)
class Disturbance:
    """One of `KINDS` at a time in s since the simulator's start; `amount`: metres carried or pushed, degrees of tilt, seconds of ice."""

    kind: str
    begin_s: float
    amount: float


@dataclass(frozen=True)
class Done:
    """A disturbance that is over: stamps, and how far the robot came meanwhile."""

    kind: str
    begin_s: float
    end_s: float
    moved_m: float
    turned_rad: float


@dataclass(frozen=True)
class Guided:
    """Where hands hold the robot at an instant: T_world_base (4, 4) and its velocities in world axes, (3,) each."""

    T_world_base: Array
    linear: Array
    angular: Array


def disturbances_of(text: str) -> tuple[Disturbance, ...]:
    """KIND AT AMOUNT, more after commas, in the order of time. ValueError names the part that cannot be read."""
    found = [_disturbance(part.strip()) for part in text.split(",") if part.strip()]
    return tuple(sorted(found, key=lambda one: one.begin_s))


def _disturbance(text: str) -> Disturbance:
    try:
        kind, begin, amount = text.split()
        found = Disturbance(kind, float(begin), float(amount))
    except ValueError:
        raise ValueError(f"disturbances = {text!r}: expected KIND AT AMOUNT, such as push 40 0.5") from None
    if kind not in KINDS:
        raise ValueError(f"disturbances = {text!r}: no kind {kind!r}; there are {', '.join(KINDS)}")
    if not (0.0 <= found.begin_s < math.inf and 0.0 < found.amount < math.inf):
        raise ValueError(f"disturbances = {text!r}: time and amount are numbers above 0")
    return found


@dataclass(frozen=True)
class _Grasp:
    """A disturbance under way: since when, from where and how fast, and to where the robot comes."""

    what: Disturbance
    begun_s: float
    T_from: Array
    speed_mps: float
    T_to: Array
    robot: RobotBody

    @property
    def _turn_rad(self) -> float:
        return math.remainder(yaw_of(self.T_to) - yaw_of(self.T_from), 2.0 * math.pi)

    @property
    def lasts_s(self) -> float:
        """From its begin to its end."""
        way_m = translation_distance(self.T_from, self.T_to)
        return {
            "ice": self.what.amount,
            "tilt": 2.0 * _TILT_S + _HELD_S,
            "push": max(_PUSH_S, way_m / _PUSH_MPS),
            "lift": 2.0 * _LIFT_S + max(1.0, way_m / _CARRY_MPS, abs(self._turn_rad) / _CARRY_RPS),
        }[self.what.kind]

    def pose(self, at_s: float) -> Array:
        """(4, 4) T_world_base so long after its begin."""
        T = self.T_from.copy()
        if self.what.kind == "push":  # it drives on meanwhile
            T[:3, 3] += self.speed_mps * at_s * T[:3, 0] + _eased(at_s / self.lasts_s) * (self.T_to[:3, 3] - self.T_from[:3, 3])
            return T
        braked_s = min(max(at_s, 0.0), _STOPS_S)
        T[:3, 3] += self.speed_mps * (braked_s - braked_s**2 / (2.0 * _STOPS_S)) * T[:3, 0]
        return self._tilted(T, at_s) if self.what.kind == "tilt" else self._carried(T, at_s)

    def _tilted(self, T: Array, at_s: float) -> Array:
        share = _eased(at_s / _TILT_S) - _eased((at_s - _TILT_S - _HELD_S) / _TILT_S)
        return _rolled(T, math.radians(self.what.amount) * share, self.robot)

    def _carried(self, T: Array, at_s: float) -> Array:
        share = _eased((at_s - _LIFT_S) / (self.lasts_s - 2.0 * _LIFT_S))
        up = _eased(at_s / _LIFT_S) - _eased((at_s - self.lasts_s + _LIFT_S) / _LIFT_S)
        T[:3, 3] += share * (self.T_to[:3, 3] - T[:3, 3]) + np.array([0.0, 0.0, _LIFT_M * up + _DROP_M])
        T[:3, :3] = _about_z(share * self._turn_rad) @ self.T_from[:3, :3]
        return T


class Hands:
    """Does what the script says: `guided` while hands hold the robot, `grip` of its wheels, and `done` for the judge."""

    def __init__(self, script: tuple[Disturbance, ...], ground: OpenGround | None, robot: RobotBody, rng: np.random.Generator) -> None:
        """`ground` where a robot that is lifted or pushed may be put; None where the script needs none."""
        self._waiting, self._ground, self._robot, self._rng = list(script), ground, robot, rng
        self._grasp: _Grasp | None = None
        self.done: list[Done] = []

    @property
    def hold(self) -> bool:
        """Whether hands hold the robot: what it touches then is theirs."""
        return self._grasp is not None and self._grasp.what.kind != "ice"

    @property
    def grip(self) -> float:
        """Of the wheels, as a share of what they have else."""
        return _ICE_GRIP if self._grasp is not None and self._grasp.what.kind == "ice" else 1.0

    def step(self, now_s: float, T_world_base: Array, speed_mps: float) -> None:
        """Begins and ends what is due at `now_s`, seconds since the start, with the robot there."""
        grasp = self._grasp
        if grasp is not None and now_s >= grasp.begun_s + grasp.lasts_s:
            turned = abs(math.remainder(yaw_of(T_world_base) - yaw_of(grasp.T_from), 2.0 * math.pi))
            moved = translation_distance(grasp.T_from, T_world_base)
            self.done.append(Done(grasp.what.kind, grasp.begun_s, now_s, moved, turned))
            self._grasp = None
        if self._grasp is None and self._waiting and now_s >= self._waiting[0].begin_s:
            what = self._waiting.pop(0)
            self._grasp = _Grasp(what, now_s, T_world_base, speed_mps, self._goal(what, T_world_base), self._robot)

    def guided(self, now_s: float) -> Guided | None:
        """Where the hands have the robot, None while they do not hold it."""
        if self._grasp is None or not self.hold:
            return None
        before, here, after = (self._grasp.pose(now_s - self._grasp.begun_s + shift) for shift in (-_DIFFERENCE_S, 0.0, _DIFFERENCE_S))
        R = after[:3, :3] @ before[:3, :3].T
        turned = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
        return Guided(here, (after[:3, 3] - before[:3, 3]) / (2.0 * _DIFFERENCE_S), turned / (2.0 * _DIFFERENCE_S))

    def _goal(self, what: Disturbance, T_from: Array) -> Array:
        """Where a robot that is carried or pushed comes to be."""
        T = T_from.copy()
        if what.kind == "push":
            T[:3, 3] += self._aside(what.amount, T_from)
        elif what.kind == "lift":
            assert self._ground is not None
            room_m = self._robot.turning_radius_m + _FREE_M
            places = self._ground.places(min(room_m, float(self._ground.clear_m.max())))  # or where there is most room
            off = np.abs(np.linalg.norm(places - T_from[:2, 3], axis=1) - what.amount)
            xy = places[self._rng.choice(np.flatnonzero(off <= off.min() + 0.3))]
            T[:3, 3] = *xy, self._ground.height_at(xy) + self._robot.base_height_m
            T[:3, :3] = _about_z(self._rng.uniform(-math.pi, math.pi)) @ T_from[:3, :3]
        return T

    def _aside(self, most_m: float, T_from: Array) -> Array:
        """(3,) to the side with more room, at most as far as there is room."""
        assert self._ground is not None
        ways, best = np.arange(0.0, most_m + 0.01, 0.05), np.zeros(3)
        for across in (T_from[:3, 1], -T_from[:3, 1]):
            has_room = self._ground.clear_at(T_from[:2, 3] + ways[:, None] * across[:2]) >= self._robot.half_width_m + _FREE_M
            far_m = ways[-1] if has_room.all() else ways[max(0, int(np.argmin(has_room)) - 1)]
            best = across * far_m if far_m > np.linalg.norm(best) else best
        return best


def _eased(share: float) -> float:
    """From 0 to 1 without a jerk: the smoothest way from rest to rest (Flash and Hogan 1985)."""
    x = min(max(share, 0.0), 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x * x)


def _about_z(angle: float) -> Array:
    return rotation_from_rpy(0.0, 0.0, angle)


def _rolled(T_world_base: Array, angle: float, robot: RobotBody) -> Array:
    """Rolled to the right about the middle of its right wheels' track on the ground."""
    foot, roll = np.eye(4), np.eye(4)
    foot[:3, 3] = 0.0, -robot.track_m / 2, -robot.base_height_m
    roll[:3, :3] = rotation_from_rpy(angle, 0.0, 0.0)
    lifted = np.eye(4)
    lifted[2, 3] = _DROP_M
    return np.asarray(lifted @ T_world_base @ foot @ roll @ inverse(foot))


def disturbances_csv(done: Sequence[Done]) -> str:
    """What was done to a robot, a line each, as `DISTURBANCES_FILE` has it."""
    rows = [f"{one.kind},{one.begin_s:.3f},{one.end_s:.3f},{one.moved_m:.3f},{one.turned_rad:.3f}" for one in done]
    return "\n".join(["kind,begin,end,moved_m,turned_rad", *rows, ""])
