"""The floods of the terrain analysis over the surface graph: judge, inflate, second flood, frontiers (thesis 5.5, algorithm 3).

Fourth step of `terrain.classify`. What a node is depends on the map around it alone, never on the way the flood came: labels
do not depend on the order of the flood. Everything is in voxels.
"""

from typing import Any

import numpy as np
from numba import njit

from octomap_server_3dnav.octree.lean_kernels import lean_njit
from octomap_server_3dnav.terrain.surface_columns import (
    DX,
    DY,
    NO_VOXEL,
    blocking_voxel,
    find_node,
    is_top_seen,
    lowest_occupied,
    seen_down_to,
    slope_behind,
    top_near,
)
from octomap_server_3dnav.terrain.surface_graph import GENTLE, NEARLY_STEEP, STEEP, gradient_at, slope_at, steepness_at
from octomap_server_3dnav.terrain.surface_planes import is_gentle_plane
from octomap_server_3dnav.terrain.surface_steps import step_between_treads

UNREACHED, TRAVERSABLE, OBSTACLE, CLIFF, INFLATION, FRONTIER, POTENTIAL_CLIFF = 255, 0, 1, 2, 3, 4, 5
SEES_UNKNOWN, SEES_OBSTACLE, SEES_DROP, SEES_EDGE = 0, 1, 2, 3
PASSED = NO_VOXEL - 1  # what hangs in the way where no beam ended, but some passed: it reaches no farther than the middle of its column
_UNSURE = 0.15  # voxels by which two surfaces may be higher or lower than measured where the laser's lines lie far apart
_SEEMS_STEEP = 1.2  # times the steepest slope; what seems steeper than that is
ROW_LAST = (0, 2, 1, 3)  # a stack filled in this order is worked off along y, where neighbours are neighbours in memory


@lean_njit
def _limit(j: Any, step: Any, max_slope: Any) -> Any:
    """Voxels by which drivable ground may differ in height j columns away."""
    return max(step, 1 + int(np.floor(j * max_slope)))


@lean_njit
def _falls_to(surfaces: Any, s: Any, n: Any, j: Any, stride: Any, limits: Any) -> Any:
    """Whether node n, j columns beyond node s and nothing in between, lies lower than a step and than any slope between would lead.

    Where ground slopes down already the hits in both may lie up to a column farther apart than their columns.
    """
    if not (surfaces.measured[s] and surfaces.measured[n]):
        return False
    slopes_down = slope_behind(surfaces, s, surfaces.column[s] - 3 * stride, limits.step) < 0
    return surfaces.slope_level[s] - surfaces.slope_level[n] > max(limits.steps.measured, (j + slopes_down) * limits.max_slope + _UNSURE)


@lean_njit
def _drop_along(columns: Any, surfaces: Any, s: Any, c: Any, stride: Any, limits: Any, assumed: Any) -> Any:
    """Whether from column c in steps of `stride` all ground that could be driven to from node s lies too low, or free space below it.

    Where a drop is `assumed`, as the thesis does (7.3), it is enough that a beam passed where ground would be and none was seen.
    """
    start, z = surfaces.start, surfaces.z
    step, level = limits.step, np.int64(z[s])
    for j in range(1, limits.look + 1):
        cj = c + j * stride
        limit = _limit(j, step, limits.max_slope)
        n = find_node(start, z, cj, level, limit)
        if n >= 0:
            return _falls_to(surfaces, s, n, j, stride, limits)
        if lowest_occupied(columns, cj, level - step, level + step) != NO_VOXEL:
            return False
        seen = seen_down_to(columns, cj, level)
        if seen == NO_VOXEL:
            continue
        on_ground = lowest_occupied(columns, cj, seen - 2, seen - 1) != NO_VOXEL
        if (assumed and seen <= level) or seen < level - limit or (on_ground and seen <= level - limit):
            return True
    return False


@lean_njit
def _ground_aside(start: Any, z: Any, c: Any, stride: Any, aside: Any, level: Any, limits: Any) -> Any:
    """Whether the area beside the ray (thesis figure 5.12) holds ground at about this level."""
    half_width = limits.cliff_area
    for offset in range(-half_width, half_width + 1):
        for j in range(1, 4):
            if find_node(start, z, c + offset * aside + j * stride, level, _limit(j, limits.step, limits.max_slope)) >= 0:
                return True
    return False


