"""A mover on foot or wheels: goes from place to place, stops before whoever is in its way, and then goes another way.

It never moves nearer to the robot than it keeps: what touches a robot that stands is not its fault. All but the mean one heed where the
robot will be, as people do. The mean one goes as near as its body allows.
"""

import math
from collections.abc import Iterator
from itertools import chain, cycle

import numpy as np
from numpy.typing import NDArray

from simulated_movers.ground import OpenGround, RobotSeen, gap_between
from simulated_movers.shapes import LEG_SWING_RAD, RADIUS_M, STRIDE_M
from simulated_movers.specification import MoverSpec

Array = NDArray[np.float64]

KEPT_FROM_ROBOT_M, HEEDED_S = 0.3, 1.0  # how near people pass a robot, and how far they foresee its way
KEPT_FROM_OTHERS_M = 0.1
PATIENCE_S = 1.5  # after which a mover that is in no hurry tries another way
TURN_RATE_RPS = 4.0
FARTHEST_GOAL_M = 6.0
STEPS_IN_AHEAD_M, STEPS_IN_FROM_M = 1.0, 2.5  # of the mean one: where it stands, and from how far it comes
STEPS_IN_KEPT_M = 0.05
IN_THE_WAY_M = 0.1  # that near to the middle of the robot's way it has stepped in
STEPS_IN_REST_S = 10.0
DRIVING_MPS = 0.15  # a robot that is slower is not stepped before


