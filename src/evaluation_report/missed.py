"""The picture of what a run missed: the true world from above, the path, and reachable ground covered or missed, level by level.

Drawn in the world frame from the run folder alone, with the judge's own functions, so that the missed area is the complement
of its coverage.
Where floors lie above each other the levels are told apart by height, in bands as high as the lowest storey.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LightSource, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from exploration_evaluation import (
    CELL_M,
    RobotShape,
    covered_cells,
    divided_voxels,
    reachable_ground,
    read_json,
    read_mesh,
    read_occupied,
    read_robot,
    read_trajectory,
    trajectory_errors,
)
from exploration_evaluation.mesh import RayScene
from exploration_evaluation.run_files import JsonObject, resolution_m
from rigid_geometry import transform_points
from whole_files import written_whole

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

NAME = "map_missed.png"
_COVERED = ("#b9e2b4", "#8fcb91", "#d3ecc4", "#79b98a")
_MISSED = ("#d0103a", "#7a2fd0", "#e87400", "#0060d0")
_INK, _SWEEP = "#20242b", "#ffd84d"
_MARGIN_M = 1.0
_BACKGROUND_M = 0.05
_ABOVE_M = 1.0
_SIZE_PX, _DPI = (1500.0, 1250.0), 100


@dataclass(frozen=True)
class _Drive:
    """What is drawn: (N, 3) cells of ground, which are covered, on which level each lies; (M, 3) path and (S, 3) sweeps; world frame."""

    ground: Floats
    covered: Mask
    level: Ints
    cell_m: float
    path: Floats
    sweeps: Floats


def missed_view(run_dir: Path | str) -> Path:
    """Draws map_missed.png into a run folder and returns its path.

    ValueError, which names the file, when the folder lacks one of world.ply, trajectory_truth.txt, trajectory.txt and occupied.npz.
    """
    folder = Path(run_dir)
    vertices, triangles = read_mesh(folder / "world.ply")
    drive = _drive(folder, (vertices, triangles), read_robot(folder))
    figure = _figure(drive, RayScene(vertices, triangles), float(vertices[:, 2].max()), folder.name)
    with written_whole(folder / NAME) as unfinished:
        figure.savefig(unfinished, dpi=_DPI, format="png", facecolor="white")
    return folder / NAME


def _drive(folder: Path, mesh: tuple[Floats, Ints], robot: RobotShape) -> _Drive:
    at_truth, truth = read_trajectory(folder / "trajectory_truth.txt")
    stamps, poses = read_trajectory(folder / "trajectory.txt")
    voxels = divided_voxels(*read_occupied(folder / "occupied.npz"), resolution_m(_reported(folder)))
    T_world_map = trajectory_errors(stamps, poses, at_truth, truth).T_world_map
    ground = reachable_ground(*mesh, truth[0, :3, 3], robot, CELL_M).covered_points
    mapped = np.asarray(transform_points(T_world_map, voxels), dtype=np.float64)
    covered = covered_cells(ground, mapped)
    sweeps = np.asarray(transform_points(T_world_map, poses[:, :3, 3]), dtype=np.float64)
    return _Drive(ground, covered, levels(ground, CELL_M, robot.height_m), CELL_M, truth[:, :3, 3], sweeps)


def _reported(folder: Path) -> JsonObject:
    """What run.json says; nothing where there is none."""
    try:
        return read_json(folder / "run.json")
    except ValueError:
        return {}


def levels(ground: Floats, cell_m: float, height_m: float) -> Ints:
    """(N,) number of the level of each (N, 3) cell of ground, from 0 up; all 0 when no two cells lie above each other.

    Two cells of one column belong to two levels when the robot's height is between them. The smallest such storey gives the bands' height.
    """
    column = _columns(ground, cell_m)
    order = np.lexsort((ground[:, 2], column[:, 1], column[:, 0]))
    same = (np.diff(column[order], axis=0) == 0).all(axis=1)
    storeys = np.diff(ground[order, 2])[same]
    storeys = storeys[storeys > height_m]
    if not len(storeys):
        return np.zeros(len(ground), dtype=np.int64)
    band = np.floor((ground[:, 2] - ground[:, 2].min()) / float(storeys.min()) + 0.5).astype(np.int64)
    return np.asarray(np.unique(band, return_inverse=True)[1], dtype=np.int64)


def _columns(ground: Floats, cell_m: float) -> Ints:
    """(N, 2) numbers of the cells along x and y; cells lie at multiples of their size, as the truth has them."""
    return np.asarray(np.floor(ground[:, :2] / cell_m + 1e-6), dtype=np.int64)


def _figure(drive: _Drive, scene: RayScene, top_m: float, name: str) -> Figure:
    margin = _MARGIN_M / drive.cell_m
    low = (np.floor(drive.ground[:, :2].min(axis=0) / drive.cell_m - margin)) * drive.cell_m
    high = (np.ceil(drive.ground[:, :2].max(axis=0) / drive.cell_m + margin)) * drive.cell_m
    scale = float((_SIZE_PX / (high - low)).min())
    width, height = (high - low) * scale
    left, below, above = 90.0, 125.0, 70.0
    size = np.array([max(width, 900.0) + left + 20.0, height + below + above])
    figure = Figure(figsize=tuple(size / _DPI), dpi=_DPI)
    FigureCanvasAgg(figure)
    at = left + 0.5 * max(0.0, 900.0 - width)
    axes = figure.add_axes((at / size[0], below / size[1], width / size[0], height / size[1]))
    _draw_world(axes, scene, low, high, top_m)
    _draw_ground(axes, drive, low, high)
    _draw_path(axes, drive)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.set_xlabel("x [m]", fontsize=13)
    axes.set_ylabel("y [m]", fontsize=13)
    axes.tick_params(labelsize=13)
    figure.text(20 / size[0], 1 - 35 / size[1], _title(drive, name), fontsize=17, fontweight="bold", color=_INK, va="center")
    _draw_legend(figure, drive, 25 / size[1])
    return figure


def _draw_world(axes: Axes, scene: RayScene, low: Floats, high: Floats, top_m: float) -> None:
    """The world's upper surface in light greys, lit from the north-west; what no ray meets stays white."""
    counts = np.maximum(2, np.ceil((high - low) / _BACKGROUND_M)).astype(int)
    x, y = (low[k] + (np.arange(counts[k]) + 0.5) * (high[k] - low[k]) / counts[k] for k in range(2))
    rays = np.zeros((len(x) * len(y), 6))
    rays[:, 0], rays[:, 1] = np.tile(x, len(y)), np.repeat(y, len(x))
    rays[:, 2], rays[:, 5] = top_m + _ABOVE_M, -1.0
    z = top_m + _ABOVE_M - scene.first_hits(rays).reshape(len(y), len(x))
    met = np.isfinite(z)
    if not met.any():
        return
    light = LightSource(315, 50).hillshade(np.where(met, z, z[met].min()), dx=_BACKGROUND_M, dy=_BACKGROUND_M)
    grey = np.where(met, 0.66 + 0.28 * light, 1.0)
    axes.imshow(np.repeat(grey[..., None], 3, axis=2), extent=(low[0], high[0], low[1], high[1]), origin="lower", interpolation="bilinear")