@lean_njit
def look(columns: Any, surfaces: Any, s: Any, c: Any, k: Any, limits: Any) -> Any:
    """What lies in direction k of node s of column c where no ground goes on: obstacle, drop that was seen, edge, or the unknown.

    An edge is unknown ground over which a beam passed.
    """
    half_width, assumed, level = limits.cliff_area, limits.assumes_cliffs, np.int64(surfaces.z[s])
    stride, aside = DX[k] * columns.ny + DY[k], DX[(k + 1) % 4] * columns.ny + DY[(k + 1) % 4]
    if blocking_voxel(columns, c + stride, level, limits.step, limits.clearance) != NO_VOXEL:
        return SEES_OBSTACLE
    if _drop_along(columns, surfaces, s, c, stride, limits, assumed):
        return SEES_DROP
    if _ground_aside(surfaces.start, surfaces.z, c, stride, aside, level, limits):
        return SEES_UNKNOWN
    for offset in range(1, half_width + 1):
        for side in (-offset, offset):
            if _drop_along(columns, surfaces, s, c + side * aside, stride, limits, assumed):
                return SEES_DROP
    return SEES_EDGE if _drop_along(columns, surfaces, s, c, stride, limits, True) else SEES_UNKNOWN


@lean_njit
def _is_at_drop(columns: Any, surfaces: Any, near: Any, graph: Any, s: Any, c: Any, limits: Any, seen: Any) -> Any:
    """Whether a drop was seen beside node s of column c; what was seen where no edge leads goes into `seen`.

    Lower ground whose top was not seen may be higher than it looks: a wall under a deck that was seen from below only.
    """
    for k in range(4):
        n = near[s, k]
        if n < 0:
            seen[s, k] = look(columns, surfaces, s, c, k, limits)
            if seen[s, k] == SEES_DROP:
                return True
        elif graph[s, k] < 0:
            seen[s, k] = SEES_OBSTACLE
            if surfaces.level[n] < surfaces.level[s]:
                if is_top_seen(columns, c + DX[k] * columns.ny + DY[k], surfaces.z[n]):
                    return True
                seen[s, k] = SEES_UNKNOWN
    return False


@lean_njit
def _is_near_steep(surfaces: Any, links: Any, s: Any, limits: Any) -> Any:
    """Whether the ground at a neighbour of node s is too steep, or nearly so."""
    for k in range(4):
        n = links.graph[s, k]
        if n >= 0 and steepness_at(links, surfaces.slope_level, n, limits.slope_reach, limits.steepest) != GENTLE:
            return True
    return False


@lean_njit
def _only_seems_steep(surfaces: Any, ny: Any, links: Any, s: Any, limits: Any) -> Any:
    """Whether node s, too steep by a fit, is at a kerb that the robot climbs, or on a plane that is not too steep."""
    gradient = gradient_at(links.graph, surfaces.slope_level, s, limits.slope_reach)
    if not surfaces.measured[s] or np.hypot(gradient[0], gradient[1]) > _SEEMS_STEEP * limits.max_slope:
        return False
    for k in range(2):
        if step_between_treads(links.near, surfaces, s, s, k) <= limits.steps.treads:
            return True
    return is_gentle_plane(surfaces, ny, s, gradient, limits.max_plane_slope)


@lean_njit
def _is_seen_in(runs: Any, z_lo: Any, z_hi: Any, occupied: Any, c: Any, low: Any, high: Any) -> Any:
    """Whether any voxel of column c was seen free in low..high."""
    for r in range(runs[c], runs[c + 1]):
        if z_hi[r] >= low and z_lo[r] <= high and not occupied[r]:
            return True
    return False


@lean_njit
def _stands_near(columns: Any, c: Any, low: Any, high: Any) -> Any:
    """Whether something stands in low..high within two columns of column c."""
    for dx in range(-2, 3):
        for dy in range(-2, 3):
            if lowest_occupied(columns, c + dx * columns.ny + dy, low, high) != NO_VOXEL:
                return True
    return False


