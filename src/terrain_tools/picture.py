"""The classified map from above, a panel for each storey: classes in the colours of rviz, walls and other ground grey, the path on top."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from octomap_server_3dnav.navigation.class_colours import CLASS_RGB
from octomap_server_3dnav.octree.column_runs import ColumnRuns
from octomap_server_3dnav.terrain.classify import Terrain, TerrainClass
from terrain_tools.analysis import Analysis
from terrain_tools.storeys import storeys

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_WALL_RGB, _GROUND_RGB = (0.45, 0.47, 0.50), (0.86, 0.87, 0.89)
_WALL_M = 0.5  # what stands so high within a storey is drawn as a wall
_INK, _MARGIN_M, _DPI, _SIZE_IN = "#20242b", 1.0, 100, (15.0, 10.0)
_FOOT_IN, _HEAD_IN, _GAP_IN = 0.55, 0.60, 0.35
_MOST_PIXELS = 1400  # on an edge of a panel
_LIGHTER, _LIT_M = 0.45, 2.0  # what lies so far above the lowest of a storey, or is its highest if that is more


@dataclass(frozen=True)
class _Canvas:
    """A grid of pixels over the map: `stride` voxels a pixel, from voxel `origin` on."""

    origin: tuple[int, int]
    shape: tuple[int, int]
    stride: int
    resolution: float

    @classmethod
    def around(cls, low: Array, high: Array, resolution: float) -> _Canvas:
        first = np.floor((low - _MARGIN_M) / resolution).astype(int)
        size = np.ceil((high + _MARGIN_M) / resolution).astype(int) - first + 1
        stride = max(1, math.ceil(int(size.max()) / _MOST_PIXELS))
        nx, ny = (math.ceil(int(n) / stride) for n in size)
        return cls((int(first[0]), int(first[1])), (nx, ny), stride, resolution)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """x from and to, y from and to, in metres."""
        (x, y), edge = self.origin, self.stride * self.resolution
        return (
            x * self.resolution,
            x * self.resolution + self.shape[0] * edge,
            y * self.resolution,
            y * self.resolution + self.shape[1] * edge,
        )

    def paint(self, image: Image, ix: NDArray[np.integer], iy: NDArray[np.integer], colours: Image) -> None:
        """Colours the pixels of voxels inside, (N, 3) or all alike; later ones cover earlier ones."""
        image[(iy - self.origin[1]) // self.stride, (ix - self.origin[0]) // self.stride] = colours


class _Occupied(NamedTuple):
    """The occupied runs of the columns on a canvas: (N,) column and layers."""

    ix: NDArray[np.int64]
    iy: NDArray[np.int64]
    z_lo: NDArray[np.int16]
    z_hi: NDArray[np.int16]

    @classmethod
    def on(cls, canvas: _Canvas, runs: ColumnRuns) -> _Occupied:
        ends = [min(max(0, canvas.origin[0] + n - runs.origin_key[0]), runs.nx) for n in (0, canvas.shape[0] * canvas.stride)]
        first, end = runs.start[ends[0] * runs.ny], runs.start[ends[1] * runs.ny]
        kept = first + np.flatnonzero(runs.occupied[first:end])
        column = np.searchsorted(runs.start, kept, side="right") - 1
        ix, iy = column // runs.ny + runs.origin_key[0], column % runs.ny + runs.origin_key[1]
        inside = (iy >= canvas.origin[1]) & (iy < canvas.origin[1] + canvas.shape[1] * canvas.stride)
        return cls(ix[inside], iy[inside], runs.z_lo[kept[inside]], runs.z_hi[kept[inside]])


def png_bytes(found: Analysis, terrain: Terrain, name: str, start: Sequence[float], goal: Sequence[float] | None) -> bytes:
    """The picture of an analysis and its terrain; `name` is the title, `start` and `goal` (3,) are what was asked for."""
    marks = np.array([start, *([] if goal is None else [goal])], dtype=np.float64)
    drawn = np.concatenate([terrain.centers()[:, :2], marks[:1, :2]])  # a goal that is none may lie anywhere
    canvas = _Canvas.around(drawn.min(axis=0), drawn.max(axis=0), terrain.resolution)
    bands = storeys(terrain)
    figure, panels = _figure(len(bands), canvas)
    occupied = _Occupied.on(canvas, found.runs)
    storey_of_mark = [_nearest_band(bands, z / terrain.resolution) for z in marks[:, 2]]
    for axes, band in zip(panels, bands, strict=True):
        image = np.ones((canvas.shape[1], canvas.shape[0], 3), dtype=np.float32)
        _paint_rest(image, canvas, occupied, band)
        _paint_classes(image, canvas, terrain, band)
        _draw_storey(axes, canvas, image)
        if found.path is not None:
            _draw_path(axes, found.path.points, band[0] * terrain.resolution, (band[1] + 1) * terrain.resolution)
        _draw_marks(axes, marks, [band == bands[k] for k in storey_of_mark])
        if len(bands) > 1:
            low, high = band[0] * terrain.resolution, (band[1] + 1) * terrain.resolution
            axes.set_title(f"{low:.1f} to {high:.1f} m", fontsize=10, color=_INK, loc="left", pad=3)
    _draw_scale_bar(panels[0], canvas)
    _draw_titles(figure, name, found, terrain, goal is not None)
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=_DPI, facecolor="white")
    return file.getvalue()


def _figure(count: int, canvas: _Canvas) -> tuple[Figure, list[Axes]]:
    """As many panels of the canvas's form as are wanted, as large as fits, row by row."""
    width, height = _SIZE_IN[0], _SIZE_IN[1] - _FOOT_IN - _HEAD_IN

    def scale(columns: int) -> float:
        rows = math.ceil(count / columns)
        return min((width / columns - _GAP_IN) / canvas.shape[0], (height / rows - _GAP_IN) / canvas.shape[1])

    columns = max(range(1, count + 1), key=scale)
    rows = math.ceil(count / columns)
    panel = np.array(canvas.shape) * scale(columns)
    size = np.array([max(columns * (panel[0] + _GAP_IN), 9.0), rows * (panel[1] + _GAP_IN) + _FOOT_IN + _HEAD_IN])
    figure = Figure(figsize=tuple(size), dpi=_DPI)
    FigureCanvasAgg(figure)
    aside = (size[0] - columns * (panel[0] + _GAP_IN)) / 2 + _GAP_IN / 2
    panels = []
    for k in range(count):
        row, column = divmod(k, columns)
        corner = aside + column * (panel[0] + _GAP_IN), _FOOT_IN + (rows - 1 - row) * (panel[1] + _GAP_IN)
        panels.append(figure.add_axes((corner[0] / size[0], corner[1] / size[1], panel[0] / size[0], panel[1] / size[1])))
    return figure, panels


