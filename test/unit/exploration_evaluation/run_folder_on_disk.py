"""A small run folder with a known truth: a flat room whose map is shifted and turned against the world."""

import json
from pathlib import Path

import numpy as np
import open3d as o3d
from hand_made_worlds import Mesh, room
from numpy.typing import NDArray

from rigid_geometry import inverse, quat_xyzw_from_transform, transform_from_rpy, transform_points

WORLD: Mesh = room(4, 4)
T_WORLD_MAP = transform_from_rpy((1.0, 1.2, 0.132), (0.0, 0.0, 0.5))
CONTACTS_HEADER = "stamp,link,speed_mps,force_n\n"
EVENTS = """stamp_s,wall_s,state,reason,sweeps
1.000,0.10,sweeping,,0
2.000,0.20,mapping,mapping sweep 1,1
2.000,1.70,driving,goal,1
5.000,2.00,mapping,mapping sweep 2,2
5.000,2.50,finished,explored,2
"""


def true_poses() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Stamps and poses of a drive of 2 m across the room, from the map's origin."""
    stamps = np.arange(1.0, 5.0 + 1e-9, 0.05)
    steps = [transform_from_rpy((0.5 * (t - 1.0), 0, 0)) for t in stamps]
    return stamps, np.stack([T_WORLD_MAP @ step for step in steps])


def floor_in_map() -> NDArray[np.float64]:
    """Occupied voxels of the whole floor, in the map frame."""
    x, y = np.meshgrid(np.arange(0.04, 4, 0.08), np.arange(0.04, 4, 0.08))
    return np.asarray(transform_points(inverse(T_WORLD_MAP), np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])))


def write_tum(path: Path, stamps: NDArray[np.float64], poses: NDArray[np.float64]) -> None:
    """One line a pose: stamp x y z qx qy qz qw."""
    rows = [[t, *T[:3, 3], *quat_xyzw_from_transform(T)] for t, T in zip(stamps, poses, strict=True)]
    path.write_text("".join(" ".join(f"{value:.9f}" for value in row) + "\n" for row in rows))


def write_run(folder: Path) -> Path:
    """A complete run with a perfect map."""
    stamps, poses = true_poses()
    write_tum(folder / "trajectory_truth.txt", stamps, poses)
    write_tum(folder / "trajectory.txt", stamps[::20], inverse(T_WORLD_MAP) @ poses[::20])
    (folder / "contacts.csv").write_text(CONTACTS_HEADER)
    floor = floor_in_map()
    np.savez(folder / "occupied.npz", centers=floor.astype(np.float32), sizes=np.full(len(floor), 0.08, np.float32))
    (folder / "sweeps").mkdir()
    for k, (stamp_s, T) in enumerate(zip(stamps[::20], inverse(T_WORLD_MAP) @ poses[::20], strict=True)):
        points = transform_points(inverse(T), floor).astype(np.float32)
        np.savez(folder / "sweeps" / f"{k:06d}.npz", points=points, origins=0 * points, stamp_s=stamp_s)
    tight = " ".join("10000.0" if row == column else "0.0" for row in range(6) for column in range(row, 6))
    (folder / "graph.g2o").write_text(f"EDGE_SE3:QUAT 0 1 0.5 0 0 0 0 0 1 {tight}\n# KIND 0 1 match\n")
    (folder / "events.csv").write_text(EVENTS)
    x, y, z = floor.astype(np.float32).T
    np.savez(folder / "terrain.npz", x=x, y=y, z=z, label=(np.arange(len(x)) % 5).astype(np.uint8))
    o3d.io.write_point_cloud(str(folder / "cloud.ply"), o3d.geometry.PointCloud(o3d.utility.Vector3dVector(floor)))
    (folder / "map.bt").write_bytes(b"a map")
    (folder / "run.json").write_text(
        json.dumps(
            {
                "world": "rooms",
                "seed": 1,
                "config": {"octomap_server_3dnav_node": {"resolution": 0.08, "crop_half_m": 7.0}},
                "version": "0.1.0",
            }
        )
    )
    counters = {"stop_reason": "explored", "sim_time_s": 300.5, "wall_time_s": 40.0, "loop_closures": 1, "refused_matches": 0}
    counters |= {"local_classifications": 4, "local_classification_time_s": 0.02, "something_else": 7}
    counters |= {"global_classifications": 1, "global_classification_time_s": 0.01}
    (folder / "counters.json").write_text(json.dumps(counters))
    return folder
