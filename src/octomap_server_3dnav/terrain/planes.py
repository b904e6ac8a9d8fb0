"""Slopes: the largest plane that fits decides (second principle of docs/terrain.md).

Fifth step of `classify`, asked by its flood. Planes are fitted to windows of 11, 5 and 3 columns, 0.88, 0.40 and 0.24 m of voxels of 8 cm:
as large as the robot, as its wheel base, as a wheel. Everything is in voxels.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.lean_kernels import Index, lean_njit
from octomap_server_3dnav.terrain.config import Limits
from octomap_server_3dnav.terrain.graph import Links
from octomap_server_3dnav.terrain.surfaces import Surfaces, find_node

ROBOT, BASE, WHEEL = 5, 2, 1  # half widths of the windows
_COVERED = 0.8  # of a window's columns have ground
_PULL = 0.5  # weight of a level plane in a fit to few columns
_OF_STEP = 0.3  # slope under the wheel base, by the height in voxels of a step in its middle: what inclines less may be a kerb
_REACH = 2  # voxels from where a plane leads in which its surface is looked for


@lean_njit
def diagonal(graph: NDArray[np.int32], s: Index, k: Index) -> Index:
    """Node diagonally between directions k and k + 1, -1 unless both ways round its corner are open and lead to it."""
    a, b = graph[s, k], graph[s, (k + 1) % 4]
    if a < 0 or b < 0 or graph[a, (k + 1) % 4] != graph[b, k]:
        return -1
    return np.int64(graph[a, (k + 1) % 4])


@lean_njit
def _fitted(sums: tuple[float, ...], pull: float) -> tuple[float, float, float]:
    """Rise along x and y of a plane, and the sigma of its slope, by sums over its points.

    These are n, x, y, z, x x, y y, x y, x z, y z, and of the squares of their sigmas.
    """
    n, sx, sy, sz, sxx, syy, sxy, sxz, syz, variance = sums
    a, b, c = sxx - sx * sx / n + pull, syy - sy * sy / n + pull, sxy - sx * sy / n
    p, q = sxz - sx * sz / n, syz - sy * sz / n
    det = a * b - c * c
    return (b * p - c * q) / det, (a * q - c * p) / det, np.sqrt(variance / n / min(a, b))


@lean_njit
def gradients_at(graph: NDArray[np.int32], surfaces: Surfaces, s: Index) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Rise along x and y, and the sigma of the slope, of planes fitted to the ground around node s: within two columns, and within one.

    That is what straight lines of the graph reach.
    """
    dx, dy = (1, 1, 0, -1, -1, -1, 0, 1), (0, 1, 1, 1, 0, -1, -1, -1)
    height, sigma = surfaces.height, surfaces.sigma
    n, sx, sy, sxx, syy, sxy = 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
    sz, sxz, syz, variance = 0.0, 0.0, 0.0, np.float64(sigma[s]) ** 2
    for way in range(12):  # all columns beside, then the next along the axes
        k = way if way < 8 else 2 * (way - 8)
        if way == 8:
            wheel = (n, sx, sy, sz, sxx, syy, sxy, sxz, syz, variance)
        node = np.int64(diagonal(graph, s, k // 2) if k % 2 else graph[s, k // 2])
        if way >= 8 and node >= 0:
            node = np.int64(graph[node, k // 2])
        if node < 0:
            continue
        x, y, h = dx[k] * (1 + (way >= 8)), dy[k] * (1 + (way >= 8)), np.float64(height[node]) - height[s]
        n, sx, sy, sz, variance = n + 1, sx + x, sy + y, sz + h, variance + np.float64(sigma[node]) ** 2
        sxx, syy, sxy, sxz, syz = sxx + x * x, syy + y * y, sxy + x * y, sxz + x * h, syz + y * h
    return _fitted((n, sx, sy, sz, sxx, syy, sxy, sxz, syz, variance), _PULL), _fitted(wheel, _PULL)


@lean_njit
def _node_at(surfaces: Surfaces, ny: Index, s: Index, dx: Index, dy: Index, plane: tuple[float, float]) -> Index:
    """The ground in the column at dx, dy from that of node s, near a plane through s; -1 where there is none."""
    guess = np.int64(np.floor(surfaces.height[s] + plane[0] * dx + plane[1] * dy))
    return find_node(surfaces.start, surfaces.z, np.int64(surfaces.column[s]) + dx * ny + dy, guess, _REACH)


@njit(cache=True)
def _plane_at(
    surfaces: Surfaces, ny: Index, s: Index, at: tuple[Index, Index], half: Index, plane: tuple[float, float]
) -> tuple[float, float, float, float, float]:
    """The plane through the window of this half width around the column `at` from that of node s: its slope; the mean squares of what the
    ground lies off it and of its form if it is curved; the mean square of the ground's sigma; and that of the slope's sigma.

    `plane` is about the gradient there. NaN where too few columns have ground.
    """
    n, sx, sy, sz, variance = 0, 0, 0, 0.0, 0.0
    sxx, syy, sxy, sxz, syz, szz = 0, 0, 0, 0.0, 0.0, 0.0
    cxx, cxy, cyy, qxx, qxy, qyy = 0.0, 0.0, 0.0, 1e-9, 1e-9, 1e-9
    mean = half * (half + 1) / 3.0  # of x * x over the window
    most = (2 * half + 1) ** 2
    for x in range(-half, half + 1):
        for y in range(-half, half + 1):
            node = _node_at(surfaces, ny, s, at[0] + x, at[1] + y, plane)
            if node < 0:
                most -= 1
                if most < _COVERED * (2 * half + 1) ** 2:
                    return np.nan, np.nan, np.nan, np.nan, np.nan
                continue
            h = np.float64(surfaces.height[node]) - surfaces.height[s] - plane[0] * (at[0] + x) - plane[1] * (at[1] + y)
            n, sx, sy, sz, variance = n + 1, sx + x, sy + y, sz + h, variance + np.float64(surfaces.sigma[node]) ** 2
            sxx, syy, sxy, sxz, syz, szz = sxx + x * x, syy + y * y, sxy + x * y, sxz + x * h, syz + y * h, szz + h * h
            qx, qm, qy = x * x - mean, x * y, y * y - mean
            cxx, cxy, cyy = cxx + qx * h, cxy + qm * h, cyy + qy * h
            qxx, qxy, qyy = qxx + qx * qx, qxy + qm * qm, qyy + qy * qy
    a, b, c = sxx - sx * sx / n, syy - sy * sy / n, sxy - sx * sy / n
    p, q = sxz - sx * sz / n, syz - sy * sz / n
    det = a * b - c * c
    u, v = (b * p - c * q) / det, (a * q - c * p) / det
    scatter = max(0.0, szz - sz * sz / n - u * p - v * q) / n
    curved = (cxx * cxx / qxx + cxy * cxy / qxy + cyy * cyy / qyy) / n
    variance /= n
    return np.hypot(plane[0] + u, plane[1] + v), scatter, curved, variance, max(scatter, variance) / max(min(a, b), 1.0)


@njit(cache=True)
def _best_plane(surfaces: Surfaces, ny: Index, s: Index, half: Index, plane: tuple[float, float], limits: Limits) -> tuple[float, float]:
    """Slope of the plane of this size that fits around node s, and its sigma; NaN where none does.

    What the ground lies off it must be noise: within its sigma, and, of a plane as large as the robot, no form of something curved. A
    smaller window is shifted, with the node at its rim, only where it does not fit around it, as beside a kerb.
    """
    best, slope, variance = np.inf, np.nan, np.nan
    for x in (0, -half, half):
        for y in (0, -half, half):
            if half != ROBOT and best < np.inf and x == 0 and y == -half:
                return slope, np.sqrt(variance)
            found, scatter, curved, noise, unsure = _plane_at(surfaces, ny, s, (x, y), half, plane)
            most = limits.confidence**2 * noise
            if scatter < min(best, most) and (half != ROBOT or curved <= max(scatter / 3, most / 30)):
                best, slope, variance = scatter, found, unsure
    return slope, np.sqrt(variance)


@lean_njit
def _is_gentle(graph: NDArray[np.int32], surfaces: Surfaces, s: Index, limits: Limits) -> bool:
    """Whether a look along both axes tells that the ground around node s is gentle: most ground is, and is told so soonest."""
    height, total = surfaces.height, 0.0
    for k in range(2):
        ahead, behind = np.int64(graph[s, k]), np.int64(graph[s, k + 2])
        if ahead < 0 or behind < 0 or graph[ahead, k] < 0 or graph[behind, k + 2] < 0:
            return False
        near, far = np.float64(height[ahead]) - height[behind], np.float64(height[graph[ahead, k]]) - height[graph[behind, k + 2]]
        total += max(abs(near) / 2, abs(near + 2 * far) / 10)
    return bool(total + limits.confidence * surfaces.sigma[s] <= limits.max_slope)


@njit(cache=True)
def steepness(surfaces: Surfaces, links: Links, ny: Index, s: Index, limits: Limits) -> Index:
    """2 where the ground at node s is too steep, 1 where it may be within its sigma, else 0.

    A plane as large as the robot decides alone, where one fits. Elsewhere the ground under the wheel base must be within the limit by
    `confidence` sigmas, and that under a wheel as it is measured, unless all of it may be a kerb.
    """
    if _is_gentle(links.graph, surfaces, s, limits):
        return 0
    (x, y, sigma), (wx, wy, wheel_sigma) = gradients_at(links.graph, surfaces, s)
    slope, wheel = np.hypot(x, y), np.hypot(wx, wy)
    if max(slope + limits.confidence * sigma, wheel + limits.confidence * wheel_sigma) <= limits.max_slope:
        return 0
    robot, _ = _best_plane(surfaces, ny, s, ROBOT, (x, y), limits)
    if not np.isnan(robot):
        return 2 if robot > limits.max_plane_slope else 0
    base, unsure = _best_plane(surfaces, ny, s, BASE, (x, y), limits)
    if np.isnan(base):  # an edge: steps tell whether it is climbed, if it is not as steep as a wall
        return 2 if slope - limits.confidence * sigma > limits.max_slope else 0
    if base - limits.confidence * unsure > limits.max_slope:
        return 2
    fitted, _ = _best_plane(surfaces, ny, s, WHEEL, (x, y), limits)
    wheel = wheel if np.isnan(fitted) else fitted
    is_wheel_steep = wheel > limits.max_slope and base > _OF_STEP * limits.max_step
    return 1 if is_wheel_steep or base + limits.confidence * unsure > limits.max_slope else 0
