"""Two pictures of a run: the classified map from above and at an angle, with the path that was driven.

They are made from the run folder alone (occupied.npz, terrain.npz, trajectory.txt and, where it is there, trajectory_truth.txt),
and in the thesis's colours (figures 5.16 to 5.18): traversable green, obstacle red, cliff purple, inflation orange, frontier
blue; potential cliff light blue. Everything else that is occupied is grey. Ceilings are cut off, so that one looks into rooms.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from exploration_evaluation.classification import LABELS
from exploration_evaluation.picture_content import (
    COLOURS,
    OTHER_COLOUR,
    DrawnVoxels,
    DrivenPath,
    driven_path,
    read_voxels,
    without_ceiling,
    without_front_walls,
)
from exploration_evaluation.run_files import JsonObject
from exploration_evaluation.voxel_renderer import Canvas, Depth, Image, View, render_cubes
from whole_files import written_whole

Floats = NDArray[np.float64]

_BACKGROUND = (1.0, 1.0, 1.0)
_INK = "#20242b"
_SUPERSAMPLING = 2
_VIEWS = {
    "map_top.png": ("from above", View.from_above()),
    "map_angle.png": ("from the south-east", View.at_angle(math.radians(-58.0), math.radians(38.0))),
}
_MAP_PIXELS = (1500, 1150)
_LEAST_WIDTH = 1500  # pixels: titles and legend need them
_DPI = 100
_MARGIN_M = 0.5


def draw_pictures(directory: Path | str, summary: JsonObject | None = None) -> tuple[Path, ...]:
    """Writes map_top.png and map_angle.png into a run folder and returns their paths.

    `summary` (as of `evaluate_run`) gives the titles. A run without terrain classes or without a trajectory is drawn without them;
    ValueError when there are neither occupied nor classified voxels.
    """
    folder = Path(directory)
    path = driven_path(folder)
    voxels = without_ceiling(read_voxels(folder), path)
    written = []
    for name, (direction, view) in _VIEWS.items():
        figure = _figure(without_front_walls(voxels, view), path, view, direction, summary or {})
        with written_whole(folder / name) as unfinished:
            figure.savefig(unfinished, dpi=_DPI, format="png", facecolor="white")
        written.append(folder / name)
    return tuple(written)


def _figure(voxels: DrawnVoxels, path: DrivenPath, view: View, direction: str, summary: Mapping[str, Any]) -> Figure:
    canvas = Canvas.around(view.project(voxels.centres), *_MAP_PIXELS, margin_m=_MARGIN_M)
    image, depth = _rendered(voxels, view, canvas)
    header, footer, side = 92, 84, 24
    width, height = max(canvas.width, _LEAST_WIDTH) + 2 * side, canvas.height + header + footer
    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI)
    FigureCanvasAgg(figure)
    left = (width - canvas.width) / 2
    axes = figure.add_axes((left / width, footer / height, canvas.width / width, canvas.height / height))
    axes.imshow(image, extent=(0, canvas.width, canvas.height, 0), interpolation="nearest", aspect="auto")
    axes.set_axis_off()
    axes.set(xlim=(0, canvas.width), ylim=(canvas.height, 0))
    _draw_path(axes, path, view, canvas, depth)
    _draw_titles(figure, summary, direction, side / width, 1 - 26 / height, 1 - 58 / height)
    _draw_legend(figure, voxels, path, side / width, footer / height * 0.48)
    _draw_scale_bar(figure, canvas, width, height, side, footer)
    return figure


def _rendered(voxels: DrawnVoxels, view: View, canvas: Canvas) -> tuple[Image, Depth]:
    large = canvas.enlarged(_SUPERSAMPLING)
    image, depth = render_cubes(voxels.centres, voxels.sizes, _lit_by_height(voxels), voxels.bias, view, large, _BACKGROUND)
    blocks = image.reshape(canvas.height, _SUPERSAMPLING, canvas.width, _SUPERSAMPLING, 3)
    return np.clip(blocks.mean(axis=(1, 3)), 0.0, 1.0), depth


def _lit_by_height(voxels: DrawnVoxels) -> Image:
    """Colours a little darker below and lighter above, so that levels that look alike are told apart."""
    low, high = np.percentile(voxels.centres[:, 2], [1, 99])
    share = np.clip((voxels.centres[:, 2] - low) / max(high - low, 1.0), 0.0, 1.0)[:, None]
    dark = voxels.colours * (0.87 + 0.13 * share)
    return np.asarray(dark + (1.0 - dark) * 0.23 * share, dtype=np.float32)


def _draw_path(axes: Axes, path: DrivenPath, view: View, canvas: Canvas, depth: Depth) -> None:
    if len(path.line) > 1:
        projected = view.project(path.line)
        pixels = canvas.pixels(projected)
        pieces = np.stack([pixels[:-1], pixels[1:]], axis=1)
        seen = _visible(projected, canvas, depth)
        seen = seen[:-1] & seen[1:]
        axes.add_collection(LineCollection(list(pieces[~seen]), colors=_INK, linewidths=1.4, alpha=0.45, zorder=3))
        axes.add_collection(LineCollection(list(pieces[seen]), colors="white", linewidths=4.6, capstyle="round", zorder=4))
        axes.add_collection(LineCollection(list(pieces[seen]), colors=_INK, linewidths=2.2, capstyle="round", zorder=5))
    if len(path.sweeps):
        projected = view.project(path.sweeps)
        pixels, seen = canvas.pixels(projected), _visible(projected, canvas, depth)
        for shown, alpha in ((seen, 1.0), (~seen, 0.40)):
            axes.scatter(pixels[shown, 0], pixels[shown, 1], s=46, c="#ffd84d", edgecolors=_INK, linewidths=1.4, alpha=alpha, zorder=6)
        for k, text in ((0, "start"), (-1, "end")):
            _draw_tag(axes, pixels[k], text)


def _draw_tag(axes: Axes, at: Floats, text: str) -> None:
    box = {"boxstyle": "round,pad=0.25", "facecolor": "white", "edgecolor": _INK, "linewidth": 0.8, "alpha": 0.92}
    offset = (9, 9) if text == "start" else (9, -19)
    axes.annotate(text, (at[0], at[1]), xytext=offset, textcoords="offset points", fontsize=10, color=_INK, bbox=box, zorder=7)


def _visible(projected: Floats, canvas: Canvas, depth: Depth) -> NDArray[np.bool_]:
    """(N,) whether nothing is drawn more than a few centimetres in front of a projected point."""
    column, row = (canvas.pixels(projected) * _SUPERSAMPLING).astype(np.int64).T
    inside = (column >= 0) & (row >= 0) & (column < depth.shape[1]) & (row < depth.shape[0])
    front = np.full(len(projected), -np.inf)
    front[inside] = depth[row[inside], column[inside]]
    return np.asarray(projected[:, 2] >= front - 0.05)


def _draw_titles(figure: Figure, summary: Mapping[str, Any], direction: str, x: float, y: float, y_below: float) -> None:
    world, seed = summary.get("world"), summary.get("seed")
    title = f"{Path(str(world)).stem if world else 'Unknown world'}" + (f", seed {seed}" if seed is not None else "")
    figure.text(x, y, title, fontsize=19, fontweight="bold", color=_INK, va="center")
    figure.text(x, y_below, "   ·   ".join([f"classified map {direction}", *_facts(summary)]), fontsize=12.5, color="#59606b", va="center")


def _facts(summary: Mapping[str, Any]) -> list[str]:
    forms = (
        ("coverage", 100.0, "coverage {:.1f} %"),
        ("sweeps", 1, "{:.0f} sweeps"),
        ("distance_m", 1.0, "{:.0f} m driven"),
        ("trajectory_ate_m", 100.0, "ATE {:.1f} cm"),
    )
    facts = [form.format(summary[key] * factor) for key, factor, form in forms if isinstance(summary.get(key), (int, float))]
    return facts + ([str(summary["stop_reason"])] if summary.get("stop_reason") else [])


def _draw_legend(figure: Figure, voxels: DrawnVoxels, path: DrivenPath, x: float, y: float) -> None:
    handles: list[Any] = [Patch(facecolor=COLOURS[n], label=n) for n in LABELS if n in voxels.classes]
    if "other" in voxels.classes:
        handles.append(Patch(facecolor=OTHER_COLOUR, label="other occupied"))
    if len(path.line):
        handles.append(Line2D([], [], color=_INK, lw=2.4, label="path driven" if path.line_is_true else "from sweep to sweep"))
    if len(path.sweeps):
        handles.append(Line2D([], [], ls="", marker="o", ms=7, mfc="#ffd84d", mec=_INK, mew=1.4, label="sweep"))
    figure.legend(
        handles=handles,
        loc="center left",
        bbox_to_anchor=(x, y),
        ncols=len(handles),
        frameon=False,
        fontsize=11.5,
        labelcolor=_INK,
        borderpad=0,
        handlelength=1.3,
        columnspacing=1.5,
    )


def _draw_scale_bar(figure: Figure, canvas: Canvas, width: int, height: int, side: int, footer: int) -> None:
    metres = next((m for m in (50, 20, 10, 5, 2, 1) if m * canvas.pixels_per_m <= 0.22 * width), 0.5)
    right, left, y = 1 - side / width, 1 - (side + metres * canvas.pixels_per_m) / width, footer / height * 0.36
    tick = 5 / height
    lines = (((left, right), (y, y)), ((left, left), (y - tick, y + tick)), ((right, right), (y - tick, y + tick)))
    figure.lines.extend(Line2D(*xy, color=_INK, lw=2.0, transform=figure.transFigure, figure=figure) for xy in lines)
    figure.text((left + right) / 2, y + 2 * tick, f"{metres} m", ha="center", va="bottom", fontsize=11.5, color=_INK)
