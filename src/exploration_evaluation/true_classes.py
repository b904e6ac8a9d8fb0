"""What a terrain classifier should have found around the reachable ground of a world.

After `truth` in the judge, from the same mesh and by the same rules: says once a world what every cell of ground around the reachable
places is, and what ends the ground there. `classification` holds a run's labelled voxels against it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from exploration_evaluation.config import RobotShape
from exploration_evaluation.ground_ends import TrueGround, true_ground
from exploration_evaluation.ground_grid import (
    STEPS,
    Floats,
    Grid,
    Ints,
    Mask,
    Surfaces,
    components,
    near,
    neighbour_columns,
    surfaces_of,
)
from exploration_evaluation.ground_surfaces import TrueWorld, steepest
from exploration_evaluation.mesh import RayScene
from exploration_evaluation.truth import CELL_M, ReachableGround, true_world

Codes = NDArray[np.int8]

TRUE_CLASSES = ("drivable", "obstacle", "cliff", "other")
DRIVABLE, NO_WAY, DROP, OTHER = range(4)
"""Numbers of TRUE_CLASSES."""
BARRIERS = ("obstacle", "cliff", "low ceiling", "too steep")
"""What ends the ground; a place is unsafe by the nearest of these."""
STANDS, FALLS, LOW, STEEP = range(4)
"""Numbers of BARRIERS."""

_CRAWL_M = 0.05  # lower gaps are no ceilings over a floor but two faces of one thing
_SAME_PLACE_M = 1e-3


@dataclass(frozen=True)
class TrueClasses:
    """What a classifier should have found around the reachable ground of a world, world frame.

    cells (C, 3) with `cell_class` (C,), indices into TRUE_CLASSES: ground connected with the reachable one is drivable, and cliff where
    it ends at a drop; obstacle is what is too steep, and the one cell beside the ground in which something stands or hangs low; other
    is ground that is not connected. surfaces (S, 3) with `surface_barrier` (S,): -1 for ground, else why it is none (index into
    BARRIERS). barriers (B, 3) with `barrier_kind` (B,): where ground ends; the centre keeps `radius_m` from those within `level_m` of
    its height. places (P, 3): those of the reachable ground.
    """

    cells: Floats
    cell_class: Codes
    surfaces: Floats
    surface_barrier: Codes
    barriers: Floats
    barrier_kind: Codes
    places: Floats
    cell_area_m2: float
    radius_m: float
    level_m: float


@dataclass(frozen=True)
class _Ends:
    """Links of ground that end: the node, the direction, and why (index into BARRIERS), (E,) each."""

    node: Ints
    direction: Ints
    kind: Codes


@dataclass(frozen=True)
class _Ground:
    """The true ground as `truth` has it; `surfaces` are those of all headrooms, with why each is no ground (-1: it is)."""

    world: TrueWorld
    true: TrueGround
    surfaces: Surfaces
    surface_kind: Codes


def true_classes(
    vertices: ArrayLike, triangles: ArrayLike, ground: ReachableGround, robot: RobotShape | None = None, cell_m: float = CELL_M
) -> TrueClasses:
    """The true classes around the reachable ground of a mesh, (V, 3) metres and (T, 3) indices in the world frame.

    `ground`, `robot` and `cell_m` belong together, as `reachable_ground` made the first of the others. ValueError for a mesh that is none
    or reachable ground that is not the mesh's.
    """
    robot = robot or RobotShape()
    found = _ground(true_world(vertices, triangles, cell_m), robot)
    true, level_m = found.true, robot.level_m
    ends = _ends(found, robot)
    connected = _connected(true, ground.points)
    # The edge of what is not connected, such as a box's top, is a thing that stands there to all who come from the reachable ground.
    kind = np.where((ends.kind == FALLS) & ~connected[ends.node], np.int8(STANDS), ends.kind)
    cells, classes = _cells(found, ends, connected, ground.points, robot.circumscribed_radius_m + cell_m, level_m)
    return TrueClasses(
        cells=cells,
        cell_class=classes,
        surfaces=found.surfaces.xyz,
        surface_barrier=found.surface_kind,
        barriers=true.barriers,
        barrier_kind=np.append(kind, np.full(len(true.thin), STANDS, dtype=np.int8)),
        places=ground.points,
        cell_area_m2=ground.cell_area_m2,
        radius_m=robot.circumscribed_radius_m,
        level_m=level_m,
    )


def _ground(world: TrueWorld, robot: RobotShape) -> _Ground:
    true = true_ground(world, robot)
    column, z, triangle = world.floors(world.grid.centres(), _CRAWL_M)
    slope = world.slopes[triangle]
    low = surfaces_of(world.grid, column, z, slope, slope)
    low = low.some(~_among(low.xyz, true.surfaces.xyz))
    kind = np.where(true.surfaces.steepness <= steepest(robot), np.int8(-1), np.int8(STEEP))
    both = [np.concatenate(pair) for pair in zip(low.arrays, true.surfaces.arrays, strict=True)]
    kinds = np.concatenate([np.full(len(low.column), LOW, dtype=np.int8), kind])
    order = np.lexsort((both[1], both[0]))
    return _Ground(world, true, surfaces_of(world.grid, *(part[order] for part in both)), kinds[order])


def _among(points: Floats, some: Floats) -> Mask:
    """(N,) whether each of (N, 3) points is one of some others."""
    away, _ = cKDTree(some).query(points, distance_upper_bound=_SAME_PLACE_M)
    return np.asarray(np.isfinite(away))


def _connected(true: TrueGround, places: Floats) -> Mask:
    """(M,) nodes of ground that are connected with the reachable places, whether or not there is room on the way."""
    piece = components(true.links, np.ones(len(true.links), dtype=np.bool_))
    reached = _among(true.nodes.xyz, places)
    if reached.sum() != len(places) or not len(places):
        raise ValueError(f"of {len(places)} reachable places {int(reached.sum())} lie on the ground of this mesh; they belong together")
    return np.asarray(np.isin(piece, np.unique(piece[reached])))


def _ends(found: _Ground, robot: RobotShape) -> _Ends:
    """Why the ground ends, for every link that does, all of one direction after the other."""
    parts = []
    for direction in range(4):
        node = np.flatnonzero(found.true.links[:, direction] < 0)
        parts.append(_Ends(node, np.full(len(node), direction), _kinds(found, node, direction, robot)))
    return _Ends(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("node", "direction", "kind")))


def _kinds(found: _Ground, node: Ints, direction: int, robot: RobotShape) -> Codes:
    """Why the ground of each node ends in a direction, by what is in the column there and what the body meets on its way."""
    here, cell = found.true.nodes.xyz[node], found.world.grid.cell
    column = neighbour_columns(found.world.grid, found.true.nodes.column[node], direction)
    nearest, highest = _beside(found.surfaces, column, here[:, 2], robot.height_m)
    rise = np.where(nearest >= 0, found.surfaces.xyz[nearest, 2] - here[:, 2], -np.inf)
    slope = np.where(nearest >= 0, found.surfaces.slope[nearest], 0.0)
    explained = cell * np.tan(np.minimum(np.maximum(slope, found.true.nodes.slope[node]), steepest(robot)))
    level = np.abs(rise) <= np.maximum(robot.max_step_m, explained)
    of_near = np.where(nearest >= 0, found.surface_kind[nearest], LOW)
    stands = _met(found.world.scene, here + [0.0, 0.0, robot.ground_clearance_m], STEPS[direction] * cell)
    going_on = np.abs(rise) <= 1.5 * cell * np.tan(np.minimum(slope, 1.5)) + _CRAWL_M / 5  # one slope, not the next floor
    kind = np.full(len(node), STANDS, dtype=np.int8)
    kind[highest < here[:, 2] - robot.max_step_m] = FALLS
    kind[level & (of_near != STEEP)] = LOW
    step = highest - here[:, 2]
    kind[stands | ((step > robot.max_step_m) & (step <= robot.ground_clearance_m))] = STANDS
    kind[(of_near == STEEP) & (level | going_on)] = STEEP
    return kind


def _met(scene: RayScene, origins: Floats, step_xy: Floats) -> Mask:
    """(N,) whether something stands on one step from each of (N, 3) points."""
    step = np.tile([*step_xy, 0.0], (len(origins), 1))
    return np.asarray(scene.first_hits(np.column_stack([origins, step])) <= 1.0)


def _beside(surfaces: Surfaces, column: Ints, z: Floats, height_m: float) -> tuple[Ints, Floats]:
    """Per (N,) column and height: the surface nearest in height, -1 for none, and the top of all up to a body's height above, or -inf."""
    begin = surfaces.first[column]
    count = np.where(column < 0, 0, surfaces.first[column + 1] - begin)
    nearest, gap, highest = np.full(len(z), -1), np.full(len(z), np.inf), np.full(len(z), -np.inf)
    for layer in range(int(count.max(initial=0))):
        there = np.flatnonzero(layer < count)
        index = begin[there] + layer
        level = surfaces.xyz[index, 2]
        low = level <= z[there] + height_m
        highest[there[low]] = np.maximum(highest[there[low]], level[low])
        nearer = np.abs(level - z[there]) < gap[there]
        nearest[there[nearer]], gap[there[nearer]] = index[nearer], np.abs(level - z[there])[nearer]
    return nearest, highest


