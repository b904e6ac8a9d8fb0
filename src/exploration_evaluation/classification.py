"""The classified terrain of a run against the true ground: a confusion table, and where it is wrongly safe or wrongly unsafe.

After `truth` in the judge, from the same mesh and by the same rules. `true_classes` says once a world what every cell of ground around
the reachable places is, and what ends the ground there; `classification` holds a run's labelled voxels against it. Traversable is taken
at its word: the robot's centre may stand there and turn. So a voxel is wrongly safe when it is traversable and nearer than the
circumscribed radius to what truly ends the ground; a place is wrongly unsafe when the centre may be there and its voxel says otherwise.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from exploration_evaluation import truth
from exploration_evaluation.config import RobotShape
from exploration_evaluation.mesh import RayScene, checked_mesh
from exploration_evaluation.truth import ReachableGround
from stage_config import check_ranges, parameter

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Codes = NDArray[np.int8]
Mask = NDArray[np.bool_]

LABELS = ("traversable", "obstacle", "cliff", "inflation", "frontier", "potential cliff")
TRUE_CLASSES = ("drivable", "obstacle", "cliff", "other")
UNMAPPED, EDGE, NO_GROUND = "unmapped", "edge", "no ground"
BARRIERS = ("obstacle", "cliff", "low ceiling", "too steep")
"""What ends the ground; a place is unsafe by the nearest of these."""

_TRAVERSABLE, _OBSTACLE, _CLIFF, _INFLATION = range(4)
_DRIVABLE, _NO_WAY, _DROP, _OTHER = range(4)
_STANDS, _FALLS, _LOW, _STEEP = range(4)
_RIGHT_LABELS = {_DRIVABLE: (_TRAVERSABLE, _INFLATION), _NO_WAY: (_OBSTACLE,), _DROP: (_CLIFF,)}
_CRAWL_M = 0.05  # lower gaps are no ceilings over a floor but two faces of one thing
_SAME_PLACE_M = 1e-3


@dataclass(frozen=True)
class ClassificationConfig:
    """How a voxel of the map and a cell of true ground find each other."""

    horizontal_m: float = parameter(
        0.12, "m", "farthest voxel, seen from above, whose label holds for a cell of ground", low=0.01, high=1.0
    )
    vertical_m: float = parameter(0.12, "m", "farthest voxel, along z, whose label holds for a cell of ground", low=0.01, high=1.0)
    edge_m: float = parameter(
        0.08, "m", "band beside the border of the true places in which resolution alone makes errors: one voxel", low=0.0, high=1.0
    )
    voxel_m: float = parameter(0.08, "m", "edge of a classified voxel, for its area", low=0.01, high=1.0)

    def validate(self) -> list[str]:
        """All violations of ranges."""
        return check_ranges(self)


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
class Classification:
    """Areas in m2, seen from above: true class -> label -> area, and what was wrongly safe and wrongly unsafe, by cause.

    In the table a cell has the label of the nearest voxel, save beside a border: obstacle and cliff are one cell wide there, and a cell
    has a label of its own class when any voxel within tolerance does. Drivable ground is right as traversable or as inflation.
    Causes of false-safe ground: BARRIERS (it lies on such, or too near to it), "no ground", "edge"; of false-unsafe ground: the label
    that it has, or "edge" for inflation. Edge is the band of one voxel beside the border of the true places.
    """

    confusion_m2: dict[str, dict[str, float]]
    false_safe_by_cause: dict[str, float]
    false_unsafe_by_cause: dict[str, float]

    @property
    def false_safe_m2(self) -> float:
        """All ground labelled traversable where the robot's centre may not be, the edge included."""
        return sum(self.false_safe_by_cause.values())

    @property
    def false_unsafe_m2(self) -> float:
        """All mapped places of the centre that are labelled obstacle, cliff or inflation, the edge included."""
        return sum(self.false_unsafe_by_cause.values())

    def summary(self) -> dict[str, object]:
        """All of it as it stands in a run's summary."""
        return {
            "confusion_m2": self.confusion_m2,
            "false_safe_m2": self.false_safe_m2,
            "false_unsafe_m2": self.false_unsafe_m2,
            "false_safe_by_cause": self.false_safe_by_cause,
            "false_unsafe_by_cause": self.false_unsafe_by_cause,
        }


