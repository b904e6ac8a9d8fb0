"""What is seen from where: lines of sight from the laser over the ground to places of floor that was not seen.

For `tour`. A line is blocked by an occupied voxel of the map; what was never seen blocks nothing.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.terrain.classified_terrain import Terrain

_NEAR_END = 3  # voxels at both ends of a line that do not block it: the ground rises to the place, and the laser's own

_ABOVE = 2.0  # voxels that the laser must be above a floor to see it


@njit(cache=True)
def _sight(columns: Any, eyes: Any, targets: Any, from_above: Any, reach: Any, clear: Any) -> Any:
    """(E, T) bool `clear`: whether no voxel stands between eyes (E, 3) and targets (T, 3), in voxels of the window, within `reach`.

    A target (T,) `from_above` is seen by eyes above it only.
    """
    for e in range(len(eyes)):
        for t in range(len(targets)):
            dx, dy, dz = targets[t, 0] - eyes[e, 0], targets[t, 1] - eyes[e, 1], targets[t, 2] - eyes[e, 2]
            if dx * dx + dy * dy > reach * reach or (from_above[t] and dz > -_ABOVE):
                continue
            steps = int(max(abs(dx), abs(dy), abs(dz)))
            clear[e, t] = True
            for i in range(_NEAR_END, steps - _NEAR_END + 1):
                f = i / steps
                x, y = int(np.floor(eyes[e, 0] + f * dx)), int(np.floor(eyes[e, 1] + f * dy))
                if not (0 <= x < columns.nx and 0 <= y < columns.ny):
                    continue
                z, c = int(np.floor(eyes[e, 2] + f * dz)), x * columns.ny + y
                for r in range(columns.start[c], columns.start[c + 1]):
                    if columns.occupied[r] and columns.z_lo[r] <= z <= columns.z_hi[r]:
                        clear[e, t] = False
                        break
                if not clear[e, t]:
                    break
    return clear


def seen_distances(
    terrain: Terrain, eyes_xyz: NDArray[np.floating], targets_xyz: NDArray[np.floating], from_above: NDArray[np.bool_], reach_m: float
) -> NDArray[np.float64]:
    """(E, T) metres, seen from above, from eyes (E, 3) to targets (T, 3) in map; inf beyond the reach, and where something stands between.

    Targets (T,) `from_above`, the edge of a deck, are not seen from below it.
    """
    low = np.array([*terrain.window_key, 0], dtype=np.float64)
    eyes, targets = (np.asarray(xyz, dtype=np.float64) / terrain.resolution - low for xyz in (eyes_xyz, targets_xyz))
    blank = np.zeros((len(eyes), len(targets)), dtype=np.bool_)
    clear = _sight(terrain.columns, eyes, targets, from_above, reach_m / terrain.resolution, blank)
    away = np.hypot(*(eyes[:, None, :2] - targets[None, :, :2]).transpose(2, 0, 1)) * terrain.resolution
    return np.where(clear, away, np.inf)