def _cells(found: _Ground, ends: _Ends, connected: Mask, places: Floats, reach_m: float, level_m: float) -> tuple[Floats, Codes]:
    """All cells within reach of the places, with their true class."""
    of_node = np.where(connected, DRIVABLE, OTHER).astype(np.int8)
    drops = ends.node[(ends.kind == FALLS) & connected[ends.node]]
    of_node[drops] = DROP
    ground = near(found.world.grid, found.true.nodes, places, reach_m, level_m)
    steep = near(found.world.grid, found.surfaces, places, reach_m, level_m) & (found.surface_kind == STEEP)
    rim = _rim(found, ends, connected & ground)
    beyond = ~_same_cells(found.world.grid, found.true.nodes.xyz, rim) | connected
    cells = np.vstack([found.true.nodes.xyz[ground & beyond], found.surfaces.xyz[steep], rim])
    sizes = (int((ground & beyond).sum()), int(steep.sum()), len(rim))
    return cells, np.concatenate([of_node[ground & beyond], *(np.full(size, NO_WAY, dtype=np.int8) for size in sizes[1:])])


def _rim(found: _Ground, ends: _Ends, kept: Mask) -> Floats:
    """(R, 3) the cells beside kept nodes in which something stands or hangs low, at the level of the ground; each once."""
    blocked = kept[ends.node] & ((ends.kind == STANDS) | (ends.kind == LOW))
    node = ends.node[blocked]
    beside = found.true.nodes.xyz[node] + np.column_stack([STEPS[ends.direction[blocked]] * found.world.grid.cell, np.zeros(len(node))])
    beside = beside[~_same_cells(found.world.grid, beside, found.true.nodes.xyz[kept])]
    numbers = np.floor((beside - [*found.world.grid.origin, 0.0]) / [found.world.grid.cell, found.world.grid.cell, 0.5])
    _, first = np.unique(numbers, axis=0, return_index=True)
    return np.asarray(beside[first])


def _same_cells(grid: Grid, points: Floats, others: Floats) -> Mask:
    """(N,) whether one of the others lies in the same cell on about the same level."""
    if not len(others):
        return np.zeros(len(points), dtype=np.bool_)
    unit = np.array([0.25 * grid.cell, 0.25 * grid.cell, 0.25])
    away, _ = cKDTree(others / unit).query(points / unit, p=np.inf, distance_upper_bound=1.0)
    return np.asarray(np.isfinite(away))