def _draw_ground(axes: Axes, drive: _Drive, low: Floats, high: Floats) -> None:
    """One pixel a cell; upper levels over lower ones, but what was missed over everything, since it is what one looks for."""
    nx, ny = np.rint((high - low) / drive.cell_m).astype(int)
    image = np.zeros((ny, nx, 4))
    column, row = (_columns(drive.ground, drive.cell_m) - np.rint(low / drive.cell_m).astype(np.int64)).T
    for shown, palette in ((drive.covered, _COVERED), (~drive.covered, _MISSED)):
        for level in np.unique(drive.level):
            chosen = shown & (drive.level == level)
            image[row[chosen], column[chosen]] = (*to_rgb(palette[level % len(palette)]), 0.92)
    axes.imshow(image, extent=(low[0], high[0], low[1], high[1]), origin="lower", interpolation="nearest", zorder=2)


def _draw_path(axes: Axes, drive: _Drive) -> None:
    x, y = drive.path[:, 0], drive.path[:, 1]
    axes.plot(x, y, color="white", lw=5.0, alpha=0.9, zorder=3)
    axes.plot(x, y, color=_INK, lw=2.6, zorder=4)
    axes.scatter(drive.sweeps[:, 0], drive.sweeps[:, 1], s=80, c=_SWEEP, edgecolors=_INK, linewidths=1.3, zorder=5)
    for k, text, offset in ((0, "start", (9, 9)), (-1, "end", (9, -19))):
        box = {"boxstyle": "round,pad=0.25", "facecolor": "white", "edgecolor": _INK, "linewidth": 0.8, "alpha": 0.92}
        axes.annotate(text, (x[k], y[k]), xytext=offset, textcoords="offset points", fontsize=14, color=_INK, bbox=box, zorder=6)


def _area(drive: _Drive, chosen: Mask) -> float:
    return float(chosen.sum()) * drive.cell_m**2


def _title(drive: _Drive, name: str) -> str:
    missed = _area(drive, ~drive.covered)
    return f"{name}: {_shown(missed)} missed of {_shown(_area(drive, np.ones_like(drive.covered)))} of reachable ground"


def _shown(area_m2: float) -> str:
    return f"{area_m2:.{2 if area_m2 < 1 else 1}f} m²"


def _draw_legend(figure: Figure, drive: _Drive, y: float) -> None:
    handles: list[Patch | Line2D] = []
    for level in np.unique(drive.level):
        on_it = drive.level == level
        z, several = drive.ground[on_it, 2], drive.level.max() > 0
        where = f", z {z.min():z.1f} to {z.max():z.1f} m" if several else ""
        handles.append(Patch(facecolor=_COVERED[level % len(_COVERED)], label=f"covered{where}"))
        missed = _area(drive, on_it & ~drive.covered)
        handles.append(Patch(facecolor=_MISSED[level % len(_MISSED)], label=f"missed{where}: {_shown(missed)}"))
    handles.append(Line2D([], [], color=_INK, lw=1.8, label="path driven"))
    handles.append(Line2D([], [], ls="", marker="o", ms=7, mfc=_SWEEP, mec=_INK, mew=1.3, label="sweep"))
    handles.append(Patch(facecolor="#d8d8d8", label="not reachable"))
    figure.legend(
        handles=handles,
        loc="lower center",
        bbox_to_anchor=(0.5, y - 0.015),
        ncols=min(5, len(handles)),
        frameon=False,
        fontsize=12.5,
        labelcolor=_INK,
    )
