"""All movers of a world: puts them where they start, moves them by a tick, and tells where their parts are."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from simulated_movers.door import Door
from simulated_movers.ground import OpenGround, RobotSeen, gap_between
from simulated_movers.shapes import RADIUS_M, Part, part_poses, parts_of
from simulated_movers.specification import MoverSpec
from simulated_movers.walker import KEPT_FROM_OTHERS_M, Walker

Array = NDArray[np.float64]

STARTS_FROM_ROBOT_M = 1.0  # of those whose start is drawn: room for the robot to begin
_MOVERS = 18  # random stream of a seed, beside those of the simulation


class MoverError(ValueError):
    """A mover that cannot be: `index` in its list, from 0, and `sentence`, which begins with its name."""

    def __init__(self, index: int, sentence: str) -> None:
        super().__init__(f"mover {sentence}")
        self.index, self.sentence = index, sentence


class Crowd:
    """Movers in open ground, each with a random stream of its own."""

    def __init__(self, specs: Sequence[MoverSpec], ground: OpenGround, robot: RobotSeen, seed: int) -> None:
        """MoverError in one line for a mover that cannot be where it starts or goes, or that has another's name."""
        self._specs = tuple(specs)
        self._movers: list[Walker | Door] = []
        for index, spec in enumerate(self._specs):
            rng = np.random.default_rng([seed, _MOVERS, index])
            try:
                self._movers.append(self._placed(spec, ground, robot, rng))
            except ValueError as error:
                raise MoverError(index, f"{spec.name}{error}") from error
            if spec.name and spec.name in self.names[:index]:
                raise MoverError(index, f"{spec.name} has the name of another one")
        self._parts = [parts_of(spec) for spec in self._specs]

    def _placed(self, spec: MoverSpec, ground: OpenGround, robot: RobotSeen, rng: np.random.Generator) -> Walker | Door:
        """A mover where it starts. ValueError with what follows its name when it cannot be there."""
        if spec.kind == "door":
            door = Door(spec, ground, rng)
            if not math.isfinite(door.place[2]):
                raise ValueError(": the door is inside a wall, or nothing open lies under its leaf")
            return door
        radius_m = RADIUS_M[spec.kind]
        given = spec.start or spec.path[:2]
        start = np.array(given) if given else self._drawn_start(spec, ground, robot, rng)
        if problem := self._problem(start, radius_m, ground, robot):
            raise ValueError(f" cannot start at x {start[0]:g} y {start[1]:g}: {problem}")
        for begin, end in zip([start, *spec.places], spec.places, strict=False):
            if not ground.is_open(np.asarray(begin), np.array(end), radius_m):
                raise ValueError(f" cannot go from {_text(begin)} to {_text(end)}: a wall or obstacle is in its way")
        return Walker(spec, start, ground, rng)

    def _problem(self, start: Array, radius_m: float, ground: OpenGround, robot: RobotSeen) -> str | None:
        """Why something round cannot stand at a start."""
        disc = np.array([[*start, radius_m]])
        if ground.clear_at(start[None])[0] < radius_m:
            return "it is inside or too near to a wall or obstacle, or not on the ground that the robot's start leads to"
        if robot.gap_m(disc, 0.0) < 0.0:
            return "the robot starts there"
        if gap_between(disc, self.discs()) < KEPT_FROM_OTHERS_M:
            return "another mover starts there"
        return None

    def _drawn_start(self, spec: MoverSpec, ground: OpenGround, robot: RobotSeen, rng: np.random.Generator) -> Array:
        places = ground.places(RADIUS_M[spec.kind])
        far = np.array([robot.gap_m(np.array([[x, y, 0.0]]), 0.0) for x, y in places.tolist()]) >= STARTS_FROM_ROBOT_M
        for index in rng.permutation(np.flatnonzero(far)):
            if self._problem(places[index], RADIUS_M[spec.kind], ground, robot) is None:
                return np.asarray(places[index])
        raise ValueError(": there is no open ground left for it; fewer movers, or a start")

    @property
    def names(self) -> tuple[str, ...]:
        """Of the movers."""
        return tuple(spec.name for spec in self._specs)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Of the movers."""
        return tuple(spec.kind for spec in self._specs)

    @property
    def parts(self) -> tuple[tuple[str, Part], ...]:
        """All parts, each with the name of its mover."""
        return tuple((spec.name, part) for spec, parts in zip(self._specs, self._parts, strict=True) for part in parts)

    def places(self) -> Array:
        """(M, 4) x, y, ground and yaw of the movers now."""
        return np.array([mover.place for mover in self._movers]).reshape(-1, 4)

    def part_poses(self) -> Array:
        """(P, 5) x, y, z, yaw and pitch of the middles of all parts now; a yaw goes on beyond a turn."""
        poses = [part_poses(parts, mover.place, mover.leg_rad) for parts, mover in zip(self._parts, self._movers, strict=True)]
        return np.concatenate(poses) if poses else np.empty((0, 5))

    def discs(self, without: int = -1) -> Array:
        """(K, 3) what all movers but one cover: x, y, radius."""
        found = [mover.discs for number, mover in enumerate(self._movers) if number != without]
        return np.concatenate(found) if found else np.empty((0, 3))

    def step(self, dt_s: float, robot: RobotSeen) -> None:
        """Goes on by `dt_s`, one after the other."""
        for number, mover in enumerate(self._movers):
            mover.step(dt_s, robot, self.discs(without=number))


def _text(place: Sequence[float] | Array) -> str:
    return f"x {place[0]:g} y {place[1]:g}"