def _nearest_band(bands: list[tuple[int, int]], z: float) -> int:
    return int(np.argmin([max(low - z, z - high - 1, 0.0) for low, high in bands]))


def _draw_storey(axes: Axes, canvas: _Canvas, image: Image) -> None:
    axes.imshow(image, extent=canvas.extent, origin="lower", interpolation="nearest" if canvas.stride == 1 else "antialiased")
    axes.set(xlim=canvas.extent[:2], ylim=canvas.extent[2:], xticks=[], yticks=[])
    for spine in axes.spines.values():
        spine.set(color="#b9bec6", linewidth=0.8)


def _draw_marks(axes: Axes, marks: Array, is_here: list[bool]) -> None:
    """Start and goal, faint where they are on another storey."""
    for (x, y, _), here, (marker, colour, size) in zip(marks, is_here, (("o", "white", 9), ("*", "#ffd84d", 17)), strict=False):
        axes.plot(x, y, marker, ms=size, mfc=colour, mec=_INK, mew=1.6, alpha=1.0 if here else 0.25, zorder=5)


def _paint_rest(image: Image, canvas: _Canvas, occupied: _Occupied, band: tuple[int, int]) -> None:
    """What is occupied within a storey: ground that was not classified light, walls dark."""
    layers = np.minimum(occupied.z_hi, band[1]).astype(np.int32) - np.maximum(occupied.z_lo, band[0]) + 1
    is_top = (occupied.z_hi >= band[0]) & (occupied.z_hi <= band[1])
    for which, rgb in ((is_top, _GROUND_RGB), (layers * canvas.resolution >= _WALL_M, _WALL_RGB)):
        canvas.paint(image, occupied.ix[which], occupied.iy[which], np.array(rgb, dtype=np.float32))


