"""How near a pose graph's solution comes to gtsam's batch optimum, clean and with a tenth of its loop edges replaced by random ones.

    python benchmarks/pose_graph.py [--data FOLDER] [--seeds 1 2 3] [--share 0.1] [--gnc]

With PYTHONPATH as benchmarks/README.md sets it. FOLDER holds sphere2500.txt and, where there is one, sphere2500_groundtruth.txt. The
reference is gtsam's Levenberg-Marquardt on the edges that were not replaced, built here without the project's code; errors are half of the
squared Mahalanobis distances, of these edges only. --gnc times gtsam's own graduated solver on the same graphs, which takes minutes.
(gtsam.readG2o takes the information of EDGE3 lines rotation first, which is not what the file means: its optimum is another one.)
"""

import argparse
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import gtsam
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mapping_tools.graph_solving import SolvedGraph, numbered, solve_plain, solve_robust
from pose_graph_mapping.graph.graph_files import read_graph_file

ROOT = Path(__file__).resolve().parents[1]
Array = NDArray[np.float64]
Words = list[str]
ORDER = np.ix_([3, 4, 5, 0, 1, 2], [3, 4, 5, 0, 1, 2])


def edge_lines(path: Path) -> list[Words]:
    """The words of every EDGE3 line."""
    return [line.split() for line in path.read_text().splitlines() if line.startswith("EDGE3")]


def is_loop(words: Words) -> bool:
    return int(words[2]) != int(words[1]) + 1


def replaced(lines: Sequence[Words], kind: str, share: float, seed: int) -> tuple[list[Words], set[int]]:
    """The lines with a share of the loops replaced, and which those are: other measurements of the same vertices, or other vertices."""
    rng, lines = np.random.default_rng(seed), [list(words) for words in lines]
    vertices = 1 + max(int(words[2]) for words in lines)
    loops = [k for k, words in enumerate(lines) if is_loop(words)]
    chosen = sorted(rng.choice(loops, round(share * len(loops)), replace=False).tolist())
    for k in chosen:
        if kind == "vertices":
            i = int(rng.integers(0, vertices - 2))
            lines[k][1:3] = [str(i), str(int(rng.integers(i + 2, vertices)))]
        else:
            angles = Rotation.random(rng=rng).as_euler("xyz")
            lines[k][3:9] = [repr(float(v)) for v in (*rng.normal(0.0, 20.0, 3), *angles)]
    return lines, set(chosen)


def gtsam_factors(lines: Sequence[Words]) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """The graph as gtsam builds it, first vertex held at the origin, and the values along its odometry."""
    factors, values, upper = gtsam.NonlinearFactorGraph(), gtsam.Values(), np.triu_indices(6)
    factors.add(gtsam.PriorFactorPose3(0, gtsam.Pose3(), gtsam.noiseModel.Isotropic.Sigma(6, 1e-3)))
    values.insert(0, gtsam.Pose3())
    for words in lines:
        i, j, numbers = int(words[1]), int(words[2]), np.array(words[3:], dtype=float)
        information = np.zeros((6, 6))
        information[upper] = numbers[6:]
        information += np.triu(information, 1).T
        x, y, z, roll, pitch, yaw = numbers[:6]
        measured = gtsam.Pose3(gtsam.Rot3.Ypr(yaw, pitch, roll), gtsam.Point3(x, y, z))
        factors.add(gtsam.BetweenFactorPose3(i, j, measured, gtsam.noiseModel.Gaussian.Information(information[ORDER])))
        if j == i + 1 and not values.exists(j):
            values.insert(j, values.atPose3(i).compose(measured))
    return factors, values


def batch(lines: Sequence[Words]) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values, float]:
    """gtsam's optimum of the lines, its factors, and its wall time."""
    factors, start = gtsam_factors(lines)
    began = time.perf_counter()
    params = gtsam.LevenbergMarquardtParams()
    params.setRelativeErrorTol(1e-10)
    params.setMaxIterations(200)
    best = gtsam.LevenbergMarquardtOptimizer(factors, start, params).optimize()
    return factors, best, time.perf_counter() - began


def as_values(poses: Array) -> gtsam.Values:
    values = gtsam.Values()
    for k, T in enumerate(poses):
        values.insert(k, gtsam.Pose3(T))
    return values