@dataclass(frozen=True)
class _Ends:
    """Links of ground that end: the node, the direction, and why (index into BARRIERS), (E,) each."""

    node: Ints
    direction: Ints
    kind: Codes


@dataclass(frozen=True)
class _Ground:
    """The true ground as `truth` has it: `surfaces` with all headrooms, `nodes` those that are ground, `links` between them."""

    scene: RayScene
    grid: truth._Grid
    surfaces: truth._Nodes
    nodes: truth._Nodes
    links: Ints
    surface_kind: Codes


def true_classes(
    vertices: ArrayLike, triangles: ArrayLike, ground: ReachableGround, robot: RobotShape | None = None, cell_m: float = 0.10
) -> TrueClasses:
    """The true classes around the reachable ground of a mesh, (V, 3) metres and (T, 3) indices in the world frame.

    `ground`, `robot` and `cell_m` belong together, as `reachable_ground` made the first of the others. ValueError for a mesh that is none
    or reachable ground that is not the mesh's.
    """
    robot = robot or RobotShape()
    mesh = checked_mesh(vertices, triangles)
    found, barriers = _ground(mesh, robot, cell_m)
    ends = _ends(found, robot)
    connected = _connected(found, ground.points)
    # The edge of what is not connected, such as a box's top, is a thing that stands there to all who come from the reachable ground.
    kind = np.where((ends.kind == _FALLS) & ~connected[ends.node], np.int8(_STANDS), ends.kind)
    thin = truth._thin_things(found.grid, found.nodes, mesh, robot)
    level_m = robot.circumscribed_radius_m * math.tan(robot.max_slope_rad) + robot.max_step_m  # as in `truth`
    cells, classes = _cells(found, ends, connected, ground.points, robot.circumscribed_radius_m + cell_m, level_m)
    return TrueClasses(
        cells=cells,
        cell_class=classes,
        surfaces=found.surfaces.xyz,
        surface_barrier=found.surface_kind,
        barriers=np.vstack([barriers, thin]),
        barrier_kind=np.append(kind, np.full(len(thin), _STANDS, dtype=np.int8)),
        places=ground.points,
        cell_area_m2=ground.cell_area_m2,
        radius_m=robot.circumscribed_radius_m,
        level_m=level_m,
    )


def classification(
    true: TrueClasses, voxels_world: ArrayLike, labels: ArrayLike, config: ClassificationConfig | None = None
) -> Classification:
    """Judges the (N, 3) centres of a run's classified voxels, world frame, and their (N,) labels, indices into LABELS.

    ValueError for shapes that differ, points that are not finite, labels that are none, or a configuration out of its ranges.
    """
    config = config or ClassificationConfig()
    voxels, label = _checked(voxels_world, labels, config)
    return Classification(
        _confusion(true, voxels, label, config),
        _false_safe(true, voxels[label == _TRAVERSABLE], config),
        _false_unsafe(true, voxels, label, config),
    )


def judged_safety(
    true: TrueClasses, voxels_world: ArrayLike, labels: ArrayLike, config: ClassificationConfig | None = None
) -> tuple[dict[str, float], dict[str, float]]:
    """Areas in m2 that are wrongly safe and wrongly unsafe, by cause, as in `classification`."""
    config = config or ClassificationConfig()
    voxels, label = _checked(voxels_world, labels, config)
    return _false_safe(true, voxels[label == _TRAVERSABLE], config), _false_unsafe(true, voxels, label, config)


def _checked(voxels_world: ArrayLike, labels: ArrayLike, config: ClassificationConfig) -> tuple[Floats, NDArray[np.generic]]:
    voxels, label = np.asarray(voxels_world, dtype=np.float64).reshape(-1, 3), np.asarray(labels)
    if problems := config.validate():
        raise ValueError("; ".join(problems))
    if label.shape != (len(voxels),) or not np.isfinite(voxels).all():
        raise ValueError(f"voxels are finite and have one label each, not {voxels.shape} and {label.shape}")
    if len(label) and not (label.min() >= 0 and label.max() < len(LABELS)):
        raise ValueError(f"labels are 0..{len(LABELS) - 1}, not {label.min()}..{label.max()}")
    return voxels, label


