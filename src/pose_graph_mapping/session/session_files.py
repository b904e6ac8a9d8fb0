"""Files of a session: sweeps that check themselves, and clouds and trajectories in formats that others open."""

from __future__ import annotations

import io
import json
import zipfile
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pose_graph_mapping.registration.cloud import PointCloud
from pose_graph_mapping.session.session_record import SweepEntry
from rigid_geometry import quat_xyzw_from_transform

Array = NDArray[np.float64]


def sweep_bytes(cloud: PointCloud, stamp_s: float, record: str, free: PointCloud | None = None) -> bytes:
    """The file (npz) of a sweep: points and origins (N, 3) float32, stamp_s, and the text that its line in the index repeats.

    With `free`, too, the beams that met nothing: free_points (M, 3), where they were followed to, and free_origins.
    """
    arrays: dict[str, Any] = {"stamp_s": np.float64(stamp_s), "record": np.frombuffer(record.encode("ascii"), dtype=np.uint8)}
    for prefix, beams in (("", cloud), ("free_", free)):
        if beams is not None:
            assert beams.origins is not None
            arrays[f"{prefix}points"], arrays[f"{prefix}origins"] = beams.points.astype(np.float32), beams.origins.astype(np.float32)
    packed = io.BytesIO()
    np.savez(packed, **arrays)
    return packed.getvalue()


def sweep_clouds(data: bytes) -> tuple[PointCloud, PointCloud | None]:
    """The cloud of `sweep_bytes`, and its beams that met nothing, where it has them; ValueError when they cannot be read."""
    try:
        with np.load(io.BytesIO(data)) as arrays:
            free = PointCloud(arrays["free_points"], arrays["free_origins"]) if "free_points" in arrays else None
            return PointCloud(arrays["points"], arrays["origins"]), free
    except (KeyError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise ValueError(f"it cannot be read: {error}") from error


def recorded_entry(data: bytes, vertex_id: int) -> SweepEntry:
    """The object whose text `sweep_bytes` was given; of a file that has none, the little that it knows of itself.

    ValueError when anything in the file is not whole, by the checksums of its parts.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as parts:
            broken = parts.testzip()
            if broken is not None:
                raise ValueError(f"{broken} in it has changed")
        with np.load(io.BytesIO(data)) as arrays:
            if "record" in arrays:
                entry: SweepEntry = json.loads(bytes(arrays["record"]))
                return entry
            stamp_s, points = float(arrays["stamp_s"]), len(arrays["points"])
            return {"vertex_id": vertex_id, "stamp_s": stamp_s, "points": points, "measured": None, "change": None}
    except (KeyError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise ValueError(f"it cannot be read: {error}") from error


def ply_bytes(points: ArrayLike) -> bytes:
    """A binary PLY of (N, 3) points in metres, as every viewer opens it."""
    rows = np.ascontiguousarray(points, dtype="<f4")
    columns = "".join(f"property float {axis}\n" for axis in "xyz")
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{columns}end_header\n"
    return header.encode("ascii") + rows.tobytes()


def pcd_bytes(points: ArrayLike) -> bytes:
    """A binary PCD 0.7 of (N, 3) points in metres, as PCL's tools open it."""
    rows = np.ascontiguousarray(points, dtype="<f4")
    header = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
        f"WIDTH {len(rows)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(rows)}\nDATA binary\n"
    )
    return header.encode("ascii") + rows.tobytes()


def tum_text(stamps_s: ArrayLike, poses: Array) -> str:
    """A TUM trajectory: one line "stamp x y z qx qy qz qw" a pose (V, 4, 4)."""
    lines = []
    for stamp, T in zip(np.asarray(stamps_s, dtype=np.float64), poses, strict=True):
        numbers = [*T[:3, 3], *quat_xyzw_from_transform(T)]
        lines.append(f"{stamp:.6f} " + " ".join(f"{v:.9f}" for v in numbers))
    return "".join(line + "\n" for line in lines)
