"""A world by name or from a file, with its start: the one place that knows all worlds there are."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.rooms_world import HIGH_XY as ROOMS_HIGH
from pybullet_simulation.rooms_world import LOW_XY as ROOMS_LOW
from pybullet_simulation.rooms_world import rooms_solids
from pybullet_simulation.solids import Solid
from pybullet_simulation.start_pose import StandingTest, check_start, choose_start
from pybullet_simulation.world import HeightField, Surface, World, joined

Array = NDArray[np.float64]
Start = tuple[float, float, float]


@dataclass(frozen=True)
class Parts:
    """What a world is made of, before its start is known; `area` (2, 2) is where the robot may be, `ground_z` how high its start may lie."""

    solids: list[Solid]
    area: Array
    surfaces: list[Surface] = field(default_factory=list)
    heightfield: HeightField | None = None
    ground_z: tuple[float, float] | None = None
    closed: bool = True


def _rooms(rng: np.random.Generator) -> Parts:
    return Parts(rooms_solids(rng), np.array([ROOMS_LOW, ROOMS_HIGH]), ground_z=(-0.1, 0.1))


WORLDS: dict[str, Callable[[np.random.Generator], Parts]] = {"rooms": _rooms}
"""The built-in worlds; each is made from a generator alone."""


def load_world(
    name_or_path: str,
    seed: int,
    size_xyz: tuple[float, float, float] | None = None,
    area_xy: tuple[float, float] | None = None,
    start: Start | None = None,
) -> World:
    """The world of a name (`WORLDS`) or a file, in metres with z up; the seed sets clutter, terrain and start.

    `size_xyz`: size in m over which a height map (.png) is laid, only for those. `area_xy`: bounds a file to so many metres around the
    start, with walls added. `start`: (x, y, yaw) to start from instead of one chosen by the seed. ValueError when the world is unknown,
    unreadable or empty, an argument does not fit it, or the robot cannot stand at the start.
    """
    if seed < 0:
        raise ValueError(f"seed {seed} is negative; expected 0 or more")
    if name_or_path not in WORLDS:
        raise ValueError(f"unknown world {name_or_path!r}: neither one of {', '.join(WORLDS)} nor a file")
    if size_xyz is not None or area_xy is not None:
        raise ValueError(f"size and area are for files; the world {name_or_path} has its own")
    terrain_rng, start_rng = (np.random.default_rng([seed, stream]) for stream in (1, 2))
    return _with_start(name_or_path, WORLDS[name_or_path](terrain_rng), start, start_rng)


def _with_start(name: str, parts: Parts, start: Start | None, rng: np.random.Generator) -> World:
    vertices, triangles = joined([*parts.solids, *parts.surfaces])
    test = StandingTest(vertices, triangles, parts.closed)
    if start is None:
        start, start_z = choose_start(test, parts.area, rng, parts.ground_z)
    else:
        start_z = check_start(test, start, parts.ground_z)
    return World(
        name=name,
        solids=tuple(parts.solids),
        surfaces=tuple(parts.surfaces),
        vertices=vertices,
        triangles=triangles,
        extent=np.array([vertices.min(axis=0), vertices.max(axis=0)]),
        start_xyyaw=start,
        start_z=start_z,
        heightfield=parts.heightfield,
    )
