"""Planes as large as the robot: their slope is known better than a fit to a hand's breadth tells, and no edge on them is a step.

Asked by the third step of `terrain.classify` and by its flood of what seems a step, too steep or nearly so. Everything is in voxels.
"""

from typing import Any

import numpy as np

from octomap_server_3dnav.octree.lean_kernels import lean_njit
from octomap_server_3dnav.terrain.surface_columns import find_node

_HALF = 5  # columns from the middle of a plane to its sides
_ASIDE = 4  # columns by which the middle may lie beside a node
_COVERED = 0.8  # of its columns have ground there
_FLAT = 0.05  # root mean square of what ground may lie off its plane
_FORM = 0.3  # of what the ground lies off its plane a curved surface may explain; more is no noise
_REACH = 2  # how far off a plane that was guessed from a fit its ground is looked for
_FAR = 1.5  # and where it lies so far off, the guess was none of a plane
_CURVED = (np.arange(-_HALF, _HALF + 1) ** 2).mean()  # mean of x * x over a plane


@lean_njit
def _off(surfaces: Any, ny: Any, s: Any, dx: Any, dy: Any, gradient: Any) -> Any:
    """By how much the ground in the column at dx, dy from that of node s is higher than a plane of this gradient through s; NaN where none
    is measured near it."""
    rise = gradient[0] * dx + gradient[1] * dy
    guess = np.int64(np.floor(surfaces.slope_level[s] + rise))
    n = find_node(surfaces.start, surfaces.z, np.int64(surfaces.column[s]) + dx * ny + dy, guess, _REACH)
    if n < 0 or not surfaces.measured[n]:
        return np.nan
    return np.float64(surfaces.slope_level[n]) - surfaces.slope_level[s] - rise


@lean_njit
def _is_noise(surfaces: Any, ny: Any, s: Any, x0: Any, y0: Any, gradient: Any, height: Any, square: Any) -> Any:
    """Whether what the ground around the column at x0, y0 lies off a plane, `square` in sum, is not the form of a curved surface.

    The plane has this gradient and lies `height` higher than node s in the middle.
    """
    xx, xy, yy = 0.0, 0.0, 0.0
    sxx, sxy, syy = 1e-9, 1e-9, 1e-9
    for x in range(-_HALF, _HALF + 1):
        for y in range(-_HALF, _HALF + 1):
            h = _off(surfaces, ny, s, x0 + x, y0 + y, gradient)
            if np.isnan(h):
                continue
            h -= height
            a, b, c = x * x - _CURVED, x * y, y * y - _CURVED
            xx, xy, yy = xx + a * h, xy + b * h, yy + c * h
            sxx, sxy, syy = sxx + a * a, sxy + b * b, syy + c * c
    return xx * xx / sxx + xy * xy / sxy + yy * yy / syy <= _FORM * square


@lean_njit
def _plane_slope(surfaces: Any, ny: Any, s: Any, x0: Any, y0: Any, gradient: Any) -> Any:
    """Slope of the plane around the column at x0, y0 from that of node s; NaN where the ground is none.

    `gradient` is about that of the ground there.
    """
    n, sx, sy, sz = 0, 0, 0, 0.0
    sxx, syy, sxy, sxz, syz, szz = 0, 0, 0, 0.0, 0.0, 0.0
    lacking = (1.0 - _COVERED) * (2 * _HALF + 1) ** 2
    for x in range(-_HALF, _HALF + 1):
        for y in range(-_HALF, _HALF + 1):
            h = _off(surfaces, ny, s, x0 + x, y0 + y, gradient)
            if np.isnan(h):
                lacking -= 1.0
                if lacking < 0.0:
                    return np.nan
                continue
            if abs(h) > _FAR:
                return np.nan
            n, sx, sy, sz = n + 1, sx + x, sy + y, sz + h
            sxx, syy, sxy, sxz, syz, szz = sxx + x * x, syy + y * y, sxy + x * y, sxz + x * h, syz + y * h, szz + h * h
    a, b, c = sxx - sx * sx / n, syy - sy * sy / n, sxy - sx * sy / n
    p, q = sxz - sx * sz / n, syz - sy * sz / n
    det = a * b - c * c
    u, v = (b * p - c * q) / det, (a * q - c * p) / det
    square = szz - sz * sz / n - u * p - v * q
    if square > n * _FLAT**2:
        return np.nan
    plane = gradient[0] + u, gradient[1] + v
    height = (sz - u * sx - v * sy) / n - u * x0 - v * y0
    return np.hypot(plane[0], plane[1]) if _is_noise(surfaces, ny, s, x0, y0, plane, height, square) else np.nan


@lean_njit
def is_gentle_plane(surfaces: Any, ny: Any, s: Any, gradient: Any, max_slope: Any) -> Any:
    """Whether node s and those beside it lie on a plane that is not steeper than `max_slope`; `gradient` is about that of the ground."""
    for x0 in range(-_ASIDE, _ASIDE + 1, _ASIDE):
        for y0 in range(-_ASIDE, _ASIDE + 1, _ASIDE):
            if _plane_slope(surfaces, ny, s, x0, y0, gradient) <= max_slope:
                return True
    return False
