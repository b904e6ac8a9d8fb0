"""Worlds from files: a mesh, a height map, or an SDF file with its models; and the floor under what has none."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.mesh_guess import fits_as_it_is, part_problem, question, size_problem, size_text
from pybullet_simulation.solids import Solid, box, walls_around
from pybullet_simulation.start_pose import AskedStart, StandingTest, check_start, choose_start
from pybullet_simulation.world import joined
from pybullet_simulation.world_parts import Parts, Request
from world_files import (
    DESCRIPTION_SUFFIXES,
    MESH_SUFFIXES,
    SDF_SUFFIXES,
    HeightMap,
    Mesh,
    MeshFrame,
    ModelPaths,
    Surface,
    WorldDescription,
    cut_to,
    near_origin,
    read_height_map,
    read_mesh,
    read_sdf,
    surface_from_heights,
    terrain_between,
)

Array = NDArray[np.float64]

FILE_SUFFIXES = (*MESH_SUFFIXES, *SDF_SUFFIXES, ".png", *DESCRIPTION_SUFFIXES)
FILE_WALL_BELOW_M, FILE_WALL_ABOVE_M = 0.5, 1.5
GENTLE_RAD = math.radians(6.0)
SAME_LEVEL_M = 0.01
FLOOR_THICK_M = 0.2
FAR_START_M = 50.0  # from all that stands on a floor: nearly all of what would be explored is bare floor
FLOOR_BEYOND_M = 2.0  # how far a floor without an end goes on beyond what stands on it: room to drive around all of that


def from_file(about: WorldDescription, by: Request) -> Parts:
    """The parts of the file of a description. ValueError when it cannot be read, or something else was said of it than its kind knows."""
    path = Path(about.world)
    if about.area is not None and not all(math.isfinite(v) and v >= 3.0 for v in about.area):
        raise ValueError(f"area {about.area!r} is not two lengths of 3 m or more")
    if about.ground is not None and not math.isfinite(about.ground):
        raise ValueError(f"ground {about.ground:g} is no height in metres")
    if not path.is_file():
        raise ValueError(f"there is no world file {about.world!r}")
    suffix = path.suffix.lower()
    if about.models and suffix not in SDF_SUFFIXES:
        raise ValueError(f"models are for SDF files ({', '.join(SDF_SUFFIXES)}); {about.world} includes none")
    if suffix == ".png":
        return _from_picture(path, about, by)
    if about.size is not None:
        raise ValueError(f"a size is for height maps (.png); {about.world} has its own")
    return _from_sdf(path, about, by) if suffix in SDF_SUFFIXES else _from_mesh_file(path, about, by)


def mesh_frame(about: WorldDescription) -> MeshFrame | None:
    """How a mesh is to be read; None where nothing is said of that."""
    return None if about.scale is None and about.up is None else MeshFrame(about.scale, about.up)


def start_advice(about: WorldDescription, by: Request) -> str:
    """What follows a sentence that there is no start in a file: a floor, another unit or another axis, where these may be meant."""
    path = Path(about.world)
    if path.suffix.lower() in SDF_SUFFIXES:
        read = read_sdf(path, ModelPaths.of(about.models))
        return "" if read.floors else _floor_advice(about, float(read.vertices[:, 2].min()))
    if path.suffix.lower() not in MESH_SUFFIXES or mesh_frame(about) is not None or fits_as_it_is(path, by.robot):
        return ""
    mesh = read_mesh(path)
    return f"{_floor_advice(about, float(mesh.vertices[:, 2].min()))}. It is {size_text(mesh)} m large{question(path, by.robot)}"


def _floor_advice(about: WorldDescription, lowest_z: float) -> str:
    return f"; --ground {lowest_z:.3g} adds a floor where it has none" if about.ground is None else ""


def _from_picture(path: Path, about: WorldDescription, by: Request) -> Parts:
    if about.size is None:
        raise ValueError(f"the height map {path} needs a size x y z in metres")
    if mesh_frame(about) is not None or about.ground is not None:
        raise ValueError(f"scale, up and ground are for meshes; the height map {path} has a size")
    return _from_height_map(read_height_map(path, about.size), by.area_xy, by.start, by.rng)


def _from_mesh_file(path: Path, about: WorldDescription, by: Request) -> Parts:
    frame = mesh_frame(about)
    mesh = read_mesh(path, frame)
    if problem := size_problem(path, mesh, frame, by.area_xy is not None):
        raise ValueError(f"{problem}{question(path, by.robot)}")
    parts = _from_mesh(mesh, by) if about.ground is None else _on_floors(mesh, (about.ground,), by)
    left_out = (f"{path}: {', '.join(mesh.missing)} cannot be read: left out",) if mesh.missing else ()
    return replace(parts, notes=(*left_out, *parts.notes))


def _from_sdf(path: Path, about: WorldDescription, by: Request) -> Parts:
    if mesh_frame(about) is not None:
        raise ValueError(f"scale and up are for meshes; those of {path} have a <scale> and a <pose>")
    read = read_sdf(path, ModelPaths.of(about.models))
    floors = read.floors if about.ground is None else (*read.floors, about.ground)
    mesh = near_origin(read.vertices, read.triangles, read.solid) if len(read.triangles) else None
    if read.largest_mesh is not None and (problem := part_problem(*read.largest_mesh, by.area_xy is not None)):
        raise ValueError(problem)
    parts = _on_floors(mesh, floors, by) if floors or mesh is None else _from_mesh(mesh, by)
    return replace(parts, notes=(*read.left_out, *parts.notes))


def _on_floors(mesh: Mesh | None, heights: tuple[float, ...], by: Request) -> Parts:
    """A mesh, if there is one, on floors that have no end: these end, at walls, beyond what stands on them, or with the area."""
    low, high = _bounds_of_floors(mesh, by)
    whole = _with_floors(mesh, heights, low, high)
    if by.area_xy is not None:
        return _from_mesh(whole, by)
    x, y = high - low
    note = f"the floor ends at walls, {FLOOR_BEYOND_M:g} m beyond what stands on it: {x:.0f} x {y:.0f} m; --area X Y takes another part"
    return Parts(_walls(low, high, whole), np.array([low, high]), [whole], origin=whole.origin, notes=(note,))


def _bounds_of_floors(mesh: Mesh | None, by: Request) -> tuple[Array, Array]:
    """Around what stands on them and the start; of a plane only so far that the area fits around whatever start is chosen."""
    area = np.array(by.area_xy or (2 * FLOOR_BEYOND_M, 2 * FLOOR_BEYOND_M))
    if mesh is None:
        if by.area_xy is None:
            raise ValueError("it is a plane only; --area X Y says how much of it is explored")
        middle = np.zeros(2) if by.start is None else np.array([by.start.x, by.start.y])
        return middle - area, middle + area
    corners = mesh.vertices[:, :2]
    low, high = corners.min(axis=0) - FLOOR_BEYOND_M, corners.max(axis=0) + FLOOR_BEYOND_M
    if by.start is not None:
        asked = by.start.relative_to(mesh.origin)
        if by.area_xy is None:
            _check_nearness(asked, corners)
        low, high = np.minimum(low, (asked.x, asked.y) - area / 2), np.maximum(high, (asked.x, asked.y) + area / 2)
    return low, high


def _check_nearness(start: AskedStart, corners: Array) -> None:
    """ValueError for a start that only an endless floor reaches: more than `FAR_START_M` beyond all (N, 2) that stands on it."""
    beyond = np.maximum(corners.min(axis=0) - (start.x, start.y), (start.x, start.y) - corners.max(axis=0))
    away_m = float(np.linalg.norm(np.maximum(beyond, 0.0)))
    if away_m > FAR_START_M:
        raise ValueError(
            f"the robot cannot start at {start}: all that stands in the file is {away_m:.0f} m away; --area X Y explores the floor there"
        )


def _with_floors(mesh: Mesh | None, heights: tuple[float, ...], low: Array, high: Array) -> Mesh:
    origin = np.zeros(3) if mesh is None else mesh.origin
    slabs = [box("floor", (*low, z - origin[2] - FLOOR_THICK_M), (*high, z - origin[2])) for z in heights]
    solids = [np.full(len(slab.triangles), k, np.int32) for k, slab in enumerate(slabs)]
    if mesh is not None:
        solids.append(np.where(mesh.solid < 0, mesh.solid, mesh.solid + len(slabs)).astype(np.int32))
    vertices, triangles = joined([*slabs, *([] if mesh is None else [mesh])])
    return Mesh(vertices, triangles, np.concatenate(solids), origin)


def _from_mesh(mesh: Mesh, by: Request) -> Parts:
    """The mesh, or the area of it around a start that is found on the whole: what is cut is closed no more."""
    bounds = mesh.bounds_xy
    if by.area_xy is None:
        return Parts([], bounds, [mesh], origin=mesh.origin)
    test = StandingTest(mesh.vertices, mesh.triangles, by.robot, mesh.solid)
    if by.start is None:
        start, start_z = choose_start(test, bounds, by.rng)
    else:
        asked = by.start.relative_to(mesh.origin)
        start, start_z = (asked.x, asked.y, asked.yaw), check_start(test, asked)
    around, level = np.array([start[:2], start[:2]]), (start_z - SAME_LEVEL_M, start_z + SAME_LEVEL_M)
    low, high = _area_around(start, by.area_xy)
    low, high = np.maximum(low, bounds[0]), np.minimum(high, bounds[1])
    cut = cut_to(mesh, low, high)
    return Parts(_walls(low, high, cut), around, [cut], ground_z=level, origin=mesh.origin)


def _from_height_map(
    height_map: HeightMap, area_xy: tuple[float, float] | None, start: AskedStart | None, rng: np.random.Generator
) -> Parts:
    half = np.array(height_map.size_xy) / 2
    if area_xy is None:
        terrain = terrain_between(height_map, -half, half)
        return Parts([], np.array([-half, half]), [surface_from_heights(terrain)], terrain)
    centre = (start.x, start.y) if start is not None else _gentle_spot(height_map, area_xy, rng)
    low, high = _area_around(centre, area_xy)
    terrain = terrain_between(height_map, low, high)
    low = np.array([terrain.x0, terrain.y0])
    high = low + (np.array(terrain.heights.shape[::-1]) - 1) * terrain.step
    surface = surface_from_heights(terrain)
    middle, reach = (low + high) / 2, (high - low) / 4
    return Parts(_walls(low, high, surface), np.array([middle - reach, middle + reach]), [surface], terrain)


def _gentle_spot(height_map: HeightMap, area_xy: tuple[float, float], rng: np.random.Generator) -> tuple[float, float]:
    """A pixel of little slope, as far inside the map as the area reaches where that is possible."""
    rows, columns = np.nonzero(height_map.slopes() < GENTLE_RAD)
    if rows.size == 0:
        raise ValueError(f"the height map has no ground of less than {math.degrees(GENTLE_RAD):.0f} deg slope to start on; give a start")
    xy = np.array([height_map.pixel_xy(r, c) for r, c in zip(rows.tolist(), columns.tolist(), strict=True)])
    inside = (np.abs(xy) <= np.array(height_map.size_xy) / 2 - np.array(area_xy) / 2).all(axis=1)
    candidates = xy[inside] if inside.any() else xy
    x, y = candidates[int(rng.integers(len(candidates)))].tolist()
    return x, y


def _area_around(centre: tuple[float, ...], area_xy: tuple[float, float]) -> tuple[Array, Array]:
    middle, half = np.array(centre[:2]), np.array(area_xy) / 2
    return middle - half, middle + half


def _walls(low: Array, high: Array, surface: Surface) -> list[Solid]:
    z = surface.vertices[:, 2]
    return walls_around(low, high, float(z.min()) - FILE_WALL_BELOW_M, float(z.max()) + FILE_WALL_ABOVE_M)
