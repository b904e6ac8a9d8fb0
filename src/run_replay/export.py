"""A finished run as one MCAP file, for Foxglove and whoever has no ROS: what `run_replay_node` shows, each with its time.

/tf (map to base_link), /sweep (the points of each sweep), /trajectory and /pose_graph as they grow; /cloud_map, /terrain (classified
voxels), /occupied and /plan at the end; /events. All in map. Messages are those of ROS 1, whose definitions are in the file.
"""

import heapq
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap.writer import Writer
from numpy.typing import NDArray

from exploration_evaluation import read_arrays, read_events
from octomap_server_3dnav.navigation.class_colours import CLASS_RGB
from octomap_server_3dnav.terrain.classify import TerrainClass
from pose_graph_mapping.registration.cloud import PointCloud, voxel_downsample
from rigid_geometry import transform_from_rpy, transform_points
from run_replay import mcap_messages as ros
from run_replay.recorded_run import ClassifiedVoxels, RecordedRun, read_run
from run_replay.timeline import frames
from whole_files import written_whole

Floats = NDArray[np.float64]

_POSE_EVERY_S, _VOXEL_M = 0.1, 0.05
_UNCLASSIFIED = (0.6, 0.6, 0.6)
_VERTEX, _EDGES = (1.0, 0.8, 0.0), {"odometry": (0.6, 0.6, 0.6), "match": (1.0, 1.0, 1.0), "loop": (1.0, 0.2, 0.8)}


class Recorded(NamedTuple):
    """A message and its time."""

    stamp_s: float
    topic: str
    message: object


def export(folder: Path, target: Path) -> int:
    """Writes the run of a folder to one file, and says how many messages it has. ValueError for a run that cannot be read.

    An older file is replaced when the new one is complete; OSError when it cannot be written.
    """
    run = read_run(folder)
    with written_whole(target) as unfinished, unfinished.open("wb") as file:
        return _write(Writer(file), _messages(folder, run), _about(folder))


def _write(writer: Writer, found: Iterable[Recorded], about: dict[str, str]) -> int:
    """How many messages; each is let go before the next is made, for a sweep's way and graph are those of all before it."""
    count = 0
    writer.start(profile="ros1", library="explore_3dnav")
    schemas: dict[str, int] = {}
    channels: dict[str, int] = {}
    for stamp_s, topic, message in found:
        kind = type(message).__msgtype__  # type: ignore[attr-defined]
        if kind not in schemas:
            definition, _ = ros.TYPES.generate_msgdef(kind)
            schemas[kind] = writer.register_schema(kind.replace("/msg/", "/"), "ros1msg", definition.encode())
        if topic not in channels:
            channels[topic] = writer.register_channel(topic, "ros1", schemas[kind])
        time_ns = round(stamp_s * 1e9)
        writer.add_message(channels[topic], time_ns, bytes(ros.TYPES.serialize_ros1(message, kind)), time_ns)
        count += 1
    writer.add_metadata("run", about)
    writer.finish()
    return count


def _about(folder: Path) -> dict[str, str]:
    """What is told of the run in words."""
    try:
        told = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        return {key: str(told[key]) for key in ("world", "seed", "success", "stop_reason") if key in told}
    except (OSError, ValueError):
        return {}


def _messages(folder: Path, run: RecordedRun) -> Iterator[Recorded]:
    """In the order of their time, as each of the four is."""
    shown = frames(run.path.stamps_s, run.path.poses, run.sweep_stamps_s, _POSE_EVERY_S)
    moved = (Recorded(frame.stamp_s, "/tf", ros.transform(frame.stamp_s, frame.T_map_base)) for frame in shown)
    parts = moved, _sweeps(run), _at_the_end(shown[-1].stamp_s, folder, run), _events(folder, run)
    return heapq.merge(*parts, key=lambda recorded: recorded.stamp_s)


def _events(folder: Path, run: RecordedRun) -> Iterator[Recorded]:
    try:
        stamps, _, states = read_events(folder / "events.csv")
    except ValueError:
        return
    for stamp_s, state in sorted(zip(run.shown_time.at(stamps).tolist(), states, strict=True), key=lambda told: told[0]):
        yield Recorded(stamp_s, "/events", ros.event(stamp_s, state))


def _sweeps(run: RecordedRun) -> Iterator[Recorded]:
    clouds = []
    for k, stamp_s in enumerate(run.sweep_stamps_s.tolist()):
        seen = voxel_downsample(run.sweeps.load_sweep(k), _VOXEL_M).points
        clouds.append(transform_points(run.vertex_poses[k], seen))
        yield Recorded(stamp_s, "/sweep", ros.cloud(stamp_s, clouds[-1]))
        poses = run.vertex_poses[: k + 1]
        yield Recorded(stamp_s, "/trajectory", ros.path(stamp_s, run.sweep_stamps_s[: k + 1].tolist(), poses))
        yield Recorded(stamp_s, "/pose_graph", _graph(stamp_s, poses[:, :3, 3], run))
    end_s = float(max(run.sweep_stamps_s[-1], run.path.stamps_s[-1]))
    yield Recorded(end_s, "/cloud_map", ros.cloud(end_s, voxel_downsample(PointCloud(np.concatenate(clouds)), _VOXEL_M).points))


def _graph(stamp_s: float, places: Floats, run: RecordedRun) -> object:
    """The vertices so far, and the edges between them."""
    drawn = [ros.spheres(stamp_s, "vertices", places, 0.22, _VERTEX)]
    for kind, colour in _EDGES.items():
        ends = [k for i, j, of in run.edges if of == kind and max(i, j) < len(places) for k in (i, j)]
        drawn.append(ros.lines(stamp_s, kind, places[ends], 0.06, colour))
    return ros.markers(drawn)


def _at_the_end(end_s: float, folder: Path, run: RecordedRun) -> Iterator[Recorded]:
    if run.terrain is not None:
        colours = {"rgb": ros.packed_rgb(_colours(run.terrain)), "class": run.terrain.label.astype(np.float32)}
        yield Recorded(end_s, "/terrain", ros.cloud(end_s, run.terrain.points, colours))
    if run.occupied is not None:
        yield Recorded(end_s, "/occupied", ros.cloud(end_s, run.occupied.centers, {"size": run.occupied.sizes.astype(np.float32)}))
    plan = _plan(folder)
    if len(plan):
        poses = np.stack([transform_from_rpy(tuple(point)) for point in plan.tolist()])
        yield Recorded(end_s, "/plan", ros.path(end_s, [end_s] * len(plan), poses))


def _colours(terrain: ClassifiedVoxels) -> Floats:
    """(N, 3) of the voxels, by their classes."""
    table = np.array([CLASS_RGB.get(TerrainClass(value), _UNCLASSIFIED) for value in range(max(TerrainClass) + 1)])
    return np.asarray(table[np.minimum(terrain.label, len(table) - 1)])


def _plan(folder: Path) -> Floats:
    """(K, 3) the last plan, empty where none was saved."""
    try:
        return np.asarray(read_arrays(folder / "path.npz", ("points",))["points"], dtype=np.float64).reshape(-1, 3)
    except ValueError:
        return np.zeros((0, 3))
