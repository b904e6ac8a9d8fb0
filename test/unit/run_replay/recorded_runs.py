"""Small run folders with a known truth: a robot that drives 4 m along the world's x and sweeps a wall every metre."""

import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pose_graph_mapping.graph.pose_graph import EdgeKind, PoseGraph
from pose_graph_mapping.session.session_store import SessionStore, ply_bytes, tum_text
from rigid_geometry import inverse, transform_from_rpy, transform_points

Floats = NDArray[np.float64]

SPEED_MPS = 0.5
FIRST_S, LAST_S = 1.0, 9.0
SWEEP_STAMPS_S = np.array([1.0, 3.0, 5.0, 7.0, 9.0])
T_WORLD_MAP = transform_from_rpy((2.0, 1.0, 0.132), (0.0, 0.0, 0.7))


def true_poses(stamps_s: Floats) -> Floats:
    """(N, 4, 4) T_world_base."""
    return np.stack([T_WORLD_MAP @ transform_from_rpy((SPEED_MPS * (t - FIRST_S), 0.0, 0.0)) for t in stamps_s])


def wall_world() -> Floats:
    """(N, 3) points of a wall that is seen from everywhere, in the world frame."""
    y, z = np.meshgrid(np.arange(-1.0, 1.0, 0.1), np.arange(0.0, 1.0, 0.1))
    return np.column_stack([np.full(y.size, 8.0), y.ravel(), z.ravel()])


def write_run(folder: Path, T_world_map: Floats = T_WORLD_MAP, world: str = "rooms") -> Path:
    """A complete run with a perfect map, in a map frame of its own."""
    T_world_base = true_poses(SWEEP_STAMPS_S)
    store, graph = SessionStore(folder), PoseGraph()
    for k, T in enumerate(T_world_base):
        points = transform_points(inverse(T), wall_world())
        store.add_sweep(k, SWEEP_STAMPS_S[k], points, np.zeros_like(points))
        graph.add_vertex(inverse(T_world_map) @ T)
        if k:
            graph.add_edge(k - 1, k, inverse(T_world_base[k - 1]) @ T, np.eye(6) * 1e-4, EdgeKind.MATCH)
    store.save(graph)
    every_tick = np.arange(FIRST_S, LAST_S + 1e-9, 0.05)
    (folder / "trajectory_truth.txt").write_text(tum_text(every_tick, true_poses(every_tick)))
    (folder / "run.json").write_text(json.dumps({"world": world, "seed": 1}))
    wall = transform_points(inverse(T_world_map), wall_world())
    (folder / "cloud.ply").write_bytes(ply_bytes(wall))
    x, y, z = (np.indices((3, 4, 1)).reshape(3, -1) * 0.08 + 0.04).astype(np.float32)
    np.savez(folder / "terrain.npz", x=x, y=y, z=z, label=(np.arange(len(x)) % 5).astype(np.uint8))
    np.savez(folder / "occupied.npz", centers=np.stack([x, y, z], axis=1), sizes=np.full(len(x), 0.08, np.float32))
    return folder
