"""The navigation graph on the surfaces: which of them are neighbours, and how steep the ground is (thesis 5.5, 5.5.1).

Third step of `terrain.classify`, with `surface_steps` and `surface_planes`. A slope is a plane fitted to all ground within the footprint
that straight lines over accepted edges reach, as measured by the beams where they were. What inclines is looked at closely, too.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.lean_kernels import lean_njit
from octomap_server_3dnav.terrain.surface_columns import DX, DY, find_node

UNFITTED, GENTLE, INCLINED, NEARLY_STEEP, STEEP = 0, 1, 2, 3, 4
_CLOSE = 1  # columns around a node for a close look
_PULL = 0.5
_BLOCK = 4096  # columns whose sums stay in the cache
_WORTH = 8  # a sheet is fitted as one where it covers such a part of the columns: most nodes of a small one are never asked for


class Links(NamedTuple):
    """Neighbours of the surface nodes, (N, 4) int32 each: the `near` ones, and in `graph` those of them that can be stepped to.

    `slope` (N,) uint8 tells of nodes amid open ground whether they are GENTLE, INCLINED, NEARLY_STEEP or STEEP; UNFITTED of the others.
    """

    near: NDArray[np.int32]
    graph: NDArray[np.int32]
    slope: NDArray[np.uint8]


@njit(cache=True)
def nearest_neighbours(start: Any, z: Any, ny: Any, spans: Any, step: Any) -> Any:
    """(N, 4) int32 node of each neighbouring column within `step` voxels in height, -1 where there is none.

    For the nodes of columns (ix, iy) with spans[ix, 0] <= iy < spans[ix, 1], which must not be at the window's rim; -1 for others.
    """
    out = np.full((z.size, 4), -1, np.int32)
    for ix in range(spans.shape[0]):
        for iy in range(spans[ix, 0], spans[ix, 1]):
            c = ix * ny + iy
            first, end = start[c], start[c + 1]
            for k in range(4):
                d = c + DX[k] * ny + DY[k]
                if end - first == 1 and start[d + 1] - start[d] == 1:
                    if abs(np.int64(z[first]) - z[start[d]]) <= step:
                        out[first, k] = start[d]
                    continue
                for s in range(first, end):
                    out[s, k] = find_node(start, z, d, np.int64(z[s]), step)
    return out


@njit(cache=True)
def centred_levels(graph: Any, surfaces: Any) -> Any:
    """(N,) float32 `slope_level` of the nodes in the middle of their columns: on a slope what was hit beside it is higher or lower.

    The slope is that of the two neighbours along an axis, between the places where these were hit.
    """
    level, offset = surfaces.slope_level, surfaces.offset
    out = level.copy()
    for s in range(level.size):
        for k in range(2):
            if offset[s, k] == 0.0:
                continue
            ahead = graph[s, k] if graph[s, k] >= 0 else s
            behind = graph[s, k + 2] if graph[s, k + 2] >= 0 else s
            way = np.float32((ahead != s) + (behind != s)) + offset[ahead, k] - offset[behind, k]
            if way > 0.5:
                out[s] -= offset[s, k] * (level[ahead] - level[behind]) / way
    return out


@njit(cache=True)
def kerbs(graph: Any, surfaces: Any, rise: Any) -> Any:
    """(N,) bool: whether an edge of the graph leads over a measured rise or fall of more than `rise` voxels from one column to the next."""
    level, measured = surfaces.level, surfaces.measured
    out = np.zeros(level.size, np.bool_)
    for s in range(level.size):
        for k in range(4):
            n = graph[s, k]
            if n >= 0 and measured[s] and measured[n] and abs(level[n] - level[s]) > rise:
                out[s] = True
    return out


@lean_njit
def diagonal(graph: Any, s: Any, k: Any) -> Any:
    """Node diagonally between directions k and k + 1, -1 unless both ways round its corner are open and lead to it."""
    a, b = graph[s, k], graph[s, (k + 1) % 4]
    if a < 0 or b < 0 or graph[a, (k + 1) % 4] != graph[b, k]:
        return -1
    return graph[a, (k + 1) % 4]


@lean_njit
def _ray_lengths(reach: Any) -> Any:
    """Steps along the axes and along the diagonals within `reach` columns."""
    return int(reach), int(round(reach / np.sqrt(2.0)))


@lean_njit
def gradient_at(graph: Any, level: Any, s: Any, reach: Any, pull: Any = _PULL) -> Any:
    """Rise along x and y of the plane fitted to the ground around s, out to `reach` voxels.

    A weak pull to level keeps it defined where all ground lies on one line.
    """
    n, sx, sy, sxx, syy, sxy = 1, 0, 0, 0, 0, 0
    sz, sxz, syz = 0.0, 0.0, 0.0
    lengths = _ray_lengths(reach)
    for k in range(4):
        for oblique in range(2):
            dx, dy = DX[k] + oblique * DX[(k + 1) % 4], DY[k] + oblique * DY[(k + 1) % 4]
            node = np.int64(s)
            for j in range(1, lengths[oblique] + 1):
                node = np.int64(diagonal(graph, node, k) if oblique else graph[node, k])
                if node < 0:
                    break
                x, y, h = j * dx, j * dy, np.float64(level[node]) - level[s]
                n, sx, sy, sz = n + 1, sx + x, sy + y, sz + h
                sxx, syy, sxy, sxz, syz = sxx + x * x, syy + y * y, sxy + x * y, sxz + x * h, syz + y * h
    a, b, c = sxx - sx * sx / n + pull, syy - sy * sy / n + pull, sxy - sx * sy / n
    p, q = sxz - sx * sz / n, syz - sy * sz / n
    det = a * b - c * c
    return (b * p - c * q) / det, (a * q - c * p) / det


@lean_njit
def slope_at(graph: Any, level: Any, s: Any, reach: Any) -> Any:
    """Tangent of the steepest slope of that plane."""
    along_x, along_y = gradient_at(graph, level, s, reach)
    return np.hypot(along_x, along_y)


@lean_njit
def steepness(slope: Any, steepest: Any) -> Any:
    """GENTLE, INCLINED, NEARLY_STEEP or STEEP, by the three slopes, ascending, above which ground is each of the latter."""
    if slope > steepest[2]:
        return STEEP
    if slope > steepest[1]:
        return NEARLY_STEEP
    return INCLINED if slope > steepest[0] else GENTLE


@lean_njit
def _is_amid(graph: Any, s: Any) -> Any:
    """Whether ground goes on beyond all neighbours of node s: at its rim the face below was hit, too."""
    for k in range(4):
        n = np.int64(graph[s, k])
        for j in range(4):
            if n < 0 or graph[n, j] < 0:
                return False
    return True


@lean_njit
def steepness_at(links: Any, level: Any, s: Any, reach: Any, steepest: Any) -> Any:
    """The same of node s, by the plane fitted to the ground around it.

    What that calls INCLINED is NEARLY_STEEP if it is too steep in a close look, and GENTLE if it is not even nearly so there: a hand's
    breadth may be steeper than two.
    """
    kind = links.slope[s]
    if kind == UNFITTED:
        kind = steepness(slope_at(links.graph, level, s, reach), steepest)
    if kind != INCLINED:
        return kind
    if not _is_amid(links.graph, s):
        return GENTLE
    along_x, along_y = gradient_at(links.graph, level, s, _CLOSE, 0.0)
    closely = np.hypot(along_x, along_y)
    if closely > steepest[3]:
        return NEARLY_STEEP
    return INCLINED if closely > steepest[1] else GENTLE


@lean_njit
def _is_worth_fitting(start: Any, rank: Any) -> Any:
    """Whether so many columns have a surface that is number `rank` from below that it pays to fit these as one sheet."""
    count = np.int32(0)
    for c in range(start.size - 1):
        count += start[c + 1] - start[c] > rank
    return count * _WORTH > start.size


@njit(cache=True)
def _sheet(start: Any, level: Any, graph: Any, ny: Any, spans: Any, rank: Any, height: Any, edges: Any) -> None:
    """Writes of the surface that is number `rank` from below in its column its height and, as bits, the directions in which it leads to one
    of the same rank; 0 where there is none."""
    height[:], edges[:] = 0, 0
    for ix in range(spans.shape[0]):
        for c in range(ix * ny + spans[ix, 0], ix * ny + spans[ix, 1]):
            s = start[c] + rank
            if s >= start[c + 1]:
                continue
            height[c] = level[s]
            for k in range(4):
                edges[c] |= np.uint8(graph[s, k] == start[c + DX[k] * ny + DY[k]] + rank) << k


@njit(cache=True)
def _both_ways(edges: Any, ny: Any) -> Any:
    """(C,) uint8 bits of the `edges` that lead back, and as bits 4-7 the diagonals with both ways round."""
    n, low = edges.size - 2 * (ny + 1), ny + 1
    both, out = np.zeros_like(edges), np.zeros_like(edges)
    for k in range(4):
        here, there = edges[low : low + n], edges[low + DX[k] * ny + DY[k] :][:n]
        mark = both[low : low + n]
        for i in range(n):
            mark[i] |= (here[i] >> k & there[i] >> (k + 2) % 4 & 1) << k
    out[:] = both
    for k in range(4):
        aside = (k + 1) % 4
        here, mark = both[low : low + n], out[low : low + n]
        a, b = both[low + DX[k] * ny + DY[k] :][:n], both[low + DX[aside] * ny + DY[aside] :][:n]
        for i in range(n):
            mark[i] |= (here[i] >> k & here[i] >> aside & a[i] >> aside & b[i] >> k & 1) << (k + 4)
    return out


@njit(cache=True)
def _open_ground(edges: Any, ny: Any, low: Any, n: Any, reach: Any) -> Any:
    """(n,) uint8, from column `low` on: whether all rays of `slope_at` have their full length, over one sheet."""
    is_open = np.ones(n, np.uint8)
    lengths = _ray_lengths(reach)
    for k in range(4):
        for oblique in range(2):
            stride = DX[k] * ny + DY[k] + oblique * (DX[(k + 1) % 4] * ny + DY[(k + 1) % 4])
            for j in range(lengths[oblique]):
                along, bit = edges[low + j * stride :][:n], k + 4 * oblique
                for i in range(n):
                    is_open[i] &= along[i] >> bit
    return is_open


@njit(cache=True)
def _add_difference(total: Any, height: Any, first: Any, other: Any, factor: Any) -> None:
    """Adds factor * (height[first + i] - height[other + i]) to total[i]."""
    a, b = height[first:][: total.size], height[other:][: total.size]
    for i in range(total.size):
        total[i] += np.float32(factor) * (a[i] - b[i])


@njit(cache=True)
def _fit_sheet(start: Any, rank: Any, height: Any, edges: Any, ny: Any, reach: Any, steepest: Any, slope: Any) -> None:
    """Writes `Links.slope` of the nodes of a sheet: where no ray of `slope_at` ends early the sums over x and y are known, those over x * h
    and y * h the same stencil everywhere."""
    straight, oblique = _ray_lengths(reach)
    rim = max(straight, oblique) * (ny + 1)
    a = 0.5 + 2.0 * (np.arange(straight + 1) ** 2).sum() + 4.0 * (np.arange(oblique + 1) ** 2).sum()
    for low in range(rim, height.size - rim, _BLOCK):
        n = min(_BLOCK, height.size - rim - low)
        is_open = _open_ground(edges, ny, low, n, reach)
        if not (is_open & 1).any():
            continue
        along_x, along_y = np.zeros(n, np.float32), np.zeros(n, np.float32)
        for j in range(1, straight + 1):
            _add_difference(along_x, height, low + j * ny, low - j * ny, j)
            _add_difference(along_y, height, low + j, low - j, j)
        for j in range(1, oblique + 1):
            up, down = j * (ny + 1), j * (ny - 1)
            _add_difference(along_x, height, low + up, low - up, j)
            _add_difference(along_x, height, low + down, low - down, j)
            _add_difference(along_y, height, low + up, low - up, j)
            _add_difference(along_y, height, low - down, low + down, j)
        for i in range(n):
            if is_open[i] & 1:
                p, q = float(along_x[i]), float(along_y[i])
                gentle = abs(p) + abs(q) < 0.99 * steepest[0] * a
                slope[start[low + i] + rank] = GENTLE if gentle else steepness(np.hypot((a * p) / (a * a), (a * q) / (a * a)), steepest)


@njit(cache=True)
def slopes_of_open_ground(start: Any, level: Any, graph: Any, ny: Any, spans: Any, reach: Any, steepest: Any) -> Any:
    """`Links.slope`: sheet by sheet, of those with so many nodes that it pays."""
    slope = np.zeros(level.size, np.uint8)
    height, edges = np.empty(start.size - 1, np.float32), np.empty(start.size - 1, np.uint8)
    rank = 0
    while _is_worth_fitting(start, rank):
        _sheet(start, level, graph, ny, spans, rank, height, edges)
        _fit_sheet(start, rank, height, _both_ways(edges, ny), ny, reach, steepest, slope)
        rank += 1
    return slope
