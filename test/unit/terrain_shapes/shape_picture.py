"""A shape as profiles classify it, drawn from above: every node by its class, what is expected, where the robot stood and its paths."""

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from numpy.typing import NDArray
from shape import Expectation, Expected, Shape
from shape_judgement import Profile, View, miss, view_of
from shape_sweeps import PLACEMENTS, sweeps_of

from octomap_server_3dnav.terrain.classify import TerrainClass

Array = NDArray[np.float64]

COLOURS = {
    TerrainClass.TRAVERSABLE: "#63b46c",
    TerrainClass.OBSTACLE: "#d5483f",
    TerrainClass.CLIFF: "#8e5bb8",
    TerrainClass.INFLATION: "#f0a040",
    TerrainClass.FRONTIER: "#2f7fdb",
}
CUT_OFF = "#b9d9bd"  # traversable, but no way leads there
RIGHT, WRONG = "#20242b", "#e00000"
MARGIN_M = 1.5
WIDTH_INCHES, DPI = 9.0, 80
VOXEL_SHARE = 0.7  # of the place that a voxel has


def draw(shape: Shape, profiles: list[Profile], file: Path, heights: tuple[float, float] = (-math.inf, math.inf)) -> None:
    """Write a picture with a column for each profile and a row for each place in the grid, of what lies between two heights.

    Higher nodes hide lower ones. OSError when the file cannot be written.
    """
    low, high = _extent(shape)
    width, height = high - low
    figure = Figure(figsize=(WIDTH_INCHES * len(profiles), (WIDTH_INCHES * height / width + 1.0) * len(PLACEMENTS)), dpi=DPI)
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(PLACEMENTS), len(profiles), squeeze=False)
    for row, placement in zip(grid, PLACEMENTS, strict=True):
        for axes, of in zip(row, profiles, strict=True):
            _draw_view(axes, shape, view_of(shape, of, placement), heights)
            axes.set_title(f"{shape.name}, {placement.name}: {of.name}")
    figure.legend(handles=[Patch(color=c, label=k.name.lower()) for k, c in COLOURS.items()], loc="lower center", ncols=len(COLOURS))
    figure.tight_layout(rect=(0.0, 0.03, 1.0, 1.0))
    figure.savefig(file)


def _extent(shape: Shape) -> tuple[Array, Array]:
    """Corners of all stands and expectations from above, with a margin."""
    stands = [T[:3, 3] for T, _ in sweeps_of(shape)]
    corners = np.array([*stands, *(c for e in shape.expectations for c in (e.low, e.high))])[:, :2]
    return corners.min(axis=0) - MARGIN_M, corners.max(axis=0) + MARGIN_M


def _draw_view(axes: Axes, shape: Shape, view: View, heights: tuple[float, float]) -> None:
    (x0, y0), (x1, y1) = _extent(shape)
    axes.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal")
    side = VOXEL_SHARE * view.terrain.resolution / (x1 - x0) * WIDTH_INCHES * 72.0
    shown = np.flatnonzero((view.nodes[:, 2] >= heights[0]) & (view.nodes[:, 2] <= heights[1]))
    shown = shown[np.argsort(view.nodes[shown, 2] + 0.01 * view.terrain.label[shown], kind="stable")]
    colours = np.array([COLOURS[TerrainClass(label)] for label in view.terrain.label], dtype=object)
    colours[(view.terrain.label == TerrainClass.TRAVERSABLE) & ~view.terrain.reached] = CUT_OFF
    axes.scatter(view.nodes[shown, 0], view.nodes[shown, 1], s=side**2, c=colours[shown].tolist(), marker="s", linewidths=0)
    stands = np.array([T[:3, 3] for T, _ in sweeps_of(shape)])
    axes.plot(stands[:, 0], stands[:, 1], "o-", color=RIGHT, mfc="#ffd84d", ms=9, lw=0.8)
    for number, (x, y, _) in enumerate(stands):
        axes.annotate(str(number + 1), (x, y), ha="center", va="center", fontsize=7)
    for asked in shape.expectations:
        _draw_expectation(axes, view, asked, shape)


def _draw_expectation(axes: Axes, view: View, asked: Expectation, shape: Shape) -> None:
    found = miss(view, asked, shape)
    colour = WRONG if found else RIGHT
    (x0, y0, z0), (x1, y1, z1) = asked.low, asked.high
    text = f"{asked.kind.value} {z0:.2g}" + (f" to {z1:.2g}" if z1 != z0 else "") + (f"\n{found}" if found else "")
    axes.annotate(text, (x0, y1), fontsize=8, color=colour, ha="left", va="bottom")
    if asked.kind not in (Expected.PATH, Expected.NO_PATH):
        axes.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, edgecolor=colour, lw=1.5))
        return
    axes.plot(x0, y0, "*", color=colour, ms=14)
    way = view.path_to(np.array(asked.low))
    if way is not None:
        axes.plot(way[:, 0], way[:, 1], "-", color=colour, lw=1.5)
