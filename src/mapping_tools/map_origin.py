"""Where the map's own frame lies in a frame that is far away, as map coordinates (UTM) are.

Float32 tells 0.06 mm apart within a kilometre and half a metre at five thousand. So what is far is brought near in float64, by whole
metres, and the origin is written beside the results.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pose_graph_mapping.session.session_files import write_atomically

Array = NDArray[np.float64]

ORIGIN = "map_origin.json"
FAR_M = 1000.0


def origin_near(xyz: ArrayLike) -> Array:
    """(3,) where to put the origin of what lies around xyz (3,): nowhere else within a kilometre, else there, by whole metres."""
    place = np.asarray(xyz, dtype=np.float64)
    return np.round(place) if np.abs(place).max() > FAR_M else np.zeros(3)


def origin_text(origin: Array) -> str:
    """What is said of an origin that is not 0 0 0."""
    x, y, z = (f"{v:.0f}" for v in origin)
    return f"all results are relative to the origin {x} {y} {z} m"


class MapOrigin:
    """The origin of a session folder: that of its file, or of the first pose that is asked about, and then written there."""

    def __init__(self, folder: Path, *, goes_on: bool = False) -> None:
        """goes_on: a session without the file has its origin at 0 0 0. ValueError when the file cannot be read."""
        self._path = folder / ORIGIN
        self._known: Array | None = np.zeros(3) if goes_on else None
        if self._path.is_file():
            self._known = _stored(self._path)

    @property
    def xyz(self) -> Array:
        """(3,); 0 0 0 as long as it is not known."""
        return np.zeros(3) if self._known is None else self._known

    def is_far(self) -> bool:
        return bool(self.xyz.any())

    def relative(self, T_far: Array) -> Array:
        """(4, 4) the pose, relative to the origin. The first pose makes it; OSError when it cannot be written."""
        if self._known is None:
            self._known = origin_near(T_far[:3, 3])
            if self.is_far():
                write_atomically(self._path, (json.dumps({"origin_m": self._known.tolist()}) + "\n").encode("ascii"))
        T = np.array(T_far, dtype=np.float64)
        T[:3, 3] -= self.xyz
        return T


def _stored(path: Path) -> Array:
    try:
        origin = np.array(json.loads(path.read_text(encoding="utf-8"))["origin_m"], dtype=np.float64)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path.name} cannot be read: {error}") from error
    if origin.shape != (3,) or not np.isfinite(origin).all():
        raise ValueError(f"{path.name}: origin_m is not three finite numbers")
    return origin
