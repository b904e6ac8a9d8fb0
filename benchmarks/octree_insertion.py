"""How long the octree takes: a sweep of 130,000 points in clutter, column runs, copies and bytes; medians, as a table.

    python benchmarks/octree_insertion.py [--map FILE.bt] [--repeats 7]

With PYTHONPATH as ./check sets it. The clutter is synthetic: rooms of 5, 20 and 40 m with boxes in them, at 0.08 m; --map adds
the column runs of a real map, such as octomap's geb079.bt.
"""

import argparse
import statistics
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.octree.octree import OctreeMap, SensorModel

RESOLUTION_M = 0.08
POINTS = 130_000
Boxes = tuple[NDArray[np.float64], NDArray[np.float64]]
Sweep = tuple[NDArray[np.float32], NDArray[np.float32]]


def cluttered_room(half_size: float, rng: np.random.Generator) -> Boxes:
    """Lower and upper corners (K, 3) of boxes on the floor of a room, none within 1.5 m of its middle lines."""
    count = int(half_size * half_size)
    center = rng.uniform(1.5, half_size, (count, 2)) * rng.choice([-1, 1], (count, 2))
    size = rng.uniform(0.15, 0.6, (count, 3)) * [1, 1, 3]
    low = np.column_stack([center - size[:, :2] / 2, np.zeros(count)])
    return low, low + size


def scan(origin: NDArray[np.float64], half_size: float, boxes: Boxes, rng: np.random.Generator) -> Sweep:
    """Beams evenly spread over azimuth and from 75 degrees down to 35 up, to the first box, wall, floor or ceiling, with noise."""
    azimuth, elevation = rng.uniform(-np.pi, np.pi, POINTS), np.deg2rad(rng.uniform(-75, 35, POINTS))
    direction = np.stack([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)], axis=1)
    walls = np.where(direction > 0, [half_size, half_size, 3.0], [-half_size, -half_size, 0.0])
    reach = ((walls - origin) / direction).min(axis=1)
    for low, high in zip(*boxes, strict=True):
        a, b = (low - origin) / direction, (high - origin) / direction
        near, far = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
        reach = np.where((near < far) & (near > 0), np.minimum(reach, near), reach)
    points = origin + direction * (reach + rng.normal(0, 0.015, POINTS))[:, None]
    return points.astype(np.float32), np.broadcast_to(origin, points.shape).astype(np.float32)


def sweeps(half_size: float, count: int, rng: np.random.Generator) -> list[Sweep]:
    """Sweeps along the middle line of a room."""
    boxes = cluttered_room(half_size, rng)
    return [scan(np.array([x, 0.0, 0.85]), half_size, boxes, rng) for x in np.linspace(-0.6, 0.6, count) * half_size]


def median_ms(call: Callable[[], object], repeats: int) -> float:
    """Median wall time of a call in milliseconds."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return 1000 * statistics.median(times)


def first_sweep_ms(sweep: Sweep, max_range_m: float, model: SensorModel, repeats: int) -> float:
    """Median milliseconds of a sweep into an empty map, without freeing the map."""
    maps = iter([OctreeMap(RESOLUTION_M, model) for _ in range(repeats)])
    return median_ms(lambda: next(maps).insert_sweep(*sweep, max_range_m), repeats)


def insertion_rows(name: str, half_size: float, max_range_m: float, repeats: int) -> Iterator[tuple[str, float]]:
    """A room's rows: the first sweep, the later ones, and what is asked of the tree that they grew."""
    all_sweeps = sweeps(half_size, max(repeats, 3), np.random.default_rng(0))
    for label, model in (("", SensorModel()), (", grazing rule off", SensorModel(grazing_m=0.0))):
        yield f"{name}: first sweep into an empty map{label}", first_sweep_ms(all_sweeps[0], max_range_m, model, repeats)
    octree = OctreeMap(RESOLUTION_M)
    rest = iter(all_sweeps)
    yield f"{name}: sweep into a growing map", median_ms(lambda: octree.insert_sweep(*next(rest), max_range_m), len(all_sweeps))
    yield from query_rows(f"{name}: live map", octree, repeats)
    yield from query_rows(f"{name}: same map, loaded", OctreeMap.from_full(octree.to_full(), RESOLUTION_M), repeats)


def query_rows(name: str, octree: OctreeMap, repeats: int) -> Iterator[tuple[str, float]]:
    """What the nodes ask after every sweep."""
    yield f"{name}, column runs of all {octree.leaf_count} leaves", median_ms(octree.column_runs, repeats)
    yield f"{name}, column runs within 6 m", median_ms(lambda: octree.column_runs([-6, -6, -5], [6, 6, 5]), repeats)
    yield f"{name}, to_binary", median_ms(octree.to_binary, repeats)
    yield f"{name}, to_binary within 6 m", median_ms(lambda: octree.to_binary([-6, -6, -5], [6, 6, 5]), repeats)
    yield f"{name}, to_full", median_ms(octree.to_full, repeats)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--map", type=Path, help="a .bt or .ot file to query too")
    parser.add_argument("--repeats", type=int, default=7)
    args = parser.parse_args()
    rows = list(insertion_rows("5 m room, 10 m range", 2.5, 10.0, args.repeats))
    rows += insertion_rows("20 m hall, 10 m range", 10.0, 10.0, args.repeats)
    rows += insertion_rows("40 m hall, 30 m range", 20.0, 30.0, args.repeats)
    if args.map:
        rows += query_rows(args.map.name, OctreeMap.read(args.map), args.repeats)
    print("| what | median ms |\n|---|---|")
    for name, milliseconds in rows:
        print(f"| {name} | {milliseconds:.1f} |")


if __name__ == "__main__":
    main()
