"""The ground that the robot can reach, from the world's true mesh alone.

First step of the judge: it needs no run, and it shares nothing with the terrain classifier that it judges. The mesh is
pierced by vertical rays on a grid, and every surface with enough room above it becomes a node, so that floors over
floors are kept apart. Nodes of neighbouring columns are linked when the step between them can be climbed. Everything
that ends a link (a wall, a drop, a low ceiling) and everything too steep is a barrier; a robot centre keeps its
circumscribed radius from barriers, and what such centres reach from the start is the reachable ground (thesis 7.2:
ground on which the robot cannot turn in place does not count).

Surfaces count with either side up, because the winding of meshes found in the wild cannot be relied upon; the inside
of a solid is kept out by its side faces, which end all links to it.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from exploration_evaluation.config import RobotShape
from exploration_evaluation.mesh import RayScene, checked_mesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

_MAX_COLUMNS = 16_000_000
_RAYS_AT_ONCE = 400_000
# Rays through cell centres would run along the edges of meshes with round coordinates, where a hit is a matter of luck.
_OFF_CENTRE = (0.0037, 0.0023)
_SAME_SURFACE_M = 0.01
_STEPS = np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])  # +x, -x, +y, -y: opposite directions are neighbours
_BODY_HEIGHTS = 5
_HALF_WHEELBASE_M = 0.2
_PARTS_OF_CELL = 10  # in which the end of the ground is looked for
_EDGE_RAD = 0.3  # by which a face is steeper than the ground beside it where both meet at an edge
_START_SEARCH_M = 1.5


@dataclass(frozen=True)
class ReachableGround:
    """Ground that the robot can reach; areas are horizontal projections, each level counted for itself.

    points (N, 3): cells of ground, world frame, over which the robot's centre can be and turn in place.
    covered_points (K, 3): cells under the body (its inscribed circle) in any of these places; they include `points`.
    links (N, 4): index of the point one cell along +x, -x, +y and -y that is driven to from each point; -1 where none is.
    """

    points: Floats
    covered_points: Floats
    cell_area_m2: float
    links: Ints

    @property
    def area_m2(self) -> float:
        """Area of the places of the centre."""
        return len(self.points) * self.cell_area_m2

    @property
    def covered_area_m2(self) -> float:
        """Area of the ground under the body."""
        return len(self.covered_points) * self.cell_area_m2


@dataclass(frozen=True)
class _Grid:
    """Columns over the mesh: column c has indices (c // ny, c % ny); cells are aligned to multiples of their size."""

    origin: Floats
    nx: int
    ny: int
    cell: float

    def centres(self) -> Floats:
        """(nx * ny, 2) where the columns' rays go down."""
        c = np.arange(self.nx * self.ny)
        return self.origin + (np.column_stack([c // self.ny, c % self.ny]) + 0.5) * self.cell + np.array(_OFF_CENTRE) * self.cell

    def columns_of(self, xy: Floats) -> Ints:
        """(N,) column of each (N, 2) point, -1 outside."""
        i, j = np.floor((xy - self.origin) / self.cell).astype(np.int64).T
        inside = (i >= 0) & (i < self.nx) & (j >= 0) & (j < self.ny)
        return np.where(inside, i * self.ny + j, -1)


@dataclass(frozen=True)
class _Nodes:
    """Surfaces with headroom, ordered by column and height; `first[c]:first[c + 1]` are those of column c.

    slope is that of the triangle, steepness what the robot feels of it: over its wheelbase, between faces that are none too steep, or in
    itself and beside itself. A pebble's flank, lower than a step, is steep in itself only; a rock's, from which
    no ground goes on, is steep.
    """

    xyz: Floats
    column: Ints
    first: Ints
    slope: Floats
    steepness: Floats


def reachable_ground(
    vertices: ArrayLike, triangles: ArrayLike, start_xyz: ArrayLike, robot: RobotShape | None = None, cell_m: float = 0.10
) -> ReachableGround:
    """The ground of a mesh that a robot can reach from a start and turn on, level by level.

    vertices (V, 3) metres and triangles (T, 3) indices in the world frame; start_xyz (3,) a point of the robot at its
    start, not below the ground and at most half a metre above it. ValueError for a mesh that is none, one too large
    for the grid, or when there is no ground, or no room, at the start.
    """
    robot = robot or RobotShape()
    mesh = checked_mesh(vertices, triangles)
    scene = RayScene(*mesh)
    grid = _grid_over(mesh[0], cell_m)
    surfaces = _surfaces(scene, grid, mesh, robot)
    nodes = _without_steep(surfaces, robot)
    ends, links = _ends_of_ground(scene, grid, surfaces, nodes, mesh, robot)
    barriers = np.vstack([ends, _thin_things(grid, nodes, mesh, robot)])
    level_m = robot.circumscribed_radius_m * math.tan(robot.max_slope_rad) + robot.max_step_m
    room = ~_near(grid, nodes, barriers, robot.circumscribed_radius_m - 1e-6, level_m)
    start = _start_node(nodes, links, room, np.asarray(start_xyz, dtype=np.float64))
    components = _components(links, room)
    reached = room & (components == components[start])
    covered = _near(grid, nodes, nodes.xyz[reached], robot.inscribed_radius_m + 1e-6, level_m)
    return ReachableGround(nodes.xyz[reached], nodes.xyz[covered | reached], grid.cell**2, _among(links, reached))


def _grid_over(vertices: Floats, cell: float) -> _Grid:
    if not (math.isfinite(cell) and cell > 0):
        raise ValueError(f"a cell needs a positive size in metres, not {cell}")
    low = np.floor(vertices[:, :2].min(axis=0) / cell + 1e-6)
    nx, ny = np.maximum(1, np.ceil(vertices[:, :2].max(axis=0) / cell - 1e-6) - low).astype(int)
    if int(nx) * int(ny) > _MAX_COLUMNS:
        raise ValueError(f"the world has {nx} x {ny} columns of {cell} m; at most {_MAX_COLUMNS} are judged")
    return _Grid(low * cell, int(nx), int(ny), cell)


def _surfaces(scene: RayScene, grid: _Grid, mesh: tuple[Floats, Ints], robot: RobotShape) -> _Nodes:
    """All surfaces with headroom, steep ones too."""
    column, z, triangle = _floors(scene, grid.centres(), mesh, robot)
    first, slope = _first_of(column, grid.nx * grid.ny), _slopes(*mesh)[triangle]
    links = _links(grid, column, first, z, robot.max_step_m)
    there = links >= 0
    goes_on = (there[:, 0] | there[:, 1]) & (there[:, 2] | there[:, 3])  # along both axes
    in_itself = np.where(goes_on, np.minimum(slope, _mean_slope(z, links, grid.cell, 1, least=1)), slope)
    half = max(1, round(_HALF_WHEELBASE_M / grid.cell))
    is_face = in_itself > _steepest(robot)
    between = np.where(is_face[links] | is_face[:, None], -1, links)
    steepness = np.maximum(in_itself, _mean_slope(z, between, grid.cell, half, least=2 * half))
    return _Nodes(np.column_stack([grid.centres()[column], z]), column, first, slope, steepness)


def _first_of(group: Ints, groups: int) -> Ints:
    """(G + 1,) where each of the groups begins in their ascending numbers."""
    return np.searchsorted(group, np.arange(groups + 1)).astype(np.int64)


def _floors(scene: RayScene, places_xy: Floats, mesh: tuple[Floats, Ints], robot: RobotShape) -> tuple[Ints, Floats, Ints]:
    """Place, height and triangle of every surface with headroom at (N, 2) places, ordered by place and height."""
    place, z, triangle = _vertical_hits(scene, places_xy, float(mesh[0][:, 2].max()) + 1.0)
    above_is_same_place = np.append(place[1:] == place[:-1], False)
    gap = np.where(above_is_same_place, np.append(z[1:], np.inf) - z, np.inf)
    # Of faces that coincide (a box on a floor) the topmost stands for all.
    distinct = gap > _SAME_SURFACE_M
    place, z, triangle, gap = place[distinct], z[distinct], triangle[distinct], gap[distinct]
    floor = gap >= robot.headroom_m
    return place[floor], z[floor], triangle[floor]


def _vertical_hits(scene: RayScene, places_xy: Floats, top_z: float) -> tuple[Ints, Floats, Ints]:
    """Place, height and triangle of every crossing, ordered by place and height."""
    places, heights, triangles = [], [], []
    for begin in range(0, len(places_xy), _RAYS_AT_ONCE):
        xy = places_xy[begin : begin + _RAYS_AT_ONCE]
        down = np.tile([top_z, 0.0, 0.0, -1.0], (len(xy), 1))
        ray, depth, triangle = scene.crossings(np.column_stack([xy, down]))
        places.append(ray + begin)
        heights.append(top_z - depth)
        triangles.append(triangle)
    place, z = np.concatenate(places), np.concatenate(heights)
    order = np.lexsort((z, place))
    return place[order], z[order], np.concatenate(triangles)[order]


def _slopes(vertices: Floats, triangles: Ints) -> Floats:
    """(T,) angle of each triangle against the horizontal, whichever side is up; vertical where it has no area."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1)
    return np.arccos(np.clip(np.abs(normals[:, 2]) / np.where(length > 0, length, np.inf), 0.0, 1.0))


def _neighbour_columns(grid: _Grid, column: Ints, direction: int) -> Ints:
    i, j = column // grid.ny + _STEPS[direction, 0], column % grid.ny + _STEPS[direction, 1]
    inside = (i >= 0) & (i < grid.nx) & (j >= 0) & (j < grid.ny)
    return np.where(inside, i * grid.ny + j, -1)


def _links(grid: _Grid, column: Ints, first: Ints, z: Floats, max_step_m: float) -> Ints:
    """(M, 4) the surface nearest in height in each neighbouring column, -1 where the step is too high."""
    beside = (_neighbour_columns(grid, column, direction) for direction in range(4))
    return np.stack([_nearest_in_height(first, z, neighbour, z, max_step_m) for neighbour in beside], axis=1)


def _nearest_in_height(first: Ints, z: Floats, group: Ints, level: Floats, reach_m: float) -> Ints:
    """(N,) index of the z of each of (N,) groups, -1 for none, that is nearest to a level, -1 where all are farther than the reach."""
    begin, end = first[group], np.where(group < 0, 0, first[group + 1])
    nearest, best = np.full(len(group), -1, dtype=np.int64), np.full(len(group), reach_m + 1e-4)
    for layer in range(int(max(0, (end - begin).max(initial=0)))):
        there = np.flatnonzero(begin + layer < end)
        step = np.abs(z[begin[there] + layer] - level[there])
        nearer = step < best[there]
        best[there[nearer]] = step[nearer]
        nearest[there[nearer]] = begin[there[nearer]] + layer
    return nearest


def _mean_slope(z: Floats, links: Ints, cell: float, reach: int, least: int) -> Floats:
    """(M,) slope averaged over `reach` cells to either side, as far as the ground is connected; level along an axis on which that is less
    than `least` cells: half a wheelbase beside a wall would take a ledge for a slope.
    """
    gradient = np.zeros((2, len(z)))
    for axis in range(2):
        ends, run = [], np.zeros(len(z))
        for direction in (2 * axis, 2 * axis + 1):
            at = np.arange(len(z))
            for _ in range(reach):
                onward = links[at, direction]
                run += onward >= 0
                at = np.where(onward >= 0, onward, at)
            ends.append(z[at])
        gradient[axis] = np.where(run >= least, ends[0] - ends[1], 0.0) / (np.maximum(run, 1) * cell)
    return np.asarray(np.arctan(np.hypot(gradient[0], gradient[1])))


def _steepest(robot: RobotShape) -> float:
    return robot.max_slope_rad + 1e-3


def _without_steep(surfaces: _Nodes, robot: RobotShape) -> _Nodes:
    """The ground that is left."""
    kept = surfaces.steepness <= _steepest(robot)
    column = surfaces.column[kept]
    first = _first_of(column, len(surfaces.first) - 1)
    return _Nodes(surfaces.xyz[kept], column, first, surfaces.slope[kept], surfaces.steepness[kept])


def _ends_of_ground(
    scene: RayScene, grid: _Grid, surfaces: _Nodes, nodes: _Nodes, mesh: tuple[Floats, Ints], robot: RobotShape
) -> tuple[Floats, Ints]:
    """(B, 3) points, at their node's height, where ground ends or something stands on it; and the (M, 4) links that are left.

    Short horizontal rays at several heights of the body find things between the columns, and find them exactly; `_ends_between` finds
    where it ends that nothing stands on.
    """
    links = _links(grid, nodes.column, nodes.first, nodes.xyz[:, 2], robot.max_step_m)
    points, kept = [], links.copy()
    for direction in range(4):
        step = _STEPS[direction] * grid.cell
        linked = links[:, direction] >= 0
        rise = np.where(linked, nodes.xyz[links[:, direction], 2] - nodes.xyz[:, 2], 0.0)
        free = _free_fraction(scene, nodes.xyz, np.column_stack([np.tile(step, (len(rise), 1)), rise]), robot)
        ended = ~linked | (free <= 1.0)
        kept[ended, direction] = -1
        share = free[ended]
        open_ends = np.flatnonzero(ended)[share > 1.0]
        share[share > 1.0] = _ends_between(scene, grid, surfaces, nodes, open_ends, direction, mesh, robot)
        end = nodes.xyz[ended].copy()
        end[:, :2] += share[:, None] * step
        points.append(end)
    return np.vstack(points), kept


def _ends_between(
    scene: RayScene, grid: _Grid, surfaces: _Nodes, nodes: _Nodes, node: Ints, direction: int, mesh: tuple[Floats, Ints], robot: RobotShape
) -> Floats:
    """(N,) at which part of the way to the next column the ground of each node ends, as a drop, below a ceiling or as too steep a slope.

    Drops, ceilings and faces that begin at an edge are looked for by vertical rays between the columns. Where ground gets too steep by and
    by it ends where the steepness between both columns would be at its limit; a steep flank above the floor is none that this leads to.
    """
    z = nodes.xyz[node, 2]
    beyond = _nearest_in_height(surfaces.first, surfaces.xyz[:, 2], _neighbour_columns(grid, nodes.column[node], direction), z, grid.cell)
    here, there = nodes.steepness[node], np.where(beyond >= 0, surfaces.steepness[beyond], 0.0)
    is_steep = there > _steepest(robot)
    last, face = _last_floor(scene, nodes.xyz[node], nodes.slope[node], _STEPS[direction] * grid.cell, mesh, robot)
    by_and_by = np.where(is_steep, (_steepest(robot) - here) / np.where(is_steep, there - here, 1.0), 0.5)
    return np.where(np.isfinite(face) & (is_steep | np.isinf(last)), face, np.where(np.isinf(last), by_and_by, last))


def _last_floor(
    scene: RayScene, ground: Floats, slope: Floats, step_xy: Floats, mesh: tuple[Floats, Ints], robot: RobotShape
) -> tuple[Floats, Floats]:
    """(N,) part of a step from (N, 3) points of the ground over which there is floor with headroom, inf where that goes on all the way; and
    part of it at which the last edge to a much steeper face lies, inf where there is none."""
    if not len(ground):
        return np.zeros(0), np.zeros(0)
    shares = np.arange(1, _PARTS_OF_CELL + 1) / _PARTS_OF_CELL
    places = ground[:, None, :2] + shares[None, :, None] * step_xy
    place, floors, triangle = _floors(scene, places.reshape(-1, 2), mesh, robot)
    first, slopes = _first_of(place, len(ground) * len(shares)), _slopes(*mesh)[triangle]
    level, slope, left = ground[:, 2].copy(), slope.copy(), np.arange(len(ground))
    end, face = np.full((2, len(ground)), np.inf)
    for part, share in enumerate(shares):
        floor = _nearest_in_height(first, floors, left * len(shares) + part, level[left], robot.max_step_m)
        middle = share - 0.5 / _PARTS_OF_CELL
        end[left[floor < 0]] = middle
        left, floor = left[floor >= 0], floor[floor >= 0]
        face[left[(slopes[floor] > _steepest(robot)) & (slopes[floor] > slope[left] + _EDGE_RAD)]] = middle
        level[left], slope[left] = floors[floor], slopes[floor]
    return end, face


def _free_fraction(scene: RayScene, ground: Floats, steps: Floats, robot: RobotShape) -> Floats:
    """(M,) part of each (M, 3) step from a point of the ground that the body's side can go freely; inf for all of it."""
    free = np.full(len(ground), np.inf)
    for height in np.linspace(robot.ground_clearance_m, robot.height_m, _BODY_HEIGHTS):
        free = np.minimum(free, scene.first_hits(np.column_stack([ground + [0.0, 0.0, height], steps])))
    return np.where(free <= 1.0, free, np.inf)


def _thin_things(grid: _Grid, nodes: _Nodes, mesh: tuple[Floats, Ints], robot: RobotShape) -> Floats:
    """(B, 3) barriers where edges of steep faces rise out of the ground: posts so thin that all rays miss them."""
    column, xyz = _samples_of_steep_edges(grid, mesh, robot.max_slope_rad)
    begin, end = nodes.first[column], nodes.first[column + 1]
    found = []
    for layer in range(int(max(0, (end - begin).max(initial=0)))):
        there = begin + layer < end
        ground = nodes.xyz[begin[there] + layer, 2]
        above = xyz[there, 2] - ground
        stands = (above > robot.ground_clearance_m) & (above <= robot.height_m)
        found.append(np.column_stack([xyz[there][stands, :2], ground[stands]]))
    return np.vstack([np.empty((0, 3)), *found])


def _samples_of_steep_edges(grid: _Grid, mesh: tuple[Floats, Ints], max_slope_rad: float) -> tuple[Ints, Floats]:
    """Column and (S, 3) position of points every half cell along the edges of steep triangles."""
    vertices, triangles = mesh
    steep = triangles[_slopes(vertices, triangles) > max_slope_rad]
    edges = np.unique(np.sort(np.vstack([steep[:, [0, 1]], steep[:, [1, 2]], steep[:, [2, 0]]]), axis=1), axis=0)
    a, b = vertices[edges[:, 0]], vertices[edges[:, 1]]
    pieces = np.maximum(1, np.ceil(np.linalg.norm(b - a, axis=1) / (0.5 * grid.cell))).astype(np.int64)
    edge = np.repeat(np.arange(len(edges)), pieces + 1)
    number = np.arange(len(edge)) - np.repeat(np.cumsum(pieces + 1) - (pieces + 1), pieces + 1)
    xyz = a[edge] + (number / pieces[edge])[:, None] * (b - a)[edge]
    column = grid.columns_of(xyz[:, :2])
    return column[column >= 0], xyz[column >= 0]


def _near(grid: _Grid, nodes: _Nodes, seeds: Floats, radius_m: float, level_m: float) -> Mask:
    """(M,) nodes within a horizontal distance of any of the (S, 3) seeds that lies on about the same level."""
    near = np.zeros(len(nodes.column), dtype=np.bool_)
    shape = np.array([grid.nx, grid.ny], dtype=np.int64)
    _mark_near(nodes.xyz, nodes.first, np.ascontiguousarray(seeds), grid.origin, shape, grid.cell, radius_m, level_m, near)
    return near


@njit(cache=True)
def _mark_near(
    xyz: Floats, first: Ints, seeds: Floats, origin: Floats, shape: Ints, cell: float, radius: float, level: float, near: Mask
) -> None:
    reach = int(radius / cell) + 1
    for s in range(seeds.shape[0]):
        i0 = int(math.floor((seeds[s, 0] - origin[0]) / cell))
        j0 = int(math.floor((seeds[s, 1] - origin[1]) / cell))
        for i in range(max(0, i0 - reach), min(shape[0], i0 + reach + 1)):
            for j in range(max(0, j0 - reach), min(shape[1], j0 + reach + 1)):
                for n in range(first[i * shape[1] + j], first[i * shape[1] + j + 1]):
                    dx, dy = xyz[n, 0] - seeds[s, 0], xyz[n, 1] - seeds[s, 1]
                    if dx * dx + dy * dy <= radius * radius and abs(xyz[n, 2] - seeds[s, 2]) <= level:
                        near[n] = True


def _components(links: Ints, usable: Mask) -> Ints:
    """(M,) number of the connected piece of each node, over links between usable ones."""
    a = np.repeat(np.arange(len(links)), 4)
    b = links.ravel()
    both = (b >= 0) & usable[a] & usable[b]
    graph = coo_array((np.ones(int(both.sum()), dtype=np.int8), (a[both], b[both])), shape=(len(links), len(links)))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _among(links: Ints, kept: Mask) -> Ints:
    """(K, 4) links between the K nodes that are kept, by their numbers among these."""
    number = np.where(kept, np.cumsum(kept) - 1, -1)
    return np.where(links[kept] >= 0, number[links[kept]], -1)


def _start_node(nodes: _Nodes, links: Ints, room: Mask, start_xyz: Floats) -> int:
    """The place of the centre nearest to the start, on ground that is connected with it."""
    if start_xyz.shape != (3,) or not np.isfinite(start_xyz).all():
        raise ValueError(f"a start is a finite x, y, z, not {start_xyz!r}")
    away = np.linalg.norm(nodes.xyz[:, :2] - start_xyz[:2], axis=1)
    below = start_xyz[2] - nodes.xyz[:, 2]
    under = np.flatnonzero((away < 0.3) & (below > -0.1) & (below < 0.5))
    if not len(under):
        raise ValueError(f"no ground to stand on at the start {start_xyz.round(2).tolist()}")
    piece = _components(links, np.ones(len(room), dtype=np.bool_))
    places = np.flatnonzero(room & (away <= _START_SEARCH_M) & (piece == piece[under[np.argmin(away[under])]]))
    if not len(places):
        raise ValueError(f"no room to turn within {_START_SEARCH_M} m of the start {start_xyz.round(2).tolist()}")
    return int(places[np.argmin(away[places])])
