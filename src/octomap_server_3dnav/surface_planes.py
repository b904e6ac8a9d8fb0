"""Planes as large as the robot: their slope is known better than a fit to a hand's breadth tells, and no edge on them is a step.

Asked by the third step of `terrain.classify` and by its flood of what seems a step, too steep or nearly so. Everything is in voxels.
"""

from typing import Any

import numpy as np

from octomap_server_3dnav.lean_kernels import lean_njit
from octomap_server_3dnav.surface_columns import find_node

_HALF = 5  # columns from the middle of a plane to its sides
_ASIDE = 4  # columns by which the middle may lie beside a node
_COVERED = 0.8  # of its columns have ground there
_FLAT = 0.05  # root mean square of what ground may lie off its plane
_REACH = 2  # how far off a plane that was guessed from a fit its ground is looked for


@lean_njit
def _plane_slope(surfaces: Any, ny: Any, s: Any, x0: Any, y0: Any, gradient: Any) -> Any:
    """Slope of the plane around the column (x0, y0) from that of node s; NaN where the ground is none.

    `gradient` is about that of the ground there.
    """
    count, known = (2 * _HALF + 1) ** 2, 0
    sx, sy, sz, sxx, syy, sxy, sxz, syz, szz = 0, 0, 0.0, 0, 0, 0, 0.0, 0.0, 0.0
    for dx in range(x0 - _HALF, x0 + _HALF + 1):
        for dy in range(y0 - _HALF, y0 + _HALF + 1):
            rise = gradient[0] * dx + gradient[1] * dy
            guess = np.int64(np.floor(surfaces.slope_level[s] + rise))
            n = find_node(surfaces.start, surfaces.z, np.int64(surfaces.column[s]) + dx * ny + dy, guess, _REACH)
            if n < 0 or not surfaces.measured[n]:
                continue
            h = surfaces.slope_level[n] - surfaces.slope_level[s] - rise
            x, y = dx - x0, dy - y0
            known, sx, sy, sz = known + 1, sx + x, sy + y, sz + h
            sxx, syy, sxy, sxz, syz, szz = sxx + x * x, syy + y * y, sxy + x * y, sxz + x * h, syz + y * h, szz + h * h
    if known < _COVERED * count:
        return np.nan
    a, b, c = sxx - sx * sx / known, syy - sy * sy / known, sxy - sx * sy / known
    p, q, r = sxz - sx * sz / known, syz - sy * sz / known, szz - sz * sz / known
    det = a * b - c * c
    u, v = (b * p - c * q) / det, (a * q - c * p) / det
    if r - u * p - v * q > known * _FLAT**2:
        return np.nan
    return np.hypot(gradient[0] + u, gradient[1] + v)


@lean_njit
def is_gentle_plane(surfaces: Any, ny: Any, s: Any, gradient: Any, max_slope: Any) -> Any:
    """Whether node s and those beside it lie on a plane that is not steeper than `max_slope`; `gradient` is about that of the ground."""
    for x0 in range(-_ASIDE, _ASIDE + 1, _ASIDE):
        for y0 in range(-_ASIDE, _ASIDE + 1, _ASIDE):
            if _plane_slope(surfaces, ny, s, x0, y0, gradient) <= max_slope:
                return True
    return False
