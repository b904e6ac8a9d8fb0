"""The scores of a run: what its map covers, how far map and trajectory are off, and what happened to the robot.

Second step of the judge. Truth (mesh, reachable ground, poses, contacts) comes in beside the estimate; nothing here
knows how either was made. The map frame is brought into the world by whole poses, not by positions alone, so that a
run of few sweeps or along one line is aligned as well.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from exploration_evaluation.mesh import RayScene, checked_mesh
from exploration_evaluation.relative_error import checked_poses, matched_poses, rms
from rigid_geometry import inverse, tilt_angle, transform_points

Floats = NDArray[np.float64]

# Arms this long along the axes of every pose take part in the alignment of the map: a radian weighs as much as a metre.
_LEVER_ARMS = np.vstack([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
_DISTANCE_STEP_S = 0.2
_JITTER_M = 0.001
_FALL_WINDOW_S = 0.1
_FALL_TILT_RAD = 0.87  # tilt of the body beyond which it has fallen
_FALL_SPEED_MPS = 1.5  # downward speed beyond which the body falls (0.11 m of free fall)
_CLOUD_POINTS = 400_000  # of the cloud that are measured against the true mesh
COVERED_HORIZONTAL_M = 0.12  # farthest mapped voxel, along x or y, that covers a cell of ground
COVERED_VERTICAL_M = 0.10  # the same along z


@dataclass(frozen=True)
class MapError:
    """Distances of the map's points to the true surface (accuracy)."""

    rms_m: float
    p95_m: float


@dataclass(frozen=True)
class TrajectoryErrors:
    """Estimated against true poses at the same stamps, and the transform that takes the map to the world.

    ate_rms_m: RMS of the position errors after rigid alignment of all positions (evo's `-a`). origin_rms_m: the same,
    aligned at the first pose only. map_tilt_rad: angle between the map's up and gravity, as `T_world_map` (best fit of all poses)
    has it; map_tilt_origin_rad: as the first pose has it. unmatched poses have no truth at their stamp.
    """

    ate_rms_m: float
    origin_rms_m: float
    map_tilt_rad: float
    map_tilt_origin_rad: float
    T_world_map: Floats
    unmatched: int


@dataclass(frozen=True)
class ContactEpisode:
    """One collision: all contacts without a longer pause."""

    top_speed_mps: float
    top_force_n: float


@dataclass(frozen=True)
class Motion:
    """What the body did, from the true poses."""

    distance_m: float
    max_tilt_rad: float
    fell: bool


def covered_cells(
    ground: ArrayLike, voxels: ArrayLike, horizontal_m: float = COVERED_HORIZONTAL_M, vertical_m: float = COVERED_VERTICAL_M
) -> NDArray[np.bool_]:
    """(N,) whether each (N, 3) cell of ground has one of the (K, 3) mapped voxels' centres near it.

    Near is a box: at most `horizontal_m` away in x and in y, at most `vertical_m` in z. Both in the world frame.
    """
    cells, centres = _points(ground, "ground"), _points(voxels, "voxels")
    if not (horizontal_m > 0 and vertical_m > 0):
        raise ValueError(f"tolerances are positive, not {horizontal_m} and {vertical_m} m")
    if not len(centres):
        return np.zeros(len(cells), dtype=np.bool_)
    unit = np.array([horizontal_m, horizontal_m, vertical_m])
    distance, _ = cKDTree(centres / unit).query(cells / unit, p=np.inf, distance_upper_bound=1.0 + 1e-6)
    return np.asarray(np.isfinite(distance))


def coverage(
    ground: ArrayLike, voxels: ArrayLike, horizontal_m: float = COVERED_HORIZONTAL_M, vertical_m: float = COVERED_VERTICAL_M
) -> float:
    """Share of the (N, 3) cells of ground that the map's (K, 3) occupied voxels cover (see `covered_cells`).

    ValueError without ground: a share of nothing is not known.
    """
    covered = covered_cells(ground, voxels, horizontal_m, vertical_m)
    if not len(covered):
        raise ValueError("coverage needs at least one cell of reachable ground, got none")
    return float(covered.mean())