@lean_njit
def _may_be_side(columns: Any, surfaces: Any, near: Any, s: Any, c: Any, step: Any, clearance: Any) -> Any:
    """Whether node s of column c is within two columns of what stands there and may be a side of that, which beams passed by.

    Space in the robot's way was seen above it, but nothing right above, up to a step: the foot of a flank that was met from below or lies
    in a shadow, unless nobody knows that it was hit: the robot stood there. Or none was seen, though it was beside.
    """
    if surfaces.is_open[s]:
        return False
    z = np.int64(surfaces.z[s])
    runs, z_lo, z_hi, occupied, low, high = columns.start, columns.z_lo, columns.z_hi, columns.occupied, z + step + 1, z + clearance
    if _is_seen_in(runs, z_lo, z_hi, occupied, c, low, high):
        is_dark = surfaces.measured[s] or surfaces.bridged[s]
        is_dark = is_dark and not _is_seen_in(runs, z_lo, z_hi, occupied, c, z + 1, z + step)
    else:
        is_dark = False
        for k in range(4):
            is_dark |= near[s, k] >= 0 and _is_seen_in(runs, z_lo, z_hi, occupied, c + DX[k] * columns.ny + DY[k], low, high)
    return is_dark and _stands_near(columns, c, low, high)


@njit(cache=True)
def flood(columns: Any, surfaces: Any, links: Any, first: Any, inside: Any, limits: Any) -> Any:
    """(N,) uint8 labels of all nodes reached from `first`, UNREACHED elsewhere, the number of traversable ones, and (N, 4) uint8 of
    what those see in directions without ground.

    Nodes are cliffs, obstacles (too steep; nearly so at a neighbour, too: alone it is a hit or two gone astray) or traversable. Only
    traversable ones are expanded, and only into columns that are `inside` (bool per column).
    """
    column, level = surfaces.column, surfaces.slope_level  # arrays of a tuple are counted at every use
    near, graph = links.near, links.graph
    label, seen = np.full(column.size, UNREACHED, np.uint8), np.empty((column.size, 4), np.uint8)
    queued = np.zeros(column.size, np.bool_)
    waiting = np.empty(column.size, np.int32)
    waiting[0], left, traversable = first, 1, 0
    queued[first] = True
    reach, steepest = limits.slope_reach, limits.steepest
    while left:
        left -= 1
        s = np.int64(waiting[left])
        c = np.int64(column[s])
        label[s] = TRAVERSABLE
        for k in range(4):
            if graph[s, k] < 0:
                label[s] = CLIFF if _is_at_drop(columns, surfaces, near, graph, s, c, limits, seen) else TRAVERSABLE
                break
        if label[s] == CLIFF:
            continue
        kind = steepness_at(links, level, s, reach, steepest)
        is_steep = kind == STEEP or (kind == NEARLY_STEEP and _is_near_steep(surfaces, links, s, limits))
        is_steep = is_steep and not _only_seems_steep(surfaces, columns.ny, links, s, limits)
        if is_steep or _may_be_side(columns, surfaces, near, s, c, limits.step, limits.clearance):
            label[s] = OBSTACLE
            continue
        traversable += 1
        for k in ROW_LAST:
            n = graph[s, k]
            if n >= 0 and not queued[n] and inside[column[n]]:
                queued[n] = True
                waiting[left] = n
                left += 1
    return label, traversable, seen


@njit(cache=True)
def mark_steps(label: Any, near: Any, graph: Any, level: Any) -> Any:
    """Make the upper side of every step that is too high an obstacle, where the flood stood at its foot.

    (M, 2) int64 of these: the node, and the direction in which it lies from its foot; none of ground that is too steep itself.
    """
    foot, found = np.flatnonzero(label == TRAVERSABLE), []
    for s in foot:
        for k in range(4):
            n = near[s, k]
            if n >= 0 and graph[s, k] < 0 and level[n] > level[s] and label[n] != OBSTACLE:
                found.append((np.int64(n), np.int64(k)))
    out = np.empty((len(found), 2), np.int64)
    for i in range(len(found)):
        out[i, 0], out[i, 1] = found[i]
        label[out[i, 0]] = OBSTACLE
    return out


@njit(cache=True)
def steep_edges(label: Any, surfaces: Any, links: Any, steep: Any, ny: Any, unsure: Any, limits: Any) -> Any:
    """(M, 3) x and y in columns and level of where traversable ground gets too steep beside each of the `steep` nodes, or of these.

    Where the slope that is fitted to both would be at its limit between them; `unsure` columns before a node that the fit does not call so.
    """
    reach, limit, level = limits.slope_reach, limits.steepest[1], surfaces.slope_level
    found = []
    for s in steep:
        x, y, z = surfaces.column[s] // ny + 0.5, surfaces.column[s] % ny + 0.5, float(surfaces.z[s])
        own, at_edge = slope_at(links.graph, level, s, reach), False
        for k in range(4):
            n = links.graph[s, k]
            if n < 0 or label[n] != TRAVERSABLE:
                continue
            other, before = slope_at(links.graph, level, n, reach), unsure
            if other < limit < own:
                before = (own - limit) / (own - other)
            found.append((x + before * DX[k], y + before * DY[k], z))
            at_edge = True
        if not at_edge:
            found.append((x, y, z))
    out = np.empty((len(found), 3))
    for i in range(len(found)):
        out[i, 0], out[i, 1], out[i, 2] = found[i]
    return out


