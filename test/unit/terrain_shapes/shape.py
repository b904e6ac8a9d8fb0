"""What a shape is: a small world, where the robot stands to look at it, and what a right classification says of it.

Expectations are those of the robot, never those of a classifier: what `exploration_evaluation.RobotShape` and the URDF say it can do.
All coordinates are of the shape's own frame, in metres, z up.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import partial

from pybullet_simulation.solids import Solid

Point = tuple[float, float, float]


class Expected(Enum):
    """What is asked of a region, or of a way to a point."""

    TRAVERSABLE = "traversable"  # ground that the robot's middle may reach
    OBSTACLE = "obstacle"  # something to be kept off, all along the box; nothing traversable in it
    CLIFF = "cliff"  # a drop that was seen, all along the box; nothing traversable in it
    NOT_TRAVERSABLE = "not traversable"  # whatever else
    NO_CLIFF = "no cliff"  # ground, or a question, but no drop
    FRONTIER = "frontier"  # worth a look: one that can be chosen
    NO_FRONTIER = "no frontier"  # nothing there is left to look at
    PATH = "path"
    NO_PATH = "no path"


@dataclass(frozen=True)
class Expectation:
    """One of a box between two corners; of a path the corners are its end."""

    kind: Expected
    low: Point
    high: Point

    def __str__(self) -> str:
        corners = [self.low] if self.low == self.high else [self.low, self.high]
        return f"{self.kind.value} {' to '.join('({:g} {:g} {:g})'.format(*corner) for corner in corners)}"


@dataclass(frozen=True)
class Stand:
    """Where the robot stands for a sweep, on the ground nearest to height z."""

    x: float
    y: float
    z: float = 0.0
    yaw_deg: float = 0.0


@dataclass(frozen=True, eq=False)
class Scene:
    """Solids and the sweeps taken among them, in order; `mute` ones give the laser no echo."""

    solids: Sequence[Solid]
    stands: Sequence[Stand]
    mute: Sequence[Solid] = ()


@dataclass(frozen=True, eq=False)
class Shape:
    """A shape by its name; more than one scene where things move. The last stand is where the robot is when all is classified."""

    name: str
    scenes: Sequence[Scene]
    expectations: Sequence[Expectation]


def seen(name: str, solids: Sequence[Solid], stands: Sequence[Stand], *expectations: Expectation, mute: Sequence[Solid] = ()) -> Shape:
    """A shape in which nothing moves."""
    return Shape(name, (Scene(solids, stands, mute),), expectations)


# Of a box between two corners, low and high.
traversable = partial(Expectation, Expected.TRAVERSABLE)
obstacle = partial(Expectation, Expected.OBSTACLE)
cliff = partial(Expectation, Expected.CLIFF)
not_traversable = partial(Expectation, Expected.NOT_TRAVERSABLE)
no_cliff = partial(Expectation, Expected.NO_CLIFF)
frontier = partial(Expectation, Expected.FRONTIER)
no_frontier = partial(Expectation, Expected.NO_FRONTIER)


def path(end: Point) -> Expectation:
    """A way from the last stand, off all that is not to be driven on."""
    return Expectation(Expected.PATH, end, end)


def no_path(end: Point) -> Expectation:
    """No way from the last stand."""
    return Expectation(Expected.NO_PATH, end, end)
