"""The surfaces of a mesh on which a robot may stand: pierced by vertical rays, bridged at seams, with the slope that a robot feels.

One ray a column finds a surface exactly. Where ground ends beside a column, finer rays look whether that is a seam that no wheel falls
into.
Surfaces count with either side up, because the winding of meshes found in the wild cannot be relied upon.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from exploration_evaluation.config import RobotShape
from exploration_evaluation.ground_grid import (
    SAME_HEIGHT_M,
    Floats,
    Grid,
    Ints,
    Mask,
    Surfaces,
    columns_at,
    first_of,
    links_between,
    nearest_in_height,
    surfaces_of,
)
from exploration_evaluation.mesh import RayScene

_RAYS_AT_ONCE = 400_000
_SAME_SURFACE_M = 0.01
_BODY_HEIGHTS = 5
_HALF_WHEELBASE_M = 0.2
_FINE_M = 0.01  # between the rays that look into a seam
_DIRECTIONS = np.array([[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, -1], [1, -1], [-1, 1]])


@dataclass(frozen=True)
class TrueWorld:
    """What the judge looks at: (V, 3) vertices and (T, 3) triangles, the same as a scene for rays, and the columns over it."""

    vertices: Floats
    triangles: Ints
    scene: RayScene
    grid: Grid

    @cached_property
    def slopes(self) -> Floats:
        """(T,) angle of each triangle against the horizontal, whichever side is up; vertical where it has no area."""
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        length = np.linalg.norm(normals, axis=1)
        return np.asarray(np.arccos(np.clip(np.abs(normals[:, 2]) / np.where(length > 0, length, np.inf), 0.0, 1.0)))

    def floors(self, places_xy: Floats, headroom_m: float) -> tuple[Ints, Floats, Ints]:
        """Place, height and triangle of every surface with headroom at (N, 2) places, ordered by place and height."""
        place, z, triangle = self._vertical_hits(places_xy)
        above_is_same_place = np.append(place[1:] == place[:-1], False)
        gap = np.where(above_is_same_place, np.append(z[1:], np.inf) - z, np.inf)
        # Of faces that coincide (a box on a floor) the topmost stands for all.
        distinct = gap > _SAME_SURFACE_M
        place, z, triangle, gap = place[distinct], z[distinct], triangle[distinct], gap[distinct]
        floor = gap >= headroom_m
        return place[floor], z[floor], triangle[floor]

    def free_fraction(self, ground: Floats, steps: Floats, robot: RobotShape) -> Floats:
        """(M,) part of each (M, 3) step from a point of the ground that the body's side can go freely; inf for all of it."""
        free = np.full(len(ground), np.inf)
        for height in np.linspace(robot.ground_clearance_m, robot.height_m, _BODY_HEIGHTS):
            free = np.minimum(free, self.scene.first_hits(np.column_stack([ground + [0.0, 0.0, height], steps])))
        return np.where(free <= 1.0, free, np.inf)

    def _vertical_hits(self, places_xy: Floats) -> tuple[Ints, Floats, Ints]:
        """Place, height and triangle of every crossing, ordered by place and height."""
        top_z = float(self.vertices[:, 2].max()) + 1.0
        places, heights, triangles = [], [], []
        for begin in range(0, len(places_xy), _RAYS_AT_ONCE):
            xy = places_xy[begin : begin + _RAYS_AT_ONCE]
            down = np.tile([top_z, 0.0, 0.0, -1.0], (len(xy), 1))
            ray, depth, triangle = self.scene.crossings(np.column_stack([xy, down]))
            places.append(ray + begin)
            heights.append(top_z - depth)
            triangles.append(triangle)
        place, z = np.concatenate(places), np.concatenate(heights)
        order = np.lexsort((z, place))
        return place[order], z[order], np.concatenate(triangles)[order]


def steepest(robot: RobotShape) -> float:
    """The steepest ground that is driven, with the float's error."""
    return robot.max_slope_rad + 1e-3


def all_surfaces(world: TrueWorld, robot: RobotShape) -> Surfaces:
    """All surfaces with headroom, steep ones too."""
    grid = world.grid
    column, z, triangle = world.floors(grid.centres(), robot.headroom_m)
    pierced = _Pierced(column, z, world.slopes[triangle])
    column, z, slope = _with_seams_bridged(world, pierced, robot)
    first = first_of(column, grid.nx * grid.ny)
    links = ground_links(grid, column, first, z, slope, robot)
    return surfaces_of(grid, column, z, slope, _steepness(grid, z, slope, links, robot))


