"""Where the map of a session lies in odometry's frame, when that is far from its own origin."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import origin_bytes, origin_near, read_origin
from whole_files import write_whole

Array = NDArray[np.float64]

ORIGIN = "map_origin.json"


class MapOrigin:
    """The origin of a session folder: that of its file, or of the first pose that is asked about, and then written there."""

    def __init__(self, folder: Path, *, goes_on: bool = False) -> None:
        """goes_on: a session without the file has its origin at 0 0 0. ValueError when the file cannot be read."""
        self._path = folder / ORIGIN
        self._known: Array | None = np.zeros(3) if goes_on else None
        if goes_on and self._path.is_file():
            self._known = read_origin(self._path)

    @property
    def xyz(self) -> Array:
        """(3,); 0 0 0 as long as it is not known."""
        return np.zeros(3) if self._known is None else self._known

    def relative(self, T_far: Array) -> Array:
        """(4, 4) the pose, relative to the origin. The first pose makes it; OSError when it cannot be written."""
        if self._known is None:
            self._known = origin_near(T_far[:3, 3])
            if self._known.any():
                write_whole(self._path, origin_bytes(self._known))
            else:
                self._path.unlink(missing_ok=True)
        T = np.array(T_far, dtype=np.float64)
        T[:3, 3] -= self.xyz
        return T