def _ground(mesh: tuple[Floats, Ints], robot: RobotShape, cell_m: float) -> tuple[_Ground, Floats]:
    """The ground of a mesh, and the (E, 3) points at which its links end, in the order of `_ends`."""
    scene, grid = RayScene(*mesh), truth._grid_over(mesh[0], cell_m)
    surfaces = truth._surfaces(scene, grid, mesh, replace(robot, headroom_m=_CRAWL_M))
    free = truth._surfaces(scene, grid, mesh, robot)
    nodes = truth._without_steep(free, robot)
    points, links = truth._ends_of_ground(scene, grid, free, nodes, mesh, robot)
    kind = np.full(len(surfaces.column), _LOW, dtype=np.int8)
    kind[_among(surfaces.xyz, free.xyz)] = _STEEP
    kind[_among(surfaces.xyz, nodes.xyz)] = -1
    return _Ground(scene, grid, surfaces, nodes, links, kind), points


def _among(points: Floats, some: Floats) -> Mask:
    """(N,) whether each of (N, 3) points is one of some others."""
    away, _ = cKDTree(some).query(points, distance_upper_bound=_SAME_PLACE_M)
    return np.asarray(np.isfinite(away))


def _connected(found: _Ground, places: Floats) -> Mask:
    """(M,) nodes of ground that are connected with the reachable places, whether or not there is room on the way."""
    piece = truth._components(found.links, np.ones(len(found.links), dtype=np.bool_))
    reached = _among(found.nodes.xyz, places)
    if reached.sum() != len(places) or not len(places):
        raise ValueError(f"of {len(places)} reachable places {int(reached.sum())} lie on the ground of this mesh; they belong together")
    return np.asarray(np.isin(piece, np.unique(piece[reached])))


def _ends(found: _Ground, robot: RobotShape) -> _Ends:
    """Why the ground ends, for every link that does, all of one direction after the other."""
    parts = []
    for direction in range(4):
        node = np.flatnonzero(found.links[:, direction] < 0)
        parts.append(_Ends(node, np.full(len(node), direction), _kinds(found, node, direction, robot)))
    return _Ends(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("node", "direction", "kind")))


def _kinds(found: _Ground, node: Ints, direction: int, robot: RobotShape) -> Codes:
    """Why the ground of each node ends in a direction, by what is in the column there and what the body meets on its way."""
    here, cell = found.nodes.xyz[node], found.grid.cell
    column = truth._neighbour_columns(found.grid, found.nodes.column[node], direction)
    near, highest = _beside(found.surfaces, column, here[:, 2], robot.height_m)
    rise = np.where(near >= 0, found.surfaces.xyz[near, 2] - here[:, 2], -np.inf)
    slope = np.where(near >= 0, found.surfaces.slope[near], 0.0)
    level = np.abs(rise) <= robot.max_step_m
    of_near = np.where(near >= 0, found.surface_kind[near], _LOW)
    stands = _met(found.scene, here + [0.0, 0.0, robot.ground_clearance_m], truth._STEPS[direction] * cell)
    going_on = np.abs(rise) <= 1.5 * cell * np.tan(np.minimum(slope, 1.5)) + _CRAWL_M / 5  # one slope, not the next floor
    kind = np.full(len(node), _STANDS, dtype=np.int8)
    kind[highest < here[:, 2] - robot.max_step_m] = _FALLS
    kind[level & (of_near != _STEEP)] = _LOW
    step = highest - here[:, 2]
    kind[stands | ((step > robot.max_step_m) & (step <= robot.ground_clearance_m))] = _STANDS
    kind[(of_near == _STEEP) & (level | going_on)] = _STEEP
    return kind


def _met(scene: RayScene, origins: Floats, step_xy: Floats) -> Mask:
    """(N,) whether something stands on one step from each of (N, 3) points."""
    step = np.tile([*step_xy, 0.0], (len(origins), 1))
    return np.asarray(scene.first_hits(np.column_stack([origins, step])) <= 1.0)