def _steepness(grid: Grid, z: Floats, slope: Floats, links: Ints, robot: RobotShape) -> Floats:
    there = links >= 0
    goes_on = (there[:, 0] | there[:, 1]) & (there[:, 2] | there[:, 3])  # along both axes
    in_itself = np.where(goes_on, np.minimum(slope, _mean_slope(z, links, grid.cell, 1, least=1)), slope)
    half = max(1, round(_HALF_WHEELBASE_M / grid.cell))
    is_face = in_itself > steepest(robot)
    between = np.where(is_face[links] | is_face[:, None], -1, links)
    return np.maximum(in_itself, _mean_slope(z, between, grid.cell, half, least=2 * half))


def ground_links(grid: Grid, column: Ints, first: Ints, z: Floats, slope: Floats, robot: RobotShape) -> Ints:
    """(M, 4) the surface nearest in height in each neighbouring column, -1 where the ground jumps by more than a step.

    What the slope of either surface explains is no jump: over a cell a slope may rise by more than a low robot's step.
    """
    links = links_between(grid, column, first, z, robot.rise_m(grid.cell))
    explained = grid.cell * np.tan(np.minimum(slope, steepest(robot)))
    most = np.maximum(robot.max_step_m, np.maximum(explained[links], explained[:, None]))
    return np.where((links >= 0) & (np.abs(z[links] - z[:, None]) <= most + SAME_HEIGHT_M), links, -1)


def without_steep(surfaces: Surfaces, robot: RobotShape) -> Surfaces:
    """The ground that is left."""
    return surfaces.some(surfaces.steepness <= steepest(robot))


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


@dataclass(frozen=True)
class _Pierced:
    """(M,) column, height and slope of surfaces, ordered by column and height."""

    column: Ints
    z: Floats
    slope: Floats


def _with_seams_bridged(world: TrueWorld, found: _Pierced, robot: RobotShape) -> tuple[Ints, Floats, Floats]:
    """(M,) column, height and slope of the surfaces, and of more where a column's ray fell into a seam narrower than a wheel."""
    grid = world.grid
    first = first_of(found.column, grid.nx * grid.ny)
    columns, levels, slopes = [found.column], [found.z], [found.slope]
    for step in _DIRECTIONS:
        beyond = columns_at(grid, found.column, step)
        alone = np.flatnonzero((beyond >= 0) & (nearest_in_height(first, found.z, beyond, found.z, robot.rise_m(grid.cell)) < 0))
        bridged, z = _bridges(world, found, alone, step, robot)
        columns.append(beyond[alone[bridged]])
        levels.append(z)
        slopes.append(found.slope[alone[bridged]])
    column, z = np.concatenate(columns), np.concatenate(levels)
    order = np.lexsort((z, column))
    column, z, slope, is_bridge = column[order], z[order], np.concatenate(slopes)[order], order >= len(found.z)
    above = np.append((np.diff(column) == 0) & is_bridge[1:], False)
    # What two sides found is one bridge; and what lies beneath one is the bottom of a seam.
    kept = ~(above & (np.append(np.diff(z), np.inf) < np.where(is_bridge, robot.max_step_m, robot.headroom_m)))
    return column[kept], z[kept], slope[kept]


def _bridges(world: TrueWorld, found: _Pierced, node: Ints, step: Ints, robot: RobotShape) -> tuple[Mask, Floats]:
    """(N,) whether the column one step from a surface lies in a seam; and, where it does, the height of the ground across it.

    Something thin that stands on the ground looks like a seam here; it ends the links through it later.
    """
    cell, length = world.grid.cell, world.grid.cell * float(np.hypot(*step))
    shares = np.arange(1, int(np.ceil((length + robot.wheel_width_m) / _FINE_M)) + 1) * _FINE_M / length
    start = np.column_stack([world.grid.centres()[found.column[node]], found.z[node]])
    if not len(node):
        return np.zeros(0, dtype=np.bool_), np.zeros(0)
    places = (start[:, None, :2] + shares[None, :, None] * step * cell).reshape(-1, 2)
    place, floors, _ = world.floors(places, robot.headroom_m)
    first = first_of(place, len(node) * len(shares))
    # The last floor that was met, and where; a floor on the far side of the column ends the search.
    level, at, far_z, far = found.z[node].copy(), np.zeros(len(node)), np.full(len(node), np.nan), np.full(len(node), np.nan)
    for part, share in enumerate(shares):
        floor = nearest_in_height(first, floors, np.arange(len(node)) * len(shares) + part, level, robot.max_step_m)
        left = (floor >= 0) & np.isnan(far) & ((share - at) * length <= robot.wheel_width_m + _FINE_M)
        reached = left & (share > 1.0)
        far_z[reached], far[reached] = floors[floor[reached]], share
        near = left & ~reached
        level[near], at[near] = floors[floor[near]], share
    bridged = np.isfinite(far)
    part = (1.0 - at[bridged]) / (far[bridged] - at[bridged])
    return bridged, level[bridged] + part * (far_z[bridged] - level[bridged])
