"""How long the map takes to follow moved vertices: all of it from scratch, and what MapBuilder does; as a table.

    python benchmarks/map_rebuild.py SESSION [--sweeps 30 100 300] [--rounds 3]

With PYTHONPATH as ./check sets it. SESSION is the folder of a recorded run; for more sweeps than it has it is put down again and
again, side by side. Seconds of one core, medians of rounds in which old and new take turns; every map is compared with the one from
scratch, byte by byte. Also: what the sweeps take in memory.
"""

import argparse
import statistics
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.octree.map_builder import RUNS_MARGIN_M, Beams, MapBuilder, MapConfig
from octomap_server_3dnav.octree.octree import OctreeMap, SensorModel
from rigid_geometry import transform_from_quat, transform_from_rpy
from robot_body import RobotBody

LOCAL_RADIUS_M = 6.0 + RUNS_MARGIN_M
TILE_M = 25.0
NOTHING = np.zeros((0, 3), np.float32)
Array = NDArray[np.float64]


def recorded(session: Path) -> tuple[list[Beams], Array]:
    """The sweeps of a run and their poses (V, 4, 4)."""
    rows = np.loadtxt(session / "trajectory.txt", ndmin=2)
    poses = np.array([transform_from_quat(row[1:4], tuple(row[4:8])) for row in rows])
    beams = []
    for path in sorted((session / "sweeps").glob("*.npz"))[: len(poses)]:
        with np.load(path) as file:
            beams.append(Beams(*(file.get(name, NOTHING) for name in ("points", "origins", "free_points", "free_origins"))))
    return beams, poses[: len(beams)]


def tiled(beams: list[Beams], poses: Array, count: int) -> tuple[list[Beams], Array]:
    """`count` sweeps: the run again and again, in rows of four."""
    all_poses = poses[np.arange(count) % len(poses)].copy()
    tile = np.arange(count) // len(poses)
    all_poses[:, :2, 3] += TILE_M * np.column_stack([tile % 4, tile // 4])
    return [beams[i % len(beams)] for i in range(count)], all_poses


def movements(poses: Array) -> Iterator[tuple[str, Array]]:
    """What is moved, and all poses after it."""
    a_bit = transform_from_rpy((0.1, 0.05, 0.0))
    closure = transform_from_rpy((0.3, 0.2, 0.05), (0.0, 0.0, np.deg2rad(1.0)))
    for name, first, last, T in (
        ("one sweep in the middle", len(poses) // 2, len(poses) // 2 + 1, a_bit),
        ("the last third", len(poses) - len(poses) // 3, len(poses), closure),
        ("all but the first", 1, len(poses), closure),
    ):
        moved = poses.copy()
        moved[first:last] = T @ poses[first:last]
        yield f"{name} ({last - first})", moved


def from_scratch(beams: list[Beams], poses: Array) -> MapBuilder:
    """A builder that is given all sweeps one after the other."""
    builder = MapBuilder(MapConfig(), SensorModel(), RobotBody())
    for i, sweep in enumerate(beams):
        builder.add_sweep(sweep, i, poses[: i + 1])
    return builder


def seconds(call: Callable[[], object]) -> float:
    """Processor time of a call."""
    begin = time.process_time()
    call()
    return time.process_time() - begin


def timed_map(beams: list[Beams], poses: Array) -> tuple[float, OctreeMap]:
    """Processor time of a map from scratch, and the map."""
    begin = time.process_time()
    tree = from_scratch(beams, poses).tree
    return time.process_time() - begin, tree


class Follower:
    """A builder whose vertices can be moved: every time with one more, empty sweep, as a pose graph tells of it."""

    def __init__(self, beams: list[Beams], poses: Array) -> None:
        self.builder = from_scratch(beams, poses)

    def move(self, poses: Array) -> tuple[float, float]:
        """Seconds until the surroundings of the last pose are drawn, and until all else is."""
        vertex = len(self.builder)
        extra = np.broadcast_to(poses[-1], (vertex + 1 - len(poses), 4, 4))
        nothing = Beams(NOTHING, NOTHING, NOTHING, NOTHING)
        told = seconds(lambda: self.builder.add_sweep(nothing, vertex, np.concatenate([poses, extra])))
        near = seconds(lambda: self.builder.runs_around(poses[-1], LOCAL_RADIUS_M))
        return told + near, seconds(lambda: self.builder.tree)


def rebuild_row(name: str, beams: list[Beams], poses: Array, moved: Array, rounds: int, follower: Follower) -> str:
    """One line of the table."""
    times, same = [], True
    for _ in range(rounds):
        scratch, built = timed_map(beams, moved)
        times.append((scratch, *follower.move(moved)))
        same &= follower.builder.tree.to_full() == built.to_full()
        follower.move(poses)
    scratch, near, rest = (statistics.median(column) for column in zip(*times, strict=True))
    return (
        f"| {len(beams)} | {name} | {scratch:.2f} | {near:.2f} | {rest:.2f} | {scratch / (near + rest):.1f} | {'yes' if same else 'NO'} |"
    )


def sweep_bytes(builder: MapBuilder) -> int:
    """What is kept of the sweeps besides tree and heights, on the shelf or in memory: beams, to trace them anew, and what they saw."""
    arrays = (array for s in builder._sweeps for part in (s.beams(), s.hits()) for array in vars(part).values())
    return sum(int(array.nbytes) for array in arrays) + sum(voxels.memory_bytes() for s in builder._sweeps for voxels in s.voxels)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("session", type=Path, help="folder of a recorded run")
    parser.add_argument("--sweeps", type=int, nargs="+", default=[30, 100, 300])
    parser.add_argument("--rounds", type=int, default=3)
    args = parser.parse_args()
    run = recorded(args.session)
    print("| sweeps | moved | from scratch s | before the decision s | after it s | times faster | same bytes |")
    print("|---|---|---|---|---|---|---|")
    for count in args.sweeps:
        beams, poses = tiled(*run, count)
        follower = Follower(beams, poses)
        for name, moved in movements(poses):
            print(rebuild_row(name, beams, poses, moved, args.rounds, follower), flush=True)
        builder = follower.builder
        beam_bytes = sum(array.nbytes for sweep in beams for array in vars(sweep).values())
        kept = [part / 1e6 for part in (beam_bytes, sweep_bytes(builder) - beam_bytes, builder.tree.memory_bytes)]
        print("{} sweeps keep {:.0f} MB of beams and {:.0f} MB of voxels; the tree takes {:.0f} MB".format(count, *kept), flush=True)


if __name__ == "__main__":
    main()
