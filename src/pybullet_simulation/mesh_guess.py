"""What a mesh may have meant that is large, or in which no robot can stand: another unit, or another axis upwards.

It is asked about, never assumed.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.start_pose import NoStartError, StandingTest, choose_start
from robot_body import RobotBody
from world_files import MESH_SUFFIXES, UPS, Mesh, MeshFrame, Surface, WorldDescription, read_mesh

LARGEST_M, LARGEST_WITH_AREA_M = 1000.0, 5000.0  # of a mesh whose unit nobody gave: more than a robot explores; than an octree holds
_LEAST_M, _TALLEST_M = 2.0, 200.0  # of a mesh that is a place to drive in
_HIGH_M, _LONG_M = 30.0, 200.0  # of places that robots explore, few are higher or longer: the file of one may have another unit
_UNITS = {1.0: "", 0.001: "in millimetres", 0.01: "in centimetres", 0.0254: "in inches", 0.3048: "in feet"}
_TRIES, _SEED = 200, 1


def too_large(size: NDArray[np.float64], has_area: bool) -> bool:
    """Whether the unit of a mesh of a size (3,) can hardly be the metre."""
    return bool(size.max() > (LARGEST_WITH_AREA_M if has_area else LARGEST_M))


def size_problem(path: Path, mesh: Mesh, frame: MeshFrame | None, has_area: bool) -> str | None:
    """Why a mesh is too large for its unit to be the metre, or None; None, too, when its scale was given."""
    if (frame is not None and frame.scale is not None) or not too_large(np.ptp(mesh.vertices, axis=0), has_area):
        return None
    area = "" if has_area else ", and --area X Y explores a part of it"
    return f"the mesh {path} is {size_text(mesh)} m large; --scale 1 says that its unit is the metre{area}"


def unit_hint(about: WorldDescription, surfaces: Sequence[Surface]) -> str:
    """What follows the size of a mesh world that is unusually high or long and whose scale nobody gave: its unit, and other ones."""
    suffix = Path(about.world).suffix.lower()
    if suffix not in MESH_SUFFIXES or about.scale is not None:
        return ""
    x, y, z = np.ptp(np.vstack([surface.vertices for surface in surfaces]), axis=0)
    if z <= _HIGH_M and max(x, y) <= _LONG_M:
        return ""
    taken = "with the unit that the file names" if suffix == ".dae" else "one unit taken as one metre"
    others = ", ".join(f"{scale:g} {unit.replace('in', 'for', 1)}" for scale, unit in sorted(_UNITS.items()) if unit)
    return f", {taken} (--scale tells another: {others})"


def part_problem(size: NDArray[np.float64], name: str, has_area: bool) -> str | None:
    """Why a mesh (3,) in an SDF file is too large for its unit to be the metre, with the scale that it may have meant, or None."""
    if not too_large(size, has_area):
        return None
    scale, unit = next(((scale, unit) for scale, unit in sorted(_UNITS.items()) if size.max() * scale > _LEAST_M), (1.0, ""))
    text = " x ".join(f"{v:,.0f}" for v in size)
    area = "" if too_large(size, True) else ". In metres, --area X Y explores a part of it"
    return f"{name} is {text} m large. Is it {unit}? Then multiply its <scale> by {scale:g}{area}"


def question(path: Path, robot: RobotBody) -> str:
    """The options by which a robot could stand in a mesh, as a question that follows a sentence; what there are where none is found."""
    mesh = read_mesh(path)
    for up in sorted(UPS, key=lambda axis: float(np.ptp(mesh.vertices[:, "xyz".index(axis)]))):  # places are wider than high
        for scale, unit in _UNITS.items():
            if (scale, up) != (1.0, "z") and _can_stand(read_mesh(path, MeshFrame(scale, up)), robot):
                meant = " and ".join(filter(None, (unit, f"with {up} up" if up != "z" else "")))
                options = " ".join(filter(None, (f"--scale {scale:g}" if unit else "", f"--up {up}" if up != "z" else "")))
                return f". Is it {meant}? Then say {options}"
    return "; --scale and --up tell its unit and its upward axis"


def fits_as_it_is(path: Path, robot: RobotBody) -> bool:
    """Whether a robot can stand somewhere in a mesh in metres with z up."""
    return _can_stand(read_mesh(path), robot)


def size_text(mesh: Mesh) -> str:
    return " x ".join(f"{v:,.0f}" if v >= 10.0 else f"{v:.2g}" for v in np.ptp(mesh.vertices, axis=0))


def _can_stand(mesh: Mesh, robot: RobotBody) -> bool:
    size = np.ptp(mesh.vertices, axis=0)
    if size[:2].min() < _LEAST_M or size[:2].max() > LARGEST_M or size[2] > _TALLEST_M:
        return False
    bounds = mesh.bounds_xy
    try:
        choose_start(StandingTest(mesh.vertices, mesh.triangles, robot, mesh.solid), bounds, np.random.default_rng(_SEED), tries=_TRIES)
    except NoStartError:
        return False
    return True