def map_error(cloud_world: ArrayLike, vertices: ArrayLike, triangles: ArrayLike, max_points: int = _CLOUD_POINTS) -> MapError:
    """Distances from the (N, 3) points of a map to the true mesh; a larger cloud is thinned to evenly spaced points."""
    cloud = _points(cloud_world, "cloud")
    if not len(cloud):
        raise ValueError("the map's error needs at least one point, got none")
    chosen = np.unique(np.linspace(0, len(cloud) - 1, min(len(cloud), max_points)).round().astype(np.int64))
    distance = RayScene(*checked_mesh(vertices, triangles)).distances(cloud[chosen])
    return MapError(rms(distance), float(np.percentile(distance, 95)))


def align_positions(estimate: ArrayLike, truth: ArrayLike) -> Floats:
    """The rigid T_truth_estimate that brings (N, 3) positions nearest to (N, 3) others (Umeyama 1991, without scale).

    Where the positions leave a rotation open (one of them, or a line) any of the best is returned.
    """
    a, b = _points(estimate, "estimate"), _points(truth, "truth")
    if len(a) != len(b) or not len(a):
        raise ValueError(f"an alignment needs as many estimated as true positions and at least one, not {len(a)} and {len(b)}")
    mean_a, mean_b = a.mean(axis=0), b.mean(axis=0)
    U, _, Vt = np.linalg.svd((b - mean_b).T @ (a - mean_a))
    R = U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U) * np.linalg.det(Vt))]) @ Vt
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, mean_b - R @ mean_a
    return T


def align_poses(T_map_base: ArrayLike, T_world_base: ArrayLike) -> Floats:
    """The rigid T_world_map that brings (N, 4, 4) estimated poses nearest to the true ones, orientations included."""
    estimate, truth = checked_poses(T_map_base), checked_poses(T_world_base)
    return align_positions(_lever_arm_points(estimate), _lever_arm_points(truth))


def trajectory_errors(stamps: ArrayLike, T_est: ArrayLike, stamps_truth: ArrayLike, T_truth: ArrayLike) -> TrajectoryErrors:
    """Errors of (N, 4, 4) estimated poses in the map frame against (M, 4, 4) true ones in the world frame.

    Stamps are seconds; true ones increase, and truth is interpolated between them. ValueError when no stamp has a truth.
    """
    matched = matched_poses(stamps, T_est, stamps_truth, T_truth)
    poses, true_poses = matched.estimate, matched.truth
    T_world_map = align_poses(poses, true_poses)
    T_origin = true_poses[0] @ inverse(poses[0])
    return TrajectoryErrors(
        ate_rms_m=_position_rms(align_positions(poses[:, :3, 3], true_poses[:, :3, 3]), poses, true_poses),
        origin_rms_m=_position_rms(T_origin, poses, true_poses),
        map_tilt_rad=tilt_angle(T_world_map),
        map_tilt_origin_rad=tilt_angle(T_origin),
        T_world_map=T_world_map,
        unmatched=matched.unmatched,
    )


def contact_episodes(stamps: ArrayLike, speeds_mps: ArrayLike, forces_n: ArrayLike, gap_s: float) -> tuple[ContactEpisode, ...]:
    """Collisions in order of time: contacts of any links belong together until a pause longer than `gap_s`."""
    at, speeds, forces = (np.asarray(v, dtype=np.float64) for v in (stamps, speeds_mps, forces_n))
    if not len(at) == len(speeds) == len(forces):
        raise ValueError(f"contacts differ in length: {len(at)} stamps, {len(speeds)} speeds, {len(forces)} forces")
    if not len(at):
        return ()
    order = np.argsort(at, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(at[order]) > gap_s) + 1)
    return tuple(ContactEpisode(float(speeds[g].max()), float(forces[g].max())) for g in groups)