@lean_njit
def _stands_at(columns: Any, surfaces: Any, label: Any, c: Any, level: Any, step: Any, clearance: Any) -> Any:
    """Whether something stands at column c, or its ground is too steep or too high a step."""
    if lowest_occupied(columns, c, level + step + 1, level + clearance) != NO_VOXEL:
        return True
    node = find_node(surfaces.start, surfaces.z, c, level, step + 1)
    return node >= 0 and label[node] == OBSTACLE


@lean_njit
def _stands_around(columns: Any, surfaces: Any, label: Any, c: Any, level: Any, step: Any, clearance: Any) -> Any:
    """The same for column c and its four neighbours."""
    if _stands_at(columns, surfaces, label, c, level, step, clearance):
        return True
    for k in range(4):
        if _stands_at(columns, surfaces, label, c + DX[k] * columns.ny + DY[k], level, step, clearance):
            return True
    return False


@lean_njit
def _view_across(columns: Any, surfaces: Any, links: Any, label: Any, inside: Any, s: Any, stride: Any, seen: Any, limits: Any) -> Any:
    """The column of what stands or hangs in the way of node s in steps of `stride` and -1, or the column and the node of a cliff that the
    flood did not reach; -1, -1 where neither comes within the inflation and before ground that it did reach."""
    level = np.int64(surfaces.z[s])
    for j in range(1, limits.inflation + 1):
        c = np.int64(surfaces.column[s]) + j * stride
        n = find_node(surfaces.start, surfaces.z, c, level, _limit(j, limits.step, limits.max_slope))
        if n < 0 and blocking_voxel(columns, c, level, limits.step, limits.clearance) != NO_VOXEL:
            return c, np.int64(-1)
        if n >= 0 and (label[n] != UNREACHED or not inside[c]):
            break
        if n >= 0 and _is_at_drop(columns, surfaces, links.near, links.graph, n, c, limits, seen):
            return c, np.int64(n)
    return np.int64(-1), np.int64(-1)


@lean_njit
def _hangs(columns: Any, c: Any, low: Any, high: Any) -> Any:
    """Whether something within low..high of column c hangs over free space."""
    for r in range(columns.start[c] + 1, columns.start[c + 1]):
        is_within = columns.z_lo[r] <= high and columns.z_hi[r] >= low
        if is_within and columns.occupied[r] and not columns.occupied[r - 1] and columns.z_hi[r - 1] >= columns.z_lo[r] - 2:
            return True
    return False


@lean_njit
def _may_hang_over(columns: Any, c: Any, low: Any, high: Any) -> Any:
    """Lowest voxel within low..high of column c that is unknown between free space, beside what hangs at that height; NO_VOXEL when there
    is none."""
    for r in range(columns.start[c] + 1, columns.start[c + 1]):
        bottom, top = np.int64(columns.z_hi[r - 1]) + 1, np.int64(columns.z_lo[r]) - 1
        if top < bottom or bottom < low or top > high or columns.occupied[r - 1] or columns.occupied[r]:
            continue
        for k in range(4):
            if _hangs(columns, c + DX[k] * columns.ny + DY[k], bottom - 1, top + 1):
                return bottom
    return NO_VOXEL


