"""Optimisation of a large graph: time, and the distance to the truth where that is known.

    python benchmarks/pose_graph_optimization.py [--data FOLDER]

With PYTHONPATH as benchmarks/README.md sets it. FOLDER holds sphere2500.txt and, where there is one, sphere2500_groundtruth.txt: 2,500
vertices with EDGE3 lines, started from odometry, all losses plain.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from pose_graph_mapping import EdgeKind, PoseGraph
from rigid_geometry import inverse, transform_from_rpy, translation_distance

ROOT = Path(__file__).resolve().parents[1]


def sphere(folder):
    """The 2,500 vertices of the sphere, from odometry: our graph's optimisation, plain losses."""
    path, truth_path = folder / "sphere2500.txt", folder / "sphere2500_groundtruth.txt"
    if not path.exists():
        print("sphere2500.txt is absent")
        return
    graph = read_sphere(path)
    start = time.perf_counter()
    graph.optimise()
    ms = 1e3 * (time.perf_counter() - start)
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
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=ROOT.parent / "shared" / "data")
    sphere(parser.parse_args().data)


if __name__ == "__main__":
    main()
