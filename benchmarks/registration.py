"""Registration side by side with libraries that people use, on the same pairs in the same run: how many are right, and how long they take.

    python benchmarks/registration.py [--worlds rooms ramp moon] [--classes 20 45 180] [--pairs 10] [--data FOLDER] [--json FILE]

With PYTHONPATH as benchmarks/README.md sets it. Every method gets the full sweep and the map's points and does its own preparation, which
counts; all may use two threads. Right: under 5 cm and 0.5 deg off (and, of ours, usable). FOLDER holds room_scan1.pcd and room_scan2.pcd,
one real room from two places: each method finds the second in the first from no guess at all and from the known one; a real pair has no
truth, so what counts is how far apart the two answers are. Where the files are absent, this part is left out.
"""

import os

os.environ["OMP_NUM_THREADS"] = "2"  # open3d reads it when it is loaded

import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import open3d as o3d
import small_gicp
from numpy.typing import NDArray
from registration_basin import SHIFT_M, guess_of
from registration_cases import case_of
from registration_scores import RIGHT_DEG, RIGHT_M, argument_parser, share, text_table, write_json
from registration_worlds import BUILT_IN

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.cloud import PointCloud
from pose_graph_mapping.registration.methods import create_registration
from rigid_geometry import inverse, rotation_angle, transform_from_rpy

Array = NDArray[np.float64]
Method = Callable[[PointCloud, PointCloud, Array, Array | None], tuple[Array, str]]
"""(reference, reading, guess, covariance of the guess) to transform and verdict; those that give no verdict are always sure."""

THREADS, SURE = 2, "accepted"
VOXEL_M, COARSE_VOXEL_M, COARSE_M, FINE_M = 0.1, 0.3, 1.0, 0.3
VEHICLE_M = 1.5  # nearer points of the real scans are the car that carried the scanner
MOVING_THINGS = 0.02  # share of points in free space that the real pair may have
T_REAL_GUESS = transform_from_rpy((1.79387, 0.720047, 0.0), (0.0, 0.0, 0.6931))
HEADER = ("world", "yaw deg", "shift m", "method", "right %", "wrong %", "cm", "deg", "median ms")
REAL_HEADER = ("real room", "no guess ms", "known ms", "cm apart", "deg apart", "verdict")


def ours(config: RegistrationConfig) -> Method:
    """This project's."""
    matcher = create_registration(config)

    def run(reference: PointCloud, reading: PointCloud, T_guess: Array, covariance: Array | None) -> tuple[Array, str]:
        result = matcher.match(reference, reading, T_guess, covariance)
        return result.T_reference_reading, result.verdict.value

    return run


def small_gicp_align(kind: str) -> Method:
    """small_gicp: preprocess_points and two calls of align, coarse and fine."""

    def run(reference: PointCloud, reading: PointCloud, T_guess: Array, covariance: Array | None) -> tuple[Array, str]:
        clouds = [small_gicp.preprocess_points(c.points, VOXEL_M, num_threads=THREADS) for c in (reference, reading)]
        (target, tree), (source, _) = clouds
        T, result = T_guess, None
        for distance in (COARSE_M, FINE_M):
            if kind == "VGICP":
                voxels = small_gicp.GaussianVoxelMap(distance)
                voxels.insert(target)
                result = small_gicp.align(voxels, source, T, max_correspondence_distance=distance, num_threads=THREADS)
            else:
                result = small_gicp.align(target, source, tree, T, kind, distance, THREADS)
            T = np.asarray(result.T_target_source)
        return T, SURE

    return run


def _open3d_cloud(points: Array, voxel_m: float) -> o3d.geometry.PointCloud:
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)).voxel_down_sample(voxel_m)
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(radius=3 * voxel_m, max_nn=30))
    return cloud


def _point_to_plane(clouds: Sequence[o3d.geometry.PointCloud], T_start: Array, distances: Sequence[float]) -> Array:
    plane, T = o3d.pipelines.registration.TransformationEstimationPointToPlane(), T_start
    for distance in distances:
        T = o3d.pipelines.registration.registration_icp(clouds[1], clouds[0], distance, T, plane).transformation
    return np.asarray(T)


def open3d_icp(reference: PointCloud, reading: PointCloud, T_guess: Array, covariance: Array | None) -> tuple[Array, str]:
    """open3d: point-to-plane ICP, coarse and fine."""
    clouds = [_open3d_cloud(c.points, VOXEL_M) for c in (reference, reading)]
    return _point_to_plane(clouds, T_guess, (COARSE_M, FINE_M)), SURE


def open3d_features(reference: PointCloud, reading: PointCloud, T_guess: Array, covariance: Array | None) -> tuple[Array, str]:
    """open3d: FPFH features and RANSAC, which need no guess, then point-to-plane ICP."""
    o3d.utility.random.seed(1)
    registration = o3d.pipelines.registration
    coarse = [_open3d_cloud(c.points, COARSE_VOXEL_M) for c in (reference, reading)]
    around = o3d.geometry.KDTreeSearchParamHybrid(radius=5 * COARSE_VOXEL_M, max_nn=100)
    features = [registration.compute_fpfh_feature(c, around, range(len(c.points))) for c in coarse]
    (target, source), (target_feature, source_feature), distance = coarse, features, 1.5 * COARSE_VOXEL_M
    found = registration.registration_ransac_based_on_feature_matching(
        source,
        target,
        source_feature,
        target_feature,
        True,
        distance,
        registration.TransformationEstimationPointToPoint(False),
        3,
        [registration.CorrespondenceCheckerBasedOnEdgeLength(0.9), registration.CorrespondenceCheckerBasedOnDistance(distance)],
        registration.RANSACConvergenceCriteria(100_000, 0.999),
    )
    clouds = [_open3d_cloud(c.points, VOXEL_M) for c in (reference, reading)]
    return _point_to_plane(clouds, found.transformation, (COARSE_M, FINE_M)), SURE


