"""Median time and error of both registrations on simulated sweeps and, where it is there, a real pair; time of a large pose graph.

Usage: PYTHONPATH=src python benchmarks/registration.py [--repeats N] [--data FOLDER]
FOLDER holds room_scan1.pcd, room_scan2.pcd and sphere2500.txt; what is absent is named and left out.
"""

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np
import open3d as o3d

from rigid_geometry import inverse, rotation_angle, transform_from_rpy, translation_distance

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "src"), str(ROOT / "test" / "unit" / "pose_graph_mapping")]

from synthetic_sweeps import corridor, furnished_room, pose, sweep, world_of  # noqa: E402

from pose_graph_mapping import EdgeKind, PointCloud, PoseGraph, RegistrationConfig, create_registration, merged, vertex_cloud  # noqa: E402

METHODS = ("gicp", "thesis_chain")
DISTURBANCES = [
    transform_from_rpy((x, y, 0.03), (0.01, -0.01, yaw)) for x, y, yaw in [(0.2, -0.1, 0.1), (-0.3, 0.2, -0.2), (0.3, 0.4, 0.35)]
]
T_REAL_GUESS = transform_from_rpy((1.79387, 0.720047, 0.0), (0.0, 0.0, 0.6931))
T = TypeVar("T")


def timed(call: Callable[[], T]) -> tuple[float, T]:
    """Milliseconds of wall time and the value of one call."""
    start = time.perf_counter()
    value = call()
    return 1e3 * (time.perf_counter() - start), value


def simulated(name, boxes, repeats):
    """Match a full sweep to the area of three earlier ones from disturbed guesses."""
    rng, scene = np.random.default_rng(1), world_of(boxes)
    poses = [pose(-2, -0.6, 0.1), pose(-1, -0.3, 0.5), pose(0.3, 0.3, 1.0), pose(1, 0.4, 1.2)]
    sweeps = [PointCloud(*sweep(scene, T_map_base, rng, lines=400)) for T_map_base in poses]
    vertex_cloud(sweeps[0], 0.1, 20)
    kept = [timed(lambda c=c: vertex_cloud(c, 0.1, 20)) for c in sweeps]
    area = merged([cloud.transformed(T_map_base) for (_, cloud), T_map_base in zip(kept[:3], poses[:3], strict=True)])
    print(f"{name}: {len(sweeps[3])} points, area {len(area)}; vertex cloud {np.median([ms for ms, _ in kept]):.0f} ms")
    for method in METHODS:
        matcher = create_registration(RegistrationConfig(method=method))
        matcher.match(area, sweeps[3], poses[3])
        runs = [timed(lambda m=matcher, d=d: m.match(area, sweeps[3], poses[3] @ d)) for d in DISTURBANCES * repeats]
        report(method, runs, [poses[3]] * len(runs))


def report(method, runs, truths):
    """One line: time, errors, verdicts."""
    off = [inverse(T_true) @ result.T_reference_reading for (_, result), T_true in zip(runs, truths, strict=True)]
    metres, degrees = [np.linalg.norm(T_off[:3, 3]) for T_off in off], [np.degrees(rotation_angle(T_off)) for T_off in off]
    verdicts = ", ".join(sorted({result.verdict.value for _, result in runs}))
    print(
        f"  {method:13s} {np.median([ms for ms, _ in runs]):6.0f} ms  "
        f"median {100 * np.median(metres):6.2f} cm {np.median(degrees):6.3f} deg  "
        f"worst {100 * max(metres):6.2f} cm {max(degrees):6.3f} deg  {verdicts}"
    )


