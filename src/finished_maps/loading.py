"""From a path to a map: an octree of a file, or the sweeps of a run's folder where its graph has them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from octomap_server_3dnav.octree.map_builder import Beams, MapBuilder
from octomap_server_3dnav.octree.octree import OctreeMap
from pose_graph_mapping.graph.pose_graph import PoseGraph
from pose_graph_mapping.session.session_store import DamagedSweepError, SessionStore
from rigid_geometry.transforms import Transform

SWEEPS, _OCTREE, _GRAPH = "sweeps/index.json", "map.ot", "graph.g2o"
_NO_BEAMS = np.zeros((0, 3), np.float32)


@dataclass(frozen=True, eq=False)
class LoadedMap:
    """A map that clouds may be added to; where the robot stood last, None where that is not told; and in words what it is of."""

    builder: MapBuilder
    T_map_base: Transform | None
    described: str


def load_map(path: Path, like: MapBuilder) -> LoadedMap:
    """The map of a .bt or .ot file or a run's folder, with configuration, sensor model and robot of `like`, which stays as it is.

    ValueError names the file and what is wrong with it.
    """
    try:
        if path.is_dir():
            return _of_folder(path, like)
        return _of_file(path, like)
    except OSError as error:
        raise ValueError(f"{error.filename or path}: {error.strerror or error}") from error


def _of_file(path: Path, like: MapBuilder) -> LoadedMap:
    tree = OctreeMap.read(path, like.tree.sensor_model)
    try:
        return LoadedMap(MapBuilder.of_tree(like.config, tree, like.robot), None, f"{tree.leaf_count} voxels of {path}")
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _of_folder(folder: Path, like: MapBuilder) -> LoadedMap:
    if (folder / SWEEPS).is_file():
        return _of_session(folder, like)
    if (folder / _OCTREE).is_file():
        return _of_file(folder / _OCTREE, like)
    raise ValueError(f"{folder}: no map there: neither {SWEEPS} nor {_OCTREE}")


def _of_session(folder: Path, like: MapBuilder) -> LoadedMap:
    if not (folder / _GRAPH).is_file():
        raise ValueError(f"{folder}: no {_GRAPH}: the session was not saved at its end; ./explore --resume {folder} goes on with it")
    store, poses = SessionStore(folder), PoseGraph.load_g2o(folder / _GRAPH).poses()
    builder, damaged = MapBuilder(like.config, like.tree.sensor_model, like.robot), []
    for stored in store.sweeps[: len(poses)]:
        try:
            builder.add_sweep(_beams(store, stored.vertex_id), stored.vertex_id, poses[: stored.vertex_id + 1])
        except DamagedSweepError as error:
            damaged.append(str(error))
    if not len(builder):
        raise ValueError("; ".join([f"{folder}: no sweep there that could be read", *damaged]))
    described = "; ".join([f"{len(builder)} sweeps of {folder}", *damaged])
    builder.fix("a session")
    return LoadedMap(builder, poses[-1], described)


def _beams(store: SessionStore, vertex_id: int) -> Beams:
    cloud, free = store.load_sweep(vertex_id), store.load_free(vertex_id)
    return Beams(*cloud.singles(), *((_NO_BEAMS, _NO_BEAMS) if free is None else free.singles()))