METHODS: dict[str, Method] = {
    "ours": ours(RegistrationConfig()),
    "thesis_chain": ours(RegistrationConfig(method="thesis_chain")),
    "small_gicp GICP": small_gicp_align("GICP"),
    "small_gicp VGICP": small_gicp_align("VGICP"),
    "open3d ICP": open3d_icp,
    "open3d FPFH+RANSAC": open3d_features,
}


def errors(T_true: Array, T_found: Array) -> tuple[float, float]:
    """Metres and degrees between two transforms."""
    T_off = inverse(T_true) @ T_found
    return float(np.linalg.norm(T_off[:3, 3])), math.degrees(rotation_angle(T_off))


@dataclass(frozen=True)
class Answer:
    """What a method made of a pair: its time, its error, and whether it calls itself sure."""

    milliseconds: float
    metres: float
    degrees: float
    sure: bool

    @property
    def near(self) -> bool:
        return self.metres < RIGHT_M and self.degrees < RIGHT_DEG


def timed(run: Method, reference: PointCloud, reading: PointCloud, T_guess: Array, covariance: Array | None) -> tuple[float, Array, str]:
    """Milliseconds of wall time, then what the method gave."""
    start = time.perf_counter()
    T_found, verdict = run(reference, reading, T_guess, covariance)
    return 1e3 * (time.perf_counter() - start), T_found, verdict


def simulated(world: str, degrees: int, pairs: int, cache: Path) -> list[list[object]]:
    """Rows of one world and class; all methods take their turns on each pair, from the guesses of registration_basin.py."""
    found: dict[str, list[Answer]] = {name: [] for name in METHODS}
    for k in range(pairs):
        case = case_of(world, k, cache=cache)
        guess = guess_of(case, degrees, seed=1)
        for name, run in METHODS.items():
            ms, T_found, verdict = timed(run, case.reference, case.reading, guess.T_map_base, guess.covariance)
            found[name].append(Answer(ms, *errors(case.T_map_base, T_found), verdict in (SURE, "degenerate")))
    return [[world, degrees, SHIFT_M[degrees], name, *scores(answers)] for name, answers in found.items()]


def scores(answers: Sequence[Answer]) -> list[object]:
    """Percent right and wrong, median error of the right ones, median time."""
    right = [a for a in answers if a.sure and a.near]
    off = [f"{np.median(e):.2f}" if e else "-" for e in ([100.0 * a.metres for a in right], [a.degrees for a in right])]
    shares = [share([a.sure and a.near for a in answers]), share([a.sure and not a.near for a in answers])]
    return [*shares, *off, float(np.median([a.milliseconds for a in answers]))]


def real_cloud(path: Path) -> PointCloud:
    """A real scan without the car that carried the scanner."""
    points = np.asarray(o3d.io.read_point_cloud(path).points)
    points = points[np.linalg.norm(points, axis=1) > VEHICLE_M]
    return PointCloud(points, np.zeros_like(points))


def real_pair(folder: Path) -> list[list[object]]:
    """Rows of the real room: each method from no guess, against itself from the known one."""
    reference, reading = (real_cloud(folder / f"room_scan{k}.pcd") for k in (1, 2))
    rows: list[list[object]] = []
    for name, run in (METHODS | {"ours": ours(RegistrationConfig(max_contradiction=MOVING_THINGS))}).items():
        from_nothing = timed(run, reference, reading, np.eye(4), None)
        from_known = timed(run, reference, reading, T_REAL_GUESS, None)
        metres, degrees = errors(from_known[1], from_nothing[1])
        rows.append([name, from_nothing[0], from_known[0], f"{100 * metres:.2f}", f"{degrees:.3f}", f"{from_nothing[2]}, {from_known[2]}"])
    return rows


def main() -> int:
    parser = argument_parser(__doc__)
    parser.add_argument("--worlds", nargs="+", default=list(BUILT_IN))
    parser.add_argument("--classes", nargs="+", type=int, choices=SHIFT_M, default=[20, 45, 180], metavar="DEG")
    parser.add_argument("--pairs", type=int, default=10, metavar="N")
    parser.add_argument("--data", type=Path, metavar="FOLDER")
    options = parser.parse_args()
    if options.pairs:
        simulated("rooms", 20, 1, options.cache)  # compiles what is to be compiled
    rows = [r for w in options.worlds for degrees in options.classes for r in simulated(w, degrees, options.pairs, options.cache)]
    print(text_table(HEADER, rows))
    there = options.data is not None and all((options.data / f"room_scan{k}.pcd").is_file() for k in (1, 2))
    real = real_pair(options.data) if there else []
    print("\n" + text_table(REAL_HEADER, real) if real else "\nroom_scan1.pcd and room_scan2.pcd are absent: no real pair")
    write_json(options.json, {"simulated": rows, "simulated_columns": HEADER, "real": real, "real_columns": REAL_HEADER})
    return 0


if __name__ == "__main__":
    sys.exit(main())