def real_pair(folder, repeats):
    """Both methods on a real room; without a truth, the difference between them and the round trip forth and back tell."""
    paths = [folder / f"room_scan{k}.pcd" for k in (1, 2)]
    if not all(path.exists() for path in paths):
        print("real room: room_scan1.pcd, room_scan2.pcd are absent")
        return
    clouds = []
    for path in paths:
        points = np.asarray(o3d.io.read_point_cloud(str(path)).points)
        points = points[np.linalg.norm(points, axis=1) > 1.5]  # the vehicle itself
        clouds.append(PointCloud(points, np.zeros_like(points)))
    print(f"real room: {len(clouds[0])} and {len(clouds[1])} points off the vehicle")
    found = []
    for method in METHODS:
        matcher = create_registration(RegistrationConfig(method=method, max_contradiction=0.02))
        runs = [timed(lambda m=matcher: m.match(clouds[0], clouds[1], T_REAL_GUESS)) for _ in range(repeats + 1)][1:]
        back = matcher.match(clouds[1], clouds[0], inverse(T_REAL_GUESS))
        found.append(runs[0][1].T_reference_reading)
        loop = found[-1] @ back.T_reference_reading
        print(
            f"  {method:13s} {np.median([ms for ms, _ in runs]):6.0f} ms  forth and back {100 * np.linalg.norm(loop[:3, 3]):.2f} cm "
            f"{np.degrees(rotation_angle(loop)):.3f} deg  "
            f"contradiction {100 * runs[0][1].free_space_contradiction:.2f} %  {runs[0][1].verdict.value}"
        )
    apart = inverse(found[0]) @ found[1]
    print(f"  between the two: {100 * np.linalg.norm(apart[:3, 3]):.2f} cm, {np.degrees(rotation_angle(apart)):.3f} deg")


def sphere(folder):
    """The 2,500 vertices of the sphere, from odometry: our graph's optimisation, plain losses."""
    path, truth_path = folder / "sphere2500.txt", folder / "sphere2500_groundtruth.txt"
    if not path.exists():
        print("sphere2500.txt is absent")
        return
    graph = read_sphere(path)
    ms, _ = timed(graph.optimise)
    print(f"sphere2500: {len(graph)} vertices, {len(graph.edges())} edges, optimised in {ms:.0f} ms")
    if truth_path.exists():
        truth = read_sphere(truth_path)
        T_align = truth.pose(0) @ inverse(graph.pose(0))
        errors = [translation_distance(T_align @ a, b) for a, b in zip(graph.poses(), truth.poses(), strict=False)]
        print(f"  RMS distance to the ground truth, aligned at the first vertex: {np.sqrt(np.mean(np.square(errors))):.3f} m")


def read_sphere(path):
    """EDGE3 lines as match edges; vertices follow the edges between neighbours in number."""
    graph, upper = PoseGraph(), np.triu_indices(6)
    graph.add_vertex(np.eye(4))
    edges = [line.split() for line in path.read_text().splitlines() if line.startswith("EDGE3")]
    parsed = [(int(w[1]), int(w[2]), transform_from_rpy(*_pose(w[3:9])), np.array(w[9:30], dtype=float)) for w in edges]
    for i, j, T_i_j, _ in sorted(parsed, key=lambda edge: edge[:2]):
        if j == i + 1 and j == len(graph):
            graph.add_vertex(graph.pose(i) @ T_i_j)
    for i, j, T_i_j, numbers in parsed:
        information = np.zeros((6, 6))
        information[upper] = numbers
        information += np.triu(information, 1).T
        order = [3, 4, 5, 0, 1, 2]
        graph.add_edge(i, j, T_i_j, np.linalg.inv(information[np.ix_(order, order)]), EdgeKind.MATCH)
    return graph


def _pose(words):
    x, y, z, roll, pitch, yaw = (float(w) for w in words)
    return (x, y, z), (roll, pitch, yaw)


def main():
    """Run everything that can be run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--data", type=Path, default=ROOT.parent / "shared" / "data")
    options = parser.parse_args()
    simulated("room", furnished_room(), options.repeats)
    simulated("corridor (errors along it are the guess's own)", corridor(), options.repeats)
    real_pair(options.data, options.repeats)
    sphere(options.data)


if __name__ == "__main__":
    main()
