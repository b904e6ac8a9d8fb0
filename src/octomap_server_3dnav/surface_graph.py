"""The navigation graph on the surfaces: which neighbour the robot can step to, and how steep the ground is (thesis 5.5, 5.5.1).

Second step of `terrain.classify`. Heights of voxels lie: a flat floor alternates between two layers, a ramp is a staircase. A single
edge is therefore never judged alone: a step compares the mean heights of the patches on both sides of it, a slope is a plane fitted to
all ground within the footprint that straight lines over accepted edges reach.
"""

from typing import Any

import numpy as np
from numba import njit

from octomap_server_3dnav.surface_columns import DX, DY, find_node


@njit(cache=True)
def nearest_neighbours(start: Any, column: Any, z: Any, nx: Any, ny: Any, step: Any) -> Any:
    """(N, 4) int32 node of each neighbouring column within `step` voxels in height, -1 where there is none."""
    out = np.full((z.size, 4), -1, np.int32)
    for s in range(z.size):
        ix, iy = column[s] // ny, column[s] % ny
        for k in range(4):
            jx, jy = ix + DX[k], iy + DY[k]
            if 0 <= jx < nx and 0 <= jy < ny:
                out[s, k] = find_node(start, z, jx * ny + jy, np.int64(z[s]), step)
    return out


@njit(cache=True)
def _patch_mean(near: Any, z: Any, s: Any, k: Any) -> Any:
    """Mean height of s, the node beyond it in direction k, and the neighbours aside of both, where they exist."""
    total, count = 0.0, 0
    row = s
    for _ in range(2):
        total += z[row]
        count += 1
        for side in (1, 3):
            aside = near[row, (k + side) % 4]
            if aside >= 0:
                total += z[aside]
                count += 1
        row = near[row, k]
        if row < 0:
            break
    return total / count


@njit(cache=True)
def steppable_neighbours(near: Any, z: Any, max_step: Any) -> Any:
    """`near` without the edges over which the mean ground rises or falls by more than `max_step` (float voxels).

    Where a column has two surfaces, `near` need not lead back: each way is judged on its own.
    """
    out = near.copy()
    for s in range(z.size):
        for k in range(4):
            n = near[s, k]
            if n >= 0 and z[n] != z[s] and abs(_patch_mean(near, z, n, k) - _patch_mean(near, z, s, (k + 2) % 4)) > max_step:
                out[s, k] = -1
    return out


@njit(cache=True)
def diagonal(graph: Any, s: Any, k: Any) -> Any:
    """Node diagonally between directions k and k + 1, -1 unless both ways round its corner are open and lead to it."""
    a, b = graph[s, k], graph[s, (k + 1) % 4]
    if a < 0 or b < 0 or graph[a, (k + 1) % 4] != graph[b, k]:
        return -1
    return graph[a, (k + 1) % 4]


@njit(cache=True)
def slope_at(graph: Any, z: Any, s: Any, reach: Any) -> Any:
    """Tangent of the steepest slope of the plane fitted to the ground around s, out to `reach` voxels."""
    n, sx, sy, sz, sxx, syy, sxy, sxz, syz = 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for ray in range(8):
        k = ray % 4
        is_diagonal = ray >= 4
        dx = DX[k] + (DX[(k + 1) % 4] if is_diagonal else 0)
        dy = DY[k] + (DY[(k + 1) % 4] if is_diagonal else 0)
        steps = int(round(reach / np.sqrt(2.0))) if is_diagonal else int(reach)
        node = s
        for j in range(1, steps + 1):
            node = diagonal(graph, node, k) if is_diagonal else graph[node, k]
            if node < 0:
                break
            x, y, h = float(j * dx), float(j * dy), float(z[node]) - float(z[s])
            n, sx, sy, sz = n + 1, sx + x, sy + y, sz + h
            sxx, syy, sxy, sxz, syz = sxx + x * x, syy + y * y, sxy + x * y, sxz + x * h, syz + y * h
    # A weak pull to level (0.5) keeps the plane defined where all ground lies on one line.
    a, b, c = sxx - sx * sx / n + 0.5, syy - sy * sy / n + 0.5, sxy - sx * sy / n
    p, q = sxz - sx * sz / n, syz - sy * sz / n
    det = a * b - c * c
    return np.hypot((b * p - c * q) / det, (a * q - c * p) / det)
