"""An origin near what lies far away, as map coordinates (UTM) do.

Float32 tells 0.06 mm apart within a kilometre, and half a metre at five thousand. So what is far is brought near in float64, by whole
metres, and the origin is written beside the results.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

FAR_M, FARTHEST_M = 1000.0, 1e8  # UTM's northings go to 1e7
_TOLD_APART_M = 0.01


def origin_near(xyz: ArrayLike) -> Array:
    """(3,) where to put the origin of what lies around xyz (3,), by whole metres: there, if that is far away and on earth, else 0 0 0."""
    place = np.asarray(xyz, dtype=np.float64)
    return np.round(place) if FAR_M < np.abs(place).max() <= FARTHEST_M else np.zeros(3)


def lost_digits_m(points: ArrayLike, unit_m: float = 1.0) -> float | None:
    """How far apart (N, 3) points are told, in metres, when float32 rounded them to more than a centimetre; else None.

    unit_m: metres a unit of the points. Points that were never float32, and are all multiples of that, are told by nobody from such ones.
    """
    known = np.asarray(points, dtype=np.float64)
    known = known[np.isfinite(known).all(axis=1)]
    if not len(known) or unit_m * np.abs(known).max() > FARTHEST_M:
        return None
    apart = unit_m * float(np.spacing(np.float32(np.abs(known).max())))
    return apart if apart > _TOLD_APART_M and (known == known.astype(np.float32)).all() else None


def origin_text(origin: ArrayLike, of: str = "all results") -> str:
    """What is said of an origin that is not 0 0 0, and of what is relative to it."""
    x, y, z = (f"{v:.0f}" for v in np.asarray(origin))
    return f"{of} are relative to the origin {x} {y} {z} m"


def origin_bytes(origin: ArrayLike) -> bytes:
    """The file of an origin, JSON."""
    return (json.dumps({"origin_m": np.asarray(origin, dtype=np.float64).tolist()}) + "\n").encode("ascii")


def read_origin(path: Path) -> Array:
    """(3,) the origin of a file; ValueError when it cannot be read."""
    try:
        origin = np.array(json.loads(path.read_text(encoding="utf-8"))["origin_m"], dtype=np.float64)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path}: cannot be read: {error}") from error
    if origin.shape != (3,) or not np.isfinite(origin).all():
        raise ValueError(f"{path}: origin_m is not three finite numbers")
    return origin