class Walker:
    """A person, cart or robot. `place` (4,) is x, y, ground and yaw, `leg_rad` how far its legs swing."""

    def __init__(self, spec: MoverSpec, start: Array, ground: OpenGround, rng: np.random.Generator) -> None:
        self._spec, self._ground, self._rng = spec, ground, rng
        self.radius_m = RADIUS_M[spec.kind]
        away = next((place - start for place in np.array(spec.places) if any(place != start)), None)
        yaw = rng.uniform(-math.pi, math.pi) if away is None else math.atan2(away[1], away[0])
        self.place = np.array([*start, ground.height_at(start), yaw])
        self.leg_rad = 0.0
        self._walked_m = 0.0
        self._there_and_back: Iterator[Array] = _there_and_back(spec)
        self._goal: Array | None = None
        self._stands_s = 0.0
        self._steps_in, self._rest_s = False, 0.0

    @property
    def discs(self) -> Array:
        """(1, 3) what it covers: x, y, radius."""
        return np.array([[*self.place[:2], self.radius_m]])

    def step(self, dt_s: float, robot: RobotSeen, others: Array) -> None:
        """Goes on by `dt_s`; `others` (M, 3) are the discs that the rest cover."""
        self._look_for_chance(dt_s, robot, others)
        before = self.place[:2].copy()
        if self._stands_s > 0.0 and not self._steps_in:
            self._stands_s -= dt_s
        elif self._goal is None:
            self._goal = self._next_goal(robot, others)
        else:
            self._approach(self._goal, dt_s, robot, others)
        self._swing_legs(float(np.linalg.norm(self.place[:2] - before)), dt_s)

    def _look_for_chance(self, dt_s: float, robot: RobotSeen, others: Array) -> None:
        """The mean one goes for a place before a robot that drives, as long as it drives on."""
        if self._spec.walk != "steps_in":
            return
        self._rest_s -= dt_s
        target = robot.ahead(STEPS_IN_AHEAD_M)
        far_m = float(np.linalg.norm(target - self.place[:2]))
        chance = self._rest_s <= 0.0 and abs(robot.speed_mps) > DRIVING_MPS and far_m < STEPS_IN_FROM_M
        if chance and not robot.is_before(self.place[:2], IN_THE_WAY_M) and self._ground.is_open(self.place[:2], target, self.radius_m):
            self._steps_in, self._goal = True, target
        elif self._steps_in:
            self._stay()

    def _stay(self) -> None:
        """In the way, where it has come."""
        self._steps_in, self._goal, self._stands_s = False, None, self._spec.pause_s
        self._rest_s = self._spec.pause_s + STEPS_IN_REST_S

    def _approach(self, goal: Array, dt_s: float, robot: RobotSeen, others: Array) -> None:
        to_goal = goal - self.place[:2]
        far = float(np.linalg.norm(to_goal))
        if far < 0.02:
            self._arrive()
            return
        facing = self._turn(math.atan2(to_goal[1], to_goal[0]), dt_s)
        rolls = self._spec.kind != "person" and not facing
        step = to_goal / far * min(self._spec.speed_mps * dt_s, far)
        if not rolls and self._may_go(step, robot, others):
            self.place[:2] += step
            height = self._ground.height_at(self.place[:2])
            self.place[2] = height if math.isfinite(height) else self.place[2]
            self._stands_s = 0.0
        elif not rolls:
            self._wait(dt_s)

    def _arrive(self) -> None:
        if self._steps_in:
            self._stay()
        else:
            self._goal, self._stands_s = None, self._spec.pause_s

    def _wait(self, dt_s: float) -> None:
        """Who only wanders goes elsewhere; who has a path waits for it; the mean one has come as near as it can."""
        self._stands_s -= dt_s
        if self._steps_in:
            self._stay()
        elif -self._stands_s > PATIENCE_S and self._spec.walk != "path":
            self._goal, self._stands_s = None, 0.0

    def _turn(self, wanted: float, dt_s: float) -> bool:
        """Turns towards a heading; whether it faces it."""
        off = math.remainder(wanted - self.place[3], math.tau)
        self.place[3] += math.copysign(min(abs(off), TURN_RATE_RPS * dt_s), off)
        return abs(off) < 0.2

    def _may_go(self, step: Array, robot: RobotSeen, others: Array) -> bool:
        """Whether a step leads into nobody's way; one that leads away from everybody always may be taken."""
        there = self.discs
        there[0, :2] += step
        if not self._ground.clear_at(there[:, :2])[0] >= self.radius_m:
            return False
        kept_m, heeded_s = (STEPS_IN_KEPT_M, 0.0) if self._steps_in else (KEPT_FROM_ROBOT_M, HEEDED_S)
        keeps_off_robot = _keeps_off(robot.gap_m(there, heeded_s), robot.gap_m(self.discs, heeded_s), kept_m)
        return keeps_off_robot and _keeps_off(gap_between(there, others), gap_between(self.discs, others), KEPT_FROM_OTHERS_M)

    def _next_goal(self, robot: RobotSeen, others: Array) -> Array | None:
        """The next of its path, or a place in sight to which the first step may be taken; None when there is none now."""
        if self._spec.walk == "path":
            return next(self._there_and_back)
        here = self.place[:2]
        places = self._ground.places(self.radius_m)
        near = places[np.linalg.norm(places - here, axis=1) <= FARTHEST_GOAL_M]
        for index in self._rng.integers(len(near), size=20) if len(near) else ():
            to_goal = near[index] - here
            far = float(np.linalg.norm(to_goal))
            first = to_goal / max(far, 1e-9) * min(0.1, far)
            if far > 0.5 and self._ground.is_open(here, near[index], self.radius_m) and self._may_go(first, robot, others):
                return np.asarray(near[index])
        return None

    def _swing_legs(self, way_m: float, dt_s: float) -> None:
        self._walked_m += way_m
        strength = min(1.0, way_m / dt_s / 0.8)
        self.leg_rad = LEG_SWING_RAD * strength * math.sin(math.tau * self._walked_m / STRIDE_M)


def _keeps_off(gap_m: float, now_m: float, kept_m: float) -> bool:
    return gap_m >= min(kept_m, now_m)


def _there_and_back(spec: MoverSpec) -> Iterator[Array]:
    places = [np.array(place) for place in spec.places]
    start = [np.array(spec.start)] if spec.start and places else []
    return chain(places, cycle([*places[-2::-1], *start, *places])) if places else iter(())
