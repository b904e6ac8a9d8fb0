"""Insertion of a sweep of 130,000 points beside octomap's own insertPointCloud (by pyoctomap), into the same growing tree: medians.

    pip install pyoctomap==1.2.2; python benchmarks/octree_libraries.py [--sweeps 7]

With PYTHONPATH as benchmarks/README.md sets it. Sweeps go along the middle line of cluttered rooms at 0.08 m, into both trees in turns. Our
rule for surfaces that beams graze is off, since octomap has none: both hold the same occupied voxels after a sweep, or the exit code is 1.
After more sweeps a few differ, since octomap casts a ray for every point, and this one for every voxel in which points lie.
"""

import argparse
import statistics
import sys
import tempfile
import time
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from octree_insertion import RESOLUTION_M, sweeps

from octomap_server_3dnav.octree.octree import OctreeMap, SensorModel

ROOMS = (("5 m room", 2.5, 10.0), ("20 m hall", 10.0, 10.0), ("40 m hall", 20.0, 30.0))
_HEADER = (
    "| room | range | pyoctomap ms | with discretize ms | this ms | times faster | occupied voxels; differing after one sweep, after all |"
)


class Theirs(Protocol):
    """What is asked of a tree of pyoctomap."""

    def insertPointCloud(
        self, points: NDArray[np.float64], origin: NDArray[np.float64], *, max_range: float, discretize: bool = False
    ) -> object: ...

    def write(self, filename: str) -> object: ...


def occupied_of(octree: OctreeMap) -> NDArray[np.int64]:
    """(K, 3) indices of the occupied voxels."""
    runs = octree.column_runs()
    which = np.flatnonzero(runs.occupied)
    counts = runs.z_hi[which].astype(np.int64) - runs.z_lo[which] + 1
    column = np.repeat(runs.columns[which], counts)
    z = np.repeat(runs.z_lo[which], counts) + np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.stack([column // runs.ny + runs.origin_key[0], column % runs.ny + runs.origin_key[1], z], axis=1)


def differing(a: NDArray[np.int64], b: NDArray[np.int64]) -> int:
    """Rows that are in one of both only."""
    return len(set(map(tuple, a.tolist())) ^ set(map(tuple, b.tolist())))


def differing_from(tree: Theirs, ours: OctreeMap) -> int:
    """Occupied voxels that are in one of both only."""
    with tempfile.TemporaryDirectory() as folder:
        tree.write(f"{folder}/theirs.ot")
        return differing(occupied_of(ours), occupied_of(OctreeMap.read(f"{folder}/theirs.ot")))


def compared(half_size: float, max_range_m: float, count: int) -> tuple[list[float], int, list[int]]:
    """Median milliseconds of pyoctomap, of it with discretize, and of ours; occupied voxels, and how many differ after every sweep."""
    import pyoctomap  # it is no requirement of the project

    theirs: Theirs = pyoctomap.OcTree(RESOLUTION_M)
    coarser: Theirs = pyoctomap.OcTree(RESOLUTION_M)
    ours = OctreeMap(RESOLUTION_M, SensorModel(miss=0.4, min=0.12, grazing_m=0.0))
    times: tuple[list[float], ...] = ([], [], [])
    differ = []
    for points, origins in sweeps(half_size, count, np.random.default_rng(0)):
        rows, origin = points.astype(np.float64), origins[0].astype(np.float64)
        calls = (
            lambda p=rows, o=origin: theirs.insertPointCloud(p, o, max_range=max_range_m),
            lambda p=rows, o=origin: coarser.insertPointCloud(p, o, max_range=max_range_m, discretize=True),
            lambda p=points, o=origins: ours.insert_sweep(p, o, max_range_m),
        )
        for call, found in zip(calls, times, strict=True):
            begin = time.perf_counter()
            call()
            found.append(1000.0 * (time.perf_counter() - begin))
        differ.append(differing_from(theirs, ours))
    return [statistics.median(found) for found in times], len(occupied_of(ours)), differ


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sweeps", type=int, default=7, metavar="N")
    options = parser.parse_args()
    print(_HEADER + "\n|---|---|---|---|---|---|---|")
    wrong = 0
    for name, half_size, max_range_m in ROOMS:
        (theirs, coarser, ours), occupied, differ = compared(half_size, max_range_m, options.sweeps)
        voxels = f"{occupied}; {differ[0]}, {differ[-1]}"
        print(f"| {name} | {max_range_m:.0f} m | {theirs:.0f} | {coarser:.0f} | {ours:.0f} | {theirs / ours:.1f} | {voxels} |")
        wrong += differ[0]
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