def motion(stamps: ArrayLike, T_world_base: ArrayLike) -> Motion:
    """Distance, tilt and falls from (M, 4, 4) true poses at (M,) increasing stamps.

    Distance is summed over fifths of a second and without the tremble of a standing robot. A fall is a tilt, or a downward
    speed over a tenth of a second, beyond its limit.
    """
    at, poses = np.asarray(stamps, dtype=np.float64), checked_poses(T_world_base)
    if len(at) != len(poses) or not len(at):
        raise ValueError(f"every true pose needs a stamp and there is at least one: {len(at)} stamps, {len(poses)} poses")
    steps = np.linalg.norm(np.diff(poses[_every(at, _DISTANCE_STEP_S), :3, 3], axis=0), axis=1)
    tilt = float(np.arccos(np.clip(poses[:, 2, 2], -1.0, 1.0)).max())
    speed = _top_fall_speed(at, poses[:, 2, 3])
    return Motion(float(steps[steps > _JITTER_M].sum()), tilt, tilt > _FALL_TILT_RAD or speed > _FALL_SPEED_MPS)


def divided_voxels(centres: ArrayLike, sizes: ArrayLike, resolution_m: float) -> Floats:
    """(M, 3) centres of voxels of one size from (N, 3) leaves of an octree and their (N,) edge lengths, pruned ones divided."""
    leaves, edges = _points(centres, "centres"), np.asarray(sizes, dtype=np.float64)
    if edges.shape != (len(leaves),):
        raise ValueError(f"{len(leaves)} voxels need as many sizes, not {edges.shape}")
    parts = np.maximum(1, np.rint(edges / resolution_m)).astype(np.int64)
    out = [np.empty((0, 3))]
    for count in np.unique(parts):
        offset = (np.arange(count) - 0.5 * (count - 1)) * resolution_m
        block = np.stack(np.meshgrid(offset, offset, offset, indexing="ij"), axis=-1).reshape(-1, 3)
        out.append((leaves[parts == count][:, None, :] + block).reshape(-1, 3))
    return np.vstack(out)


def _points(values: ArrayLike, name: str) -> Floats:
    points = np.asarray(values, dtype=np.float64)
    if points.size == 0:
        return np.empty((0, 3))
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise ValueError(f"{name} are finite points of shape (N, 3), not {points.shape}")
    return points


def _position_rms(T_world_map: Floats, poses: Floats, true_poses: Floats) -> float:
    return rms(np.linalg.norm(transform_points(T_world_map, poses[:, :3, 3]) - true_poses[:, :3, 3], axis=1))


def _lever_arm_points(poses: Floats) -> Floats:
    ends: Floats = np.einsum("nij,kj->nki", poses[:, :3, :3], _LEVER_ARMS) + poses[:, None, :3, 3]
    return ends.reshape(-1, 3)


def _every(stamps: Floats, step_s: float) -> NDArray[np.int64]:
    """Index of the first stamp in every interval of `step_s`, and of the last stamp."""
    _, first = np.unique(np.floor((stamps - stamps[0]) / step_s + 1e-6), return_index=True)
    return np.unique(np.append(first, len(stamps) - 1))


def _top_fall_speed(stamps: Floats, z: Floats) -> float:
    later = np.searchsorted(stamps, stamps + _FALL_WINDOW_S - 1e-6)
    inside = later < len(stamps)
    if not inside.any():
        return 0.0
    dropped = z[inside] - z[later[inside]]
    return float(max(0.0, (dropped / (stamps[later[inside]] - stamps[inside])).max()))


def trajectory_scores(errors: TrajectoryErrors | None) -> dict[str, float | None]:
    """What the summary says of them; None where they are not known."""
    return {
        "trajectory_ate_m": errors.ate_rms_m if errors else None,
        "trajectory_origin_error_m": errors.origin_rms_m if errors else None,
        "map_tilt_rad": errors.map_tilt_rad if errors else None,
        "map_tilt_origin_rad": errors.map_tilt_origin_rad if errors else None,
        "unmatched_poses": errors.unmatched if errors else None,
    }