@njit(cache=True)
def barriers_seen(columns: Any, surfaces: Any, links: Any, label: Any, inside: Any, seen: Any, limits: Any) -> Any:
    """What ends the ground beside the traversable one: (M, 4) int64 (column, voxel, level of the ground in front, voxel that stands or
    hangs in the way) of obstacles, and (C,) int64 nodes of cliffs that the flood did not reach, some more than once.

    Across unknown ground, and across such as the flood did not reach, the view goes on as far as the inflation: a wall behind a strip that
    was not seen still needs its distance, and so does a drop, in columns that are `inside` (bool per column). Unknown ground right before
    something that stands may be a side of it that no beam has met: an obstacle with NO_VOXEL in the way, and in `seen` from now on.
    So is what may hang over ground as the end of a bar, with PASSED.
    """
    column, z, near, graph = surfaces.column, surfaces.z, links.near, links.graph
    step, clearance = limits.step, limits.clearance
    found, cliffs = [], []
    for s in range(z.size):
        if label[s] != TRAVERSABLE:
            continue
        level = np.int64(z[s])
        hangs: Any = NO_VOXEL
        if not surfaces.is_open[s]:
            hangs = _may_hang_over(columns, np.int64(column[s]), level + step + 1, level + clearance)
        if hangs != NO_VOXEL:
            found.append((np.int64(column[s]), np.int64(hangs), level, np.int64(PASSED)))
        for k in range(4):
            stride = DX[k] * columns.ny + DY[k]
            is_unknown = graph[s, k] < 0 and (seen[s, k] == SEES_UNKNOWN or seen[s, k] == SEES_EDGE)
            if is_unknown and _stands_around(columns, surfaces, label, column[s] + 2 * stride, level, step, clearance):
                found.append((np.int64(column[s] + stride), level, level, np.int64(NO_VOXEL)))
                seen[s, k] = SEES_OBSTACLE
            if near[s, k] >= 0:
                continue
            c, n = _view_across(columns, surfaces, links, label, inside, s, stride, seen, limits)
            if n >= 0:
                cliffs.append(n)
            elif c >= 0:
                voxel, floor = blocking_voxel(columns, c, level, step, clearance), top_near(columns, c, level, step)
                way = lowest_occupied(columns, c, level + step + 1, level + clearance)
                # Under a low ceiling it is the floor that cannot be driven on.
                found.append((c, np.int64(voxel if floor == NO_VOXEL else floor), level, np.int64(way)))
    out = np.empty((len(found), 4), np.int64)
    for i in range(len(found)):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = found[i]
    return out, np.array(cliffs, dtype=np.int64)


@lean_njit
def _is_within(dx: Any, dy: Any, most: Any, along_x: Any, along_y: Any, per_square: Any) -> Any:
    """Whether a place dx, dy from the middle of a line is within `most` of it; `per_square` is 1 by the square of its half length."""
    along = min(1.0, max(-1.0, (dx * along_x + dy * along_y) * per_square))
    off_x, off_y = dx - along * along_x, dy - along * along_y
    return off_x * off_x + off_y * off_y <= most * most


@lean_njit
def _extent_of(reach: Any, i: Any) -> Any:
    """How far barrier i extends: x and y to the end of a line from its middle, 1 by the square of that, and how far around it."""
    if len(reach) == 0:
        return 0.0, 0.0, 0.0, 0.0
    x, y = reach[i, 0], reach[i, 1]
    square = x * x + y * y
    return x, y, 1.0 / square if square > 0.0 else 0.0, reach[i, 2]


@njit(cache=True)
def inflate(label: Any, surfaces: Any, places: Any, reach: Any, radius: Any, square: Any, band: Any, nx: Any, ny: Any) -> None:
    """Turn traversable nodes into inflation whose column's middle is within `radius` of a barrier, at most `band` voxels up or down.

    `places` (M, 3) float: x, y and level of the barriers in voxels of the window; `reach` (M, 3): how far they extend, x and y to the end
    of a line from there and how far around it, or (0, 3) where none does; `square`: within `radius` along both axes.
    """
    start, column, z, slack = surfaces.start, surfaces.column, surfaces.z, 1e-6
    for i in range(len(places)):
        x, y, level = places[i, 0] - 0.5, places[i, 1] - 0.5, places[i, 2]
        along_x, along_y, per_square, around = _extent_of(reach, i)
        is_line = per_square > 0.0 and not square
        near = radius + around
        most = near + np.hypot(along_x, along_y)
        for jx in range(max(0, int(np.ceil(x - most - slack))), min(nx, int(np.floor(x + most + slack)) + 1)):
            dx = jx - x
            half = slack + (most if square else np.sqrt(max(0.0, most**2 - dx**2)))
            first, end = max(0, int(np.ceil(y - half))), min(ny, int(np.floor(y + half)) + 1)
            for n in range(start[jx * ny + first], start[jx * ny + end]):
                if label[n] == TRAVERSABLE and abs(z[n] - level) <= band:
                    if not is_line or _is_within(dx, column[n] - jx * ny - y, near + slack, along_x, along_y, per_square):
                        label[n] = INFLATION