def ours(lines: Sequence[Words], plain: bool) -> tuple[SolvedGraph, float]:
    """Our solution of the lines, read from a file as ./optimize_graph reads them, and its wall time."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "graph.txt"
        path.write_text("".join(" ".join(words) + "\n" for words in lines))
        graph = numbered(read_graph_file(path))
    began = time.perf_counter()
    solved = solve_plain(graph.problem) if plain else solve_robust(graph.problem, 30.0, lambda _: None)
    return solved, time.perf_counter() - began


def gtsam_gnc(lines: Sequence[Words]) -> tuple[set[int], gtsam.Values, float]:
    """gtsam's graduated solver with the odometry known to be right: which edges it leaves out, its values and wall time."""
    factors, start = gtsam_factors(lines)
    params = gtsam.GncLMParams()
    params.setLossType(gtsam.GncLossType.TLS)
    params.setKnownInliers([0] + [k + 1 for k, words in enumerate(lines) if not is_loop(words)])
    began = time.perf_counter()
    optimizer = gtsam.GncLMOptimizer(factors, start, params)
    optimizer.setInlierCostThresholdsAtProbability(0.9999)
    values = optimizer.optimize()
    return set(np.flatnonzero(np.ravel(optimizer.getWeights())[1:] < 0.5).tolist()), values, time.perf_counter() - began


def row(
    name: str,
    clean: gtsam.NonlinearFactorGraph,
    reference: gtsam.Values,
    values: gtsam.Values,
    left_out: set[int],
    false: set[int],
    seconds: float,
) -> None:
    error, best = clean.error(values), clean.error(reference)
    print(
        f"| {name} | {error:.4f} | {best:.4f} | {100 * (error / best - 1):+.4f} % | {len(false - left_out)} | {len(left_out - false)} "
        f"| {seconds:.1f} |",
        flush=True,
    )


def clean_graph(lines: Sequence[Words]) -> Array:
    """Two rows: every edge believed, and edges judged where none is false."""
    factors, best, seconds = batch(lines)
    print(f"{len(lines)} edges, {sum(is_loop(words) for words in lines)} of them loops; gtsam's batch takes {seconds:.1f} s\n")
    print("| solver, graph | error of the true edges | gtsam's optimum of these | above it | false kept | true left out | wall s |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for plain, name in ((True, "plain, clean"), (False, "robust, clean")):
        solved, seconds = ours(lines, plain)
        row(name, factors, best, as_values(solved.poses), set(np.flatnonzero(~solved.kept).tolist()), set(), seconds)
    return solved.poses


def truth_distance(path: Path, poses: Array) -> None:
    """RMS distance to the true positions along the ground truth's odometry, aligned at the first vertex."""
    if path.exists():
        _, truth = gtsam_factors([words for words in edge_lines(path) if not is_loop(words)])
        positions = np.array([truth.atPose3(k).translation() for k in range(len(poses))])
        rms_m = np.sqrt(np.mean(np.sum((poses[:, :3, 3] - positions) ** 2, axis=1)))
        print(f"\nRMS distance to the ground truth, aligned at the first vertex: {rms_m:.3f} m")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=ROOT.parent / "shared" / "data")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--share", type=float, default=0.1)
    parser.add_argument("--gnc", action="store_true")
    options = parser.parse_args()
    path = options.data / "sphere2500.txt"
    if not path.exists():
        raise SystemExit(f"{path} is absent")
    lines = edge_lines(path)
    poses = clean_graph(lines)
    for kind in ("measurements", "vertices"):
        for seed in options.seeds:
            damaged, false = replaced(lines, kind, options.share, seed)
            clean, best, _ = batch([words for k, words in enumerate(damaged) if k not in false])
            solved, seconds = ours(damaged, plain=False)
            name = f"{100 * options.share:g} % of the loops with random {kind}, seed {seed}"
            row(f"robust, {name}", clean, best, as_values(solved.poses), set(np.flatnonzero(~solved.kept).tolist()), false, seconds)
            if options.gnc:
                left_out, values, seconds = gtsam_gnc(damaged)
                row(f"gtsam's GNC, {name}", clean, best, values, left_out, false, seconds)
    truth_distance(options.data / "sphere2500_groundtruth.txt", poses)


if __name__ == "__main__":
    main()