def _paint_classes(image: Image, canvas: _Canvas, terrain: Terrain, band: tuple[int, int]) -> None:
    """The classes of a storey from below to above, the higher the lighter."""
    nodes = np.flatnonzero((terrain.z >= band[0]) & (terrain.z <= band[1]))
    nodes = nodes[np.argsort(terrain.z[nodes], kind="stable")]
    palette = np.ones((max(TerrainClass) + 1, 3), dtype=np.float32)
    for terrain_class, rgb in CLASS_RGB.items():
        palette[terrain_class] = rgb
    colours = palette[terrain.label[nodes]]
    share = ((terrain.z[nodes] - band[0]) / max(_LIT_M / canvas.resolution, band[1] - band[0]))[:, None].astype(np.float32)
    canvas.paint(image, terrain.ix[nodes], terrain.iy[nodes], colours + (1 - colours) * _LIGHTER * share)


def _draw_path(axes: Axes, points: Array, low: float, high: float) -> None:
    """The path, faint where it runs on another storey."""
    axes.plot(points[:, 0], points[:, 1], color=_INK, lw=0.8, alpha=0.25, zorder=3)
    here = (points[:, 2] >= low) & (points[:, 2] < high)
    line = np.where(here[:, None], points[:, :2], np.nan)
    axes.plot(line[:, 0], line[:, 1], color="white", lw=4.0, solid_capstyle="round", zorder=4)
    axes.plot(line[:, 0], line[:, 1], color=_INK, lw=2.0, solid_capstyle="round", zorder=4)


def _draw_scale_bar(axes: Axes, canvas: _Canvas) -> None:
    x_lo, x_hi, y_lo, _ = canvas.extent
    metres = next((m for m in (500, 200, 100, 50, 20, 10, 5, 2, 1) if m <= 0.3 * (x_hi - x_lo)), 0.5)
    x, y = x_lo + 0.03 * (x_hi - x_lo), y_lo + 0.03 * (x_hi - x_lo)
    axes.plot([x, x + metres], [y, y], color=_INK, lw=3, solid_capstyle="butt", zorder=6)
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0}
    style = {"textcoords": "offset points", "ha": "center", "va": "bottom", "fontsize": 9, "color": _INK, "bbox": box, "zorder": 6}
    axes.annotate(f"{metres:g} m", (x + metres / 2, y), xytext=(0, 5), **style)  # type: ignore[arg-type]


def _draw_titles(figure: Figure, name: str, found: Analysis, terrain: Terrain, has_goal: bool) -> None:
    width, height = figure.get_size_inches()
    facts = [f"{terrain.traversable_area_m2:,.1f} m² of ground in reach", f"frontiers: {len(found.frontiers)}"]
    if found.path is not None:
        facts.append(f"path {found.path.length_m:,.1f} m")
    if found.problem is not None:
        facts.append(f"{found.problem.what}: {found.problem.reason}")
    figure.text(0.2 / width, 1 - 0.22 / height, name, fontsize=14, fontweight="bold", color=_INK, va="center")
    figure.text(0.2 / width, 1 - 0.47 / height, "   ·   ".join(facts), fontsize=10, color="#59606b", va="center")
    handles: list[Patch | Line2D] = [Patch(facecolor=rgb, label=c.name.lower()) for c, rgb in CLASS_RGB.items()]
    handles += [Patch(facecolor=_WALL_RGB, label="wall"), Patch(facecolor=_GROUND_RGB, label="not classified")]
    marks: list[tuple[str, dict[str, object]]] = [("start", {"marker": "o", "ms": 8, "mfc": "white"})]
    if has_goal:
        marks.append(("goal", {"marker": "*", "ms": 12, "mfc": "#ffd84d"}))
    handles += [Line2D([], [], ls="", mec=_INK, mew=1.4, label=label, **style) for label, style in marks]  # type: ignore[arg-type]
    if found.path is not None:
        handles.append(Line2D([], [], color=_INK, lw=2, label="path"))
    figure.legend(
        handles=handles,
        loc="lower left",
        ncols=len(handles),
        frameon=False,
        fontsize=9,
        labelcolor=_INK,
        handlelength=1.2,
        columnspacing=1.2,
    )