def _beside(surfaces: truth._Nodes, column: Ints, z: Floats, height_m: float) -> tuple[Ints, Floats]:
    """Per (N,) column and height: the surface nearest in height, -1 for none, and the top of all up to a body's height above, or -inf."""
    begin = surfaces.first[column]
    count = np.where(column < 0, 0, surfaces.first[column + 1] - begin)
    near, gap, highest = np.full(len(z), -1), np.full(len(z), np.inf), np.full(len(z), -np.inf)
    for layer in range(int(count.max(initial=0))):
        there = np.flatnonzero(layer < count)
        index = begin[there] + layer
        level = surfaces.xyz[index, 2]
        low = level <= z[there] + height_m
        highest[there[low]] = np.maximum(highest[there[low]], level[low])
        nearer = np.abs(level - z[there]) < gap[there]
        near[there[nearer]], gap[there[nearer]] = index[nearer], np.abs(level - z[there])[nearer]
    return near, highest


def _cells(found: _Ground, ends: _Ends, connected: Mask, places: Floats, reach_m: float, level_m: float) -> tuple[Floats, Codes]:
    """All cells within reach of the places, with their true class."""
    of_node = np.where(connected, _DRIVABLE, _OTHER).astype(np.int8)
    drops = ends.node[(ends.kind == _FALLS) & connected[ends.node]]
    of_node[drops] = _DROP
    ground = truth._near(found.grid, found.nodes, places, reach_m, level_m)
    steep = truth._near(found.grid, found.surfaces, places, reach_m, level_m) & (found.surface_kind == _STEEP)
    rim = _rim(found, ends, connected & ground)
    beyond = ~_same_cells(found.grid, found.nodes.xyz, rim) | connected
    cells = np.vstack([found.nodes.xyz[ground & beyond], found.surfaces.xyz[steep], rim])
    sizes = (int((ground & beyond).sum()), int(steep.sum()), len(rim))
    return cells, np.concatenate([of_node[ground & beyond], *(np.full(size, _NO_WAY, dtype=np.int8) for size in sizes[1:])])


def _rim(found: _Ground, ends: _Ends, kept: Mask) -> Floats:
    """(R, 3) the cells beside kept nodes in which something stands or hangs low, at the level of the ground; each once."""
    blocked = kept[ends.node] & ((ends.kind == _STANDS) | (ends.kind == _LOW))
    node = ends.node[blocked]
    beside = found.nodes.xyz[node] + np.column_stack([truth._STEPS[ends.direction[blocked]] * found.grid.cell, np.zeros(len(node))])
    beside = beside[~_same_cells(found.grid, beside, found.nodes.xyz[kept])]
    numbers = np.floor((beside - [*found.grid.origin, 0.0]) / [found.grid.cell, found.grid.cell, 0.5])
    _, first = np.unique(numbers, axis=0, return_index=True)
    return np.asarray(beside[first])


def _same_cells(grid: truth._Grid, points: Floats, others: Floats) -> Mask:
    """(N,) whether one of the others lies in the same cell on about the same level."""
    if not len(others):
        return np.zeros(len(points), dtype=np.bool_)
    unit = np.array([0.25 * grid.cell, 0.25 * grid.cell, 0.25])
    away, _ = cKDTree(others / unit).query(points / unit, p=np.inf, distance_upper_bound=1.0)
    return np.asarray(np.isfinite(away))


def _confusion(true: TrueClasses, voxels: Floats, label: NDArray[np.generic], config: ClassificationConfig) -> dict[str, dict[str, float]]:
    found = _labels_beside_borders(true, voxels, label, config)
    columns = (*LABELS, UNMAPPED)
    return {
        name: {
            text: float(((true.cell_class == row) & (found == code)).sum() * true.cell_area_m2)
            for text, code in zip(columns, (*range(len(LABELS)), -1), strict=True)
        }
        for row, name in enumerate(TRUE_CLASSES)
    }