@njit(cache=True)
def components(label: Any, graph: Any, first: Any, enough: Any) -> Any:
    """(N,) int32 component of every traversable node, -1 elsewhere, and the (C,) size of each, that of the node `first` before others.

    Where that has `enough` nodes it is the only one that is looked for.
    """
    component = np.full(label.size, -1, np.int32)
    waiting = np.empty(label.size, np.int32)
    sizes: list[int] = []
    for i in range(-1, label.size):
        seed = first if i < 0 else i
        if label[seed] != TRAVERSABLE or component[seed] >= 0:
            continue
        waiting[0], left, size = seed, 1, 1
        component[seed] = len(sizes)
        while left:
            left -= 1
            s = waiting[left]
            for k in ROW_LAST:
                n = graph[s, k]
                if n >= 0 and label[n] == TRAVERSABLE and component[n] < 0:
                    component[n] = len(sizes)
                    waiting[left] = n
                    left += 1
                    size += 1
        sizes.append(size)
        if i < 0 and size >= enough:
            break
    return component, np.array(sizes, dtype=np.int64)


@njit(cache=True)
def leave_out(component: Any, is_kept: Any) -> None:
    """Turns (N,) components into -1, none, that are not kept (C,)."""
    for s in range(component.size):
        if component[s] >= 0 and not is_kept[component[s]]:
            component[s] = -1


@njit(cache=True)
def hops_from(seeds: Any, passable: Any, graph: Any, most: Any) -> Any:
    """(N,) int32 number of edges from the nearest seed through passable nodes, `most` where it is farther."""
    hops = np.full(passable.size, most, np.int32)
    queue = np.empty(passable.size, np.int32)
    first = np.flatnonzero(seeds)
    hops[first] = 0
    queue[: first.size] = first
    head, tail = 0, first.size
    while head < tail:
        s = queue[head]
        head += 1
        if hops[s] + 1 >= most:
            continue
        for k in range(4):
            n = graph[s, k]
            if n >= 0 and passable[n] and hops[n] > hops[s] + 1:
                hops[n] = hops[s] + 1
                queue[tail] = n
                tail += 1
    return hops


@lean_njit
def _is_reached(start: Any, z: Any, label: Any, c: Any, level: Any, rise: Any) -> Any:
    """Whether the flood has reached ground at about this level some other way, in column c."""
    node = find_node(start, z, c, level, rise)
    return node >= 0 and label[node] != UNREACHED


@njit(cache=True)
def unknown_edges(columns: Any, surfaces: Any, label: Any, graph: Any, inside: Any, seen: Any, step: Any, clearance: Any) -> Any:
    """(M, 6) int64 (column, z, node it was seen from, direction, what was seen, whether it is a gap) of unknown floor beside drivable
    ground in columns that are `inside` (bool per column): frontier voxels, and gaps before ground that the flood has reached some other way
    and within two columns of what stands, which no look is taken for and in which a side of that may be.

    The two-step test of thesis figure 5.13: no ground in a direction, and for a frontier nothing known around one step further; where
    something stands there `barriers_seen` found a side of it. Ground that the flood did not reach is what the look is for: a deck seen from
    below only, a slope behind a gap.
    """
    start, column, z = surfaces.start, surfaces.column, surfaces.z
    found = []
    for s in range(z.size):
        if (label[s] != TRAVERSABLE and label[s] != INFLATION) or not inside[column[s]]:
            continue
        for k in range(4):
            if graph[s, k] >= 0 or (seen[s, k] != SEES_UNKNOWN and seen[s, k] != SEES_EDGE):
                continue
            c, level, stride = np.int64(column[s]), np.int64(z[s]), DX[k] * columns.ny + DY[k]
            ends = _is_reached(start, z, label, c + 2 * stride, level, step + 1)
            for side in range(4):
                ends = ends or _is_reached(start, z, label, c + 2 * stride + DX[side] * columns.ny + DY[side], level, step + 1)
            if not ends or _stands_near(columns, c + stride, level + step + 1, level + clearance):
                found.append((c + stride, level, np.int64(s), np.int64(k), np.int64(seen[s, k]), np.int64(ends)))
    out = np.empty((len(found), 6), np.int64)
    for i in range(len(found)):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4], out[i, 5] = found[i]
    return out
