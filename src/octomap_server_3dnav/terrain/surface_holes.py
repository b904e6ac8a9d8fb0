"""Small holes between surfaces: floor is assumed where a few columns are unknown and the ground on both sides is one (thesis 5.5).

So it is over a column, or two side by side, deeper than all around: no wheel falls into it.

Second step of `terrain.classify`, over the surfaces of `surface_columns`; everything is in voxels.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.lean_kernels import lean_njit
from octomap_server_3dnav.terrain.surface_columns import (
    DX,
    DY,
    NO_VOXEL,
    Columns,
    Surfaces,
    blocking_voxel,
    find_node,
    seen_down_to,
    slope_behind,
)

_PIT = 0.6  # voxels by which what was measured at the bottom of a pit lies below the ground around: a thin deck's underside, at least


@lean_njit
def _is_step_between(surfaces: Any, a: Any, b: Any, gap: Any, back: Any, front: Any, step: Any, max_step: Any) -> Any:
    """Whether measured nodes a and b, `gap` columns apart, differ by more than `max_step` from where the slope behind or beyond leads.

    `back` and `front` are the columns three before a and three after b.
    """
    rise = surfaces.level[b] - surfaces.level[a]
    behind, beyond = slope_behind(surfaces, a, back, step), -slope_behind(surfaces, b, front, step)
    return min(abs(rise), abs(rise - gap * behind), abs(rise - gap * beyond)) > max_step


@lean_njit
def _is_one_floor(surfaces: Any, a: Any, b: Any, gap: Any, back: Any, front: Any, step: Any, max_step: Any) -> Any:
    """Whether nodes a and b, `gap` columns apart, are one floor: level, or on a slope that goes on behind a or b."""
    start, z = surfaces.start, surfaces.z
    rise = np.int64(z[b]) - np.int64(z[a])
    if abs(rise) > 2:
        return False
    if surfaces.measured[a] and surfaces.measured[b]:
        return not _is_step_between(surfaces, a, b, gap, back, front, step, max_step)
    if abs(rise) <= 1:
        return True
    behind, ahead = find_node(start, z, back, z[a], step), find_node(start, z, front, z[b], step)
    sign = 1 if rise > 0 else -1
    return (behind >= 0 and (z[a] - z[behind]) * sign >= 1) or (ahead >= 0 and (z[ahead] - z[b]) * sign >= 1)


@lean_njit
def _is_alone(surfaces: Any, s: Any, ny: Any, step: Any) -> Any:
    """Whether no column beside that of node s has ground at about its level: a hit or two that went astray carry no bridge."""
    c, level = np.int64(surfaces.column[s]), np.int64(surfaces.z[s])
    for dx in range(-1, 2):
        for dy in range(-1, 2):
            if (dx != 0 or dy != 0) and find_node(surfaces.start, surfaces.z, c + dx * ny + dy, level, step) >= 0:
                return False
    return True


@lean_njit
def _spans(columns: Any, start: Any, z: Any, a: Any, b: Any, c: Any, stride: Any, gap: Any, step: Any, clearance: Any, drop: Any) -> Any:
    """Whether floor between nodes a, of column c, and b, `gap` columns on, contradicts nothing that is known there."""
    for j in range(1, gap):
        level = _level_between(z, a, b, j, gap)
        between = c + j * stride
        if find_node(start, z, between, np.int64(z[b]), step) >= 0:
            return False
        if find_node(start, z, between, level, step) >= 0 or blocking_voxel(columns, between, level, step, clearance) != NO_VOXEL:
            return False
        if seen_down_to(columns, between, level + step + 1) == NO_VOXEL:
            return False
        seen = seen_down_to(columns, between, level)
        if seen != NO_VOXEL and seen <= level - drop:
            return False
    return True


@lean_njit
def _level_between(z: Any, a: Any, b: Any, j: Any, gap: Any) -> Any:
    """Layer of the floor j of `gap` columns on the way from node a to node b."""
    return (2 * (np.int64(z[a]) * (gap - j) + np.int64(z[b]) * j) + gap) // (2 * gap)


@lean_njit
def _bridges(columns: Any, surfaces: Any, limits: Any, out: Any) -> Any:
    """How many voxels of virtual floor are between nodes a and b of one floor, with at most `hole` columns unknown; as many of them as find
    room in `out` (M, 7) are written there: column, z, gap, a, b, share of the way from a to b, and by how much the levels of both differ.

    `limits` is (hole, step, clearance, drop, highest measured step) in voxels.
    """
    hole, step, clearance, drop, max_step = limits
    nx, ny = columns.nx, columns.ny
    start, column, z = surfaces.start, surfaces.column, surfaces.z
    found = 0
    for a in range(z.size):
        c, z_a = np.int64(column[a]), np.int64(z[a])
        for k in range(2):
            stride = ny if k == 0 else 1
            if find_node(start, z, c + stride, z_a, step) >= 0:
                continue
            ix, iy = c // ny, c % ny
            room = min(hole + 1, (nx - ix - 4 if k == 0 else ny - iy - 4)) if ix >= 3 and iy >= 3 else 0
            for gap in range(2, room + 1):
                b = find_node(start, z, c + gap * stride, z_a, max(step, 2))
                if (
                    b >= 0
                    and abs(np.int64(z[b]) - z_a) <= 2
                    and _is_one_floor(surfaces, a, b, gap, c - 3 * stride, c + (gap + 3) * stride, step, max_step)
                    and _spans(columns, start, z, a, b, c, stride, gap, step, clearance, drop)
                    and not (_is_alone(surfaces, a, ny, step) or _is_alone(surfaces, b, ny, step))
                ):
                    for j in range(1, gap):
                        if found < len(out):
                            out[found, 0], out[found, 1] = c + j * stride, _level_between(z, a, b, j, gap)
                            out[found, 2], out[found, 3], out[found, 4], out[found, 5] = gap, a, b, j / gap
                            out[found, 6] = abs(surfaces.level[b] - surfaces.level[a])
                        found += 1
                if b >= 0 and abs(np.int64(z[b]) - z_a) <= step:
                    break
    return found


@lean_njit
def _goes_before(bridge: Any, other: Any) -> Any:
    """Whether of two bridges over one hole this one stays: the narrower, the higher, the more level one."""
    if bridge[2] != other[2] or bridge[1] != other[1]:
        return bridge[2] < other[2] or (bridge[2] == other[2] and bridge[1] > other[1])
    return bridge[6] < other[6]


@njit(cache=True)
def _best_of(found: Any, order: Any, step: Any) -> Any:
    """One of the (M, 7) bridges where some meet in one column at one level; `order` (M,) sorts them by column and height."""
    best, n = np.empty(order.size, np.int64), 0
    for i in range(order.size):
        bridge = found[order[i]]
        meets = i > 0 and bridge[0] == found[order[i - 1], 0] and bridge[1] - found[order[i - 1], 1] <= step
        n += not meets
        if not meets or _goes_before(bridge, found[best[n - 1]]):
            best[n - 1] = order[i]
    return found[best[:n]]


@njit(cache=True)
def _sort_keys(found: Any) -> Any:
    """(M,) int64 that sort bridges by column and height."""
    out = np.empty(len(found), np.int64)
    for i in range(len(found)):
        out[i] = (np.int64(found[i, 0]) << 16) + np.int64(found[i, 1])
    return out


def _one_per_hole(found: NDArray[np.float64], step: int) -> NDArray[np.float64]:
    """Those of the bridges that stay, sorted; as single numbers they sort faster than by two keys."""
    return np.asarray(_best_of(found, np.argsort(_sort_keys(found), kind="stable"), step))


@lean_njit
def _on_line(at_a: Any, at_b: Any, share: Any) -> Any:
    """The value on a line from a to b, after a share of the way."""
    return at_a + share * (at_b - at_a)


@lean_njit
def _place_of(surfaces: Any, bridge: Any) -> Any:
    """The node before which a bridge comes."""
    n, c = np.int64(surfaces.start[int(bridge[0])]), int(bridge[0])
    while n < surfaces.start[c + 1] and surfaces.z[n] <= bridge[1]:
        n += 1
    return n


@lean_njit
def _copy_nodes(old: Any, first: Any, end: Any, shift: Any, new: Any) -> None:
    """Writes the nodes from `first` to before `end` into `new`, so much farther on."""
    for s in range(first, end):
        n = s + shift
        new.column[n], new.z[n], new.bridged[n], new.is_open[n] = old.column[s], old.z[s], old.bridged[s], old.is_open[s]
        new.level[n], new.slope_level[n], new.measured[n] = old.level[s], old.slope_level[s], old.measured[s]
        new.offset[n, 0], new.offset[n, 1] = old.offset[s, 0], old.offset[s, 1]


@lean_njit
def _write_bridge(old: Any, bridge: Any, n: Any, new: Any) -> None:
    """Writes a bridge as node n: where it is, and how high if both its ends are measured."""
    a, b, share = int(bridge[3]), int(bridge[4]), bridge[5]
    new.column[n], new.z[n], new.bridged[n], new.is_open[n] = bridge[0], bridge[1], True, False
    new.measured[n] = old.measured[a] and old.measured[b]
    new.level[n] = new.slope_level[n] = bridge[1] + 0.5
    new.offset[n, 0] = new.offset[n, 1] = 0.0
    if new.measured[n]:
        new.level[n] = _on_line(old.level[a], old.level[b], share)
        new.slope_level[n] = _on_line(old.slope_level[a], old.slope_level[b], share)
        for axis in range(2):
            new.offset[n, axis] = _on_line(old.offset[a, axis], old.offset[b, axis], share)


@njit(cache=True)
def _fill_holes(surfaces: Any, found: Any, new: Any) -> None:
    """Writes the surfaces and the (H, 7) sorted holes among them into `new`, which has room for both."""
    first, column = 0, 0
    for h in range(len(found) + 1):
        is_last = h == len(found)
        end = surfaces.z.size if is_last else _place_of(surfaces, found[h])
        _copy_nodes(surfaces, first, end, h, new)
        if not is_last:
            _write_bridge(surfaces, found[h], end + h, new)
        following = surfaces.start.size if is_last else int(found[h, 0]) + 1
        for c in range(column, following):
            new.start[c] = surfaces.start[c] + h
        first, column = end, following


def _with_holes(surfaces: Surfaces, found: NDArray[np.float64]) -> Surfaces:
    """The surfaces with the (H, 7) sorted holes among them."""
    size = surfaces.z.size + len(found)
    new = Surfaces(np.empty_like(surfaces.start), *(np.empty((size, *of.shape[1:]), of.dtype) for of in surfaces[1:]))
    _fill_holes(surfaces, found, new)
    return new


def bridge_holes(columns: Columns, surfaces: Surfaces, clearance: int, hole: int, step: int, max_measured_step: float) -> Surfaces:
    """The surfaces and virtual ones over holes of at most `hole` unknown columns, as high as a straight line over the hole is."""
    limits, out = (hole, step, clearance, step + 1, max_measured_step), np.empty((surfaces.z.size, 7))
    count = _bridges(columns, surfaces, limits, out)
    if count > len(out):
        out = np.empty((count, 7))
        _bridges(columns, surfaces, limits, out)
    found = out[:count]
    return _with_holes(surfaces, _one_per_hole(found, step)) if len(found) else surfaces


@lean_njit
def _rises(surfaces: Any, s: Any, n: Any, max_step: Any) -> Any:
    """Whether the ground at node n is higher than node s, a bottom, by more than `max_step`, or _PIT where that is measured (half a voxel
    more if the bottom is not)."""
    depth = max_step
    if surfaces.measured[n]:
        depth = _PIT if surfaces.measured[s] else _PIT + 0.5
    return surfaces.level[n] - surfaces.level[s] > depth


@lean_njit
def _side(surfaces: Any, s: Any, k: Any, ny: Any, step: Any) -> Any:
    """The node in direction k from node s within a step in height, -1 where there is none."""
    return find_node(surfaces.start, surfaces.z, np.int64(surfaces.column[s]) + DX[k] * ny + DY[k], np.int64(surfaces.z[s]), step)


@lean_njit
def _rim(surfaces: Any, s: Any, ny: Any, step: Any, max_step: Any, sides: Any) -> Any:
    """How many of the four columns beside node s rise from it, and the last that does not; `sides` (4,) is filled with their nodes, up to
    the second that does not."""
    rising, low = 0, -1
    for k in range(4):
        sides[k] = _side(surfaces, s, k, ny, step)
        if sides[k] >= 0 and _rises(surfaces, s, sides[k], max_step):
            rising += 1
        elif low >= 0:
            return 0, low
        else:
            low = k
    return rising, low


@lean_njit
def _is_one_rim(surfaces: Any, a: Any, b: Any, max_step: Any) -> Any:
    """Whether the ground on both sides of a pit is one."""
    return abs(surfaces.level[a] - surfaces.level[b]) <= max_step


@lean_njit
def _sides_of_pit(surfaces: Any, s: Any, ny: Any, step: Any, max_step: Any, sides: Any, beyond: Any) -> Any:
    """Whether node s lies at the bottom of a pit of one column or two: all around the ground rises, and what lies across it is one.

    `sides` (4,) is filled with the nodes that tell its floor: all four, or twice those across a pit of two. `beyond` (4,) is scratch.
    """
    rising, low = _rim(surfaces, s, ny, step, max_step, sides)
    if rising == 4:
        return _is_one_rim(surfaces, sides[0], sides[2], max_step) and _is_one_rim(surfaces, sides[1], sides[3], max_step)
    if rising < 3 or sides[low] < 0:
        return False
    back = (low + 2) % 4
    if _rim(surfaces, sides[low], ny, step, max_step, beyond) != (3, back) or beyond[back] != s:
        return False
    is_one = _is_one_rim(surfaces, sides[back], beyond[low], max_step)
    for k in (1, 3):
        is_one &= _is_one_rim(surfaces, sides[(low + k) % 4], beyond[(low + k) % 4], max_step)
    is_one &= _is_one_rim(surfaces, sides[(low + 1) % 4], sides[(low + 3) % 4], max_step)
    is_one &= _is_one_rim(surfaces, beyond[(low + 1) % 4], beyond[(low + 3) % 4], max_step)
    sides[low], sides[back] = sides[(low + 1) % 4], sides[(low + 3) % 4]
    return is_one


@lean_njit
def _is_no_bottom(surfaces: Any, s: Any, c: Any, max_step: Any) -> Any:
    """Whether it is told at a glance that neither column beside that of node s along y rises, as beside every pit one does: both it and the
    next have one surface, which is the next in memory, and the highest of the one before is the one before."""
    start, level = surfaces.start, surfaces.level
    is_plain = start[c] == s and start[c + 1] == s + 1 and start[c + 2] == s + 2
    depth = min(_PIT, max_step)  # the least with which `_rises` is content
    return is_plain and level[s - 1] - level[s] <= depth and level[s + 1] - level[s] <= depth


@njit(cache=True)
def _pits(surfaces: Any, nx: Any, ny: Any, step: Any, max_step: Any) -> Any:
    """(P,) nodes at the bottom of pits and (P, 4) those that tell their floor."""
    found, told = [0 for _ in range(0)], [0 for _ in range(0)]
    sides, beyond = np.empty(4, np.int64), np.empty(4, np.int64)
    for s in range(surfaces.z.size):
        c = np.int64(surfaces.column[s])
        if not 2 * ny <= c < (nx - 2) * ny or _is_no_bottom(surfaces, s, c, max_step):
            continue
        if _sides_of_pit(surfaces, s, ny, step, max_step, sides, beyond) and 1 < c % ny < ny - 2:
            found.append(s)
            told.extend(sides)
    return np.array(found, np.int64), np.array(told, np.int64).reshape(-1, 4)


def cover_pits(columns: Columns, surfaces: Surfaces, step: int, max_step: float) -> Surfaces:
    """The surfaces with floor over pits of a column or two, as high as the ground on its sides is on average."""
    pits, sides = _pits(surfaces, columns.nx, columns.ny, step, max_step)
    if not pits.size:
        return surfaces
    z, bridged, measured, is_open = surfaces.z.copy(), surfaces.bridged.copy(), surfaces.measured.copy(), surfaces.is_open.copy()
    level, slope_level, offset = surfaces.level.copy(), surfaces.slope_level.copy(), surfaces.offset.copy()
    z[pits], bridged[pits], measured[pits] = np.floor(level[sides].mean(axis=1)), True, surfaces.measured[sides].all(axis=1)
    level[pits] = np.where(measured[pits], level[sides].mean(axis=1), z[pits] + 0.5)
    slope_level[pits] = np.where(measured[pits], slope_level[sides].mean(axis=1), z[pits] + 0.5)
    offset[pits], is_open[pits] = 0.0, False
    return surfaces._replace(z=z, bridged=bridged, is_open=is_open, measured=measured, level=level, slope_level=slope_level, offset=offset)
