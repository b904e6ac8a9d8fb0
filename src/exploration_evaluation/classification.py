"""The classified terrain of a run against the true ground: a confusion table, and where it is wrongly safe or wrongly unsafe.

After `true_classes` in the judge: `classification` holds a run's labelled voxels against what they should be. Traversable is taken
at its word: the robot's centre may stand there and turn. So a voxel is wrongly safe when it is traversable and nearer than the
circumscribed radius to what truly ends the ground; a place is wrongly unsafe when the centre may be there and its voxel says otherwise.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from exploration_evaluation.ground_grid import Floats, Ints, Mask
from exploration_evaluation.true_classes import BARRIERS, DRIVABLE, DROP, LOW, NO_WAY, STEEP, TRUE_CLASSES, Codes, TrueClasses
from stage_config import check_ranges, parameter

LABELS = ("traversable", "obstacle", "cliff", "inflation", "frontier", "potential cliff")
UNMAPPED, EDGE, NO_GROUND = "unmapped", "edge", "no ground"

_TRAVERSABLE, _OBSTACLE, _CLIFF, _INFLATION = range(4)
_RIGHT_LABELS = {DRIVABLE: (_TRAVERSABLE, _INFLATION), NO_WAY: (_OBSTACLE,), DROP: (_CLIFF,)}


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


def _checked(voxels_world: ArrayLike, labels: ArrayLike, config: ClassificationConfig) -> tuple[Floats, NDArray[np.generic]]:
    voxels, label = np.asarray(voxels_world, dtype=np.float64).reshape(-1, 3), np.asarray(labels)
    if problems := config.validate():
        raise ValueError("; ".join(problems))
    if label.shape != (len(voxels),) or not np.isfinite(voxels).all():
        raise ValueError(f"voxels are finite and have one label each, not {voxels.shape} and {label.shape}")
    if len(label) and not (label.min() >= 0 and label.max() < len(LABELS)):
        raise ValueError(f"labels are 0..{len(LABELS) - 1}, not {label.min()}..{label.max()}")
    return voxels, label


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
    border = np.isfinite(_nearest_barrier(true, true.cells, config.horizontal_m)[0]) | (true.cell_class == NO_WAY)
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
    for kind in (LOW, STEEP, -1):
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
