"""The files of ./classify_map: classes as PLY, path as CSV, numbers as JSON. All or nothing of each, and nothing of an earlier map."""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from octomap_server_3dnav.exploration.frontiers import Frontier
from octomap_server_3dnav.navigation.class_colours import CLASS_RGB
from octomap_server_3dnav.navigation.planner import Path as GroundPath
from octomap_server_3dnav.terrain.classify import Terrain, TerrainClass
from robot_body import robot_mapping
from stage_config import to_mapping
from terrain_tools.analysis import Analysis
from terrain_tools.criteria import Criteria
from whole_files import write_all

CLASSES, PATH, NUMBERS, PICTURE = "terrain.ply", "path.csv", "terrain.json", "terrain.png"
FILES = (CLASSES, PATH, NUMBERS, PICTURE)


def write_results(folder: Path, content: Mapping[str, bytes]) -> None:
    """Writes files of FILES by name, all or none, and takes an earlier map's others out of the folder, which is made where it is not there.

    OSError when that cannot be done; an earlier map is then as it was.
    """
    made = [place for place in (folder, *folder.parents) if not place.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_all({folder / name: data for name, data in content.items()})
    except BaseException:
        with contextlib.suppress(OSError):
            for place in made:
                place.rmdir()
        raise
    for name in set(FILES) - content.keys():
        (folder / name).unlink(missing_ok=True)


def ply_bytes(terrain: Terrain, origin: Sequence[float] = (0.0, 0.0, 0.0)) -> bytes:
    """The centres of the classified voxels as a binary PLY: x y z in metres, red green blue as in rviz, label as in its comments.

    origin: what they are relative to, in metres, as a comment.
    """
    kinds = {"x": ("<f4", "float"), "y": ("<f4", "float"), "z": ("<f4", "float")}
    kinds |= dict.fromkeys(("red", "green", "blue", "label"), ("u1", "uchar"))
    rows = np.empty(terrain.label.size, dtype=[(name, kind) for name, (kind, _) in kinds.items()])
    rows["x"], rows["y"], rows["z"] = terrain.centers().T
    colours = np.zeros((max(TerrainClass) + 1, 3), dtype=np.uint8)
    for terrain_class, rgb in CLASS_RGB.items():
        colours[terrain_class] = np.round(255 * np.array(rgb))
    rows["red"], rows["green"], rows["blue"] = colours[terrain.label].T
    rows["label"] = terrain.label
    header = ["ply", "format binary_little_endian 1.0", *(f"comment label {int(c)} {c.name.lower()}" for c in TerrainClass)]
    header += [
        "comment origin_m " + " ".join(f"{v:.0f}" for v in origin),
        f"comment voxels of {terrain.resolution:g} m",
        f"element vertex {len(rows)}",
    ]
    header += [f"property {kind} {name}" for name, (_, kind) in kinds.items()] + ["end_header\n"]
    return "\n".join(header).encode("ascii") + rows.tobytes()


def csv_bytes(path: GroundPath) -> bytes:
    """The points of a path in map and how far along it they lie, seen in space."""
    steps = np.linalg.norm(np.diff(path.points, axis=0), axis=1)
    rows = np.column_stack([path.points, np.r_[0.0, np.cumsum(steps)]])
    lines = ["x_m,y_m,z_m,distance_m", *(",".join(f"{v:.4f}" for v in row) for row in rows)]
    return ("\n".join(lines) + "\n").encode("ascii")


def json_bytes(content: dict[str, object]) -> bytes:
    """The numbers; ValueError where one of them is none."""
    return (json.dumps(content, indent=1, allow_nan=False) + "\n").encode("utf-8")


def numbers(found: Analysis, by: Criteria) -> dict[str, object]:
    """What is written of an analysis; None is what there is not."""
    problem = found.problem
    return {
        "resolution_m": found.octree.resolution,
        "leaves": found.octree.leaf_count,
        "columns": [found.runs.nx, found.runs.ny],
        "problem": None if problem is None else {"what": problem.what, "reason": problem.reason},
        "nearest_ground_m": _rounded(problem.nearest.xyz) if problem and problem.nearest else None,
        "nearest_ground_distance_m": round(problem.nearest.distance_m, 3) if problem and problem.nearest else None,
        "terrain": None if found.terrain is None else _terrain_numbers(found.terrain),
        "frontiers": None if found.terrain is None else [_frontier(f) for f in found.frontiers],
        "goal_voxel_m": None if found.terrain is None else _center(found.terrain, found.goal),
        "path": None if found.path is None else _path_numbers(found.path),
        "time_s": found.time_s,
        "config": {
            "robot": robot_mapping(by.robot),
            "sensor_model": to_mapping(by.sensor_model),
            "terrain": to_mapping(by.terrain),
            "passages": to_mapping(by.passages),
            "frontier": to_mapping(by.frontier),
            "planner": to_mapping(by.planner),
        },
    }


def _terrain_numbers(terrain: Terrain) -> dict[str, object]:
    return {
        "start_voxel_m": _center(terrain, terrain.start),
        "departure_voxel_m": _center(terrain, terrain.departure),
        "classes": {c.name.lower(): _class_numbers(terrain, c) for c in TerrainClass},
        "ground_m2": round(terrain.ground_area_m2, 3),
        "reachable_m2": round(terrain.traversable_area_m2, 3),
    }


def _class_numbers(terrain: Terrain, terrain_class: TerrainClass) -> dict[str, float]:
    voxels = int(np.count_nonzero(terrain.label == terrain_class))
    return {"voxels": voxels, "area_m2": round(voxels * terrain.resolution**2, 3)}


def _frontier(frontier: Frontier) -> dict[str, object]:
    distance = frontier.distance_m
    return {
        "xyz_m": _rounded(frontier.xyz),
        "voxels": len(frontier.voxels),
        "distance_m": round(distance, 3) if math.isfinite(distance) else None,
        "gain_m2": round(frontier.gain_m2, 2),
        "potential_cliff": frontier.potential_cliff,
    }


def _path_numbers(path: GroundPath) -> dict[str, object]:
    rise = np.diff(path.points[:, 2])
    return {
        "points": len(path.points),
        "length_m": round(path.length_m, 3),
        "climb_m": round(float(rise[rise > 0].sum()), 3),
        "descent_m": round(float(-rise[rise < 0].sum()), 3),
    }


def _center(terrain: Terrain, node: int | None) -> list[float] | None:
    return None if node is None else _rounded(tuple(terrain.centers(np.array([node]))[0].tolist()))


def _rounded(xyz: tuple[float, ...]) -> list[float]:
    return [round(v, 3) for v in xyz]