def _labels_beside_borders(true: TrueClasses, voxels: Floats, label: NDArray[np.generic], config: ClassificationConfig) -> Ints:
    """(C,) label of the nearest voxel of each cell, or the nearest right one where classes of one cell's width meet."""
    found = _labels_at(true.cells, voxels, label, config)
    border = np.isfinite(_nearest_barrier(true, true.cells, config.horizontal_m)[0]) | (true.cell_class == _NO_WAY)
    for row, right in _RIGHT_LABELS.items():
        cells, own = np.flatnonzero(border & (true.cell_class == row)), np.isin(label, right)
        better = _labels_at(true.cells[cells], voxels[own], label[own], config)
        found[cells] = np.where(better >= 0, better, found[cells])
    return found


def _false_unsafe(true: TrueClasses, voxels: Floats, label: NDArray[np.generic], config: ClassificationConfig) -> dict[str, float]:
    found = _labels_at(true.places, voxels, label, config)
    away, _ = _nearest_barrier(true, true.places, true.radius_m + config.edge_m)
    edge = (found == _INFLATION) & (away < true.radius_m + config.edge_m)
    masks = {"obstacle": found == _OBSTACLE, "cliff": found == _CLIFF, "inflation": (found == _INFLATION) & ~edge, EDGE: edge}
    return {cause: float(mask.sum() * true.cell_area_m2) for cause, mask in masks.items()}


def _false_safe(true: TrueClasses, voxels: Floats, config: ClassificationConfig) -> dict[str, float]:
    """Area of the (N, 3) traversable voxels on which no centre may be, by cause; what they lie on counts before what is near."""
    on, nowhere = _lies_on(true, voxels, config)
    away, kind = _nearest_barrier(true, voxels, true.radius_m)
    within = np.where(on >= 0, on, np.where(away < true.radius_m - 1e-6, kind, -1))
    edge = (on < 0) & (away >= true.radius_m - config.edge_m) & ~nowhere
    masks = {name: (within == code) & ~edge & ~nowhere for code, name in enumerate(BARRIERS)}
    masks |= {NO_GROUND: nowhere, EDGE: (within >= 0) & edge}
    return {cause: float(mask.sum() * config.voxel_m**2) for cause, mask in masks.items()}


def _lies_on(true: TrueClasses, voxels: Floats, config: ClassificationConfig) -> tuple[Codes, Mask]:
    """(N,) -1 for voxels on ground, else why what they lie on is none; and which lie on nothing. Ground counts first, a low floor last."""
    on, nowhere = np.full(len(voxels), -1, dtype=np.int8), np.ones(len(voxels), dtype=np.bool_)
    for kind in (_LOW, _STEEP, -1):
        index = np.flatnonzero(true.surface_barrier == kind)
        here = _labels_at(voxels, true.surfaces[index], index, config) >= 0
        on[here], nowhere[here] = kind, False
    return on, nowhere


def _labels_at(points: Floats, voxels: Floats, label: NDArray[np.generic], config: ClassificationConfig) -> Ints:
    """(N,) label of the voxel nearest to each of (N, 3) points, -1 where none is near enough."""
    if not len(voxels):
        return np.full(len(points), -1, dtype=np.int64)
    unit = np.array([config.horizontal_m, config.horizontal_m, config.vertical_m])
    away, nearest = cKDTree(voxels / unit).query(points / unit, p=np.inf, distance_upper_bound=1.0 + 1e-6)
    return np.where(np.isfinite(away), np.append(label.astype(np.int64), -1)[nearest], -1)


def _nearest_barrier(true: TrueClasses, points: Floats, reach_m: float) -> tuple[Floats, Codes]:
    """(N,) horizontal distance to the nearest barrier on about the same level, inf beyond reach, and what it is."""
    away, kind = np.full(len(points), np.inf), np.full(len(points), -1, dtype=np.int8)
    if not len(points) or not len(true.barriers):
        return away, kind
    pairs = cKDTree(points[:, :2]).sparse_distance_matrix(cKDTree(true.barriers[:, :2]), reach_m, output_type="ndarray")
    pairs = pairs[np.abs(points[pairs["i"], 2] - true.barriers[pairs["j"], 2]) <= true.level_m]
    pairs = pairs[np.lexsort((pairs["j"], pairs["v"], pairs["i"]))]
    point, first = np.unique(pairs["i"], return_index=True)
    away[point], kind[point] = pairs["v"][first], true.barrier_kind[pairs["j"][first]]
    return away, kind
