"""What a world is made of before its start is known; made by `worlds` from a name, and by `file_worlds` from a file."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.solids import Solid
from pybullet_simulation.start_pose import AskedStart
from robot_body import RobotBody
from world_files import OPEN, HeightField, Mesh, Surface

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Parts:
    """What a world is made of before its start is known.

    `start_area` (2, 2), low and high x, y, is where a start may be chosen; `ground_z` the range of heights in which the start's
    ground lies, if known; `origin` where its own origin lies, in the coordinates of its file; `notes` what there is to say of it.
    """

    solids: list[Solid]
    start_area: Array
    surfaces: list[Surface] = field(default_factory=list)
    heightfield: HeightField | None = None
    ground_z: tuple[float, float] | None = None
    origin: Array = field(default_factory=lambda: np.zeros(3))
    notes: tuple[str, ...] = ()

    def solid_of_triangles(self) -> NDArray[np.int32]:
        """(T,) the number of the solid of every triangle of the joined parts, OPEN for those of surfaces; a mesh knows its own."""
        of_solids = [np.full(len(solid.triangles), k) for k, solid in enumerate(self.solids)]
        of_surfaces = [
            s.solid + (s.solid != OPEN) * len(self.solids) if isinstance(s, Mesh) else np.full(len(s.triangles), OPEN)
            for s in self.surfaces
        ]
        return np.concatenate([*of_solids, *of_surfaces]).astype(np.int32)


@dataclass(frozen=True)
class Request:
    """What a start, and the area around it, are chosen by."""

    area_xy: tuple[float, float] | None
    start: AskedStart | None
    rng: np.random.Generator
    robot: RobotBody
