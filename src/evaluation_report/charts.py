"""Coverage curves and bars of activity as SVG, for a page and for a file.

Text stays text. For the page (`embedded`) the colours of lines, ink and grid become CSS variables, so that one drawing serves
the light and the dark scheme, and ids get a prefix, because many drawings share a page.
"""

import io
import re
from collections.abc import Sequence
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from evaluation_report.campaign import Campaign, Run

PROFILE_COLOURS = ("#1266c4", "#d3640b", "#2f8f4e", "#8a4fc0", "#b03060", "#6b6f1a")
_INK, _QUIET, _GRID = "#1c222a", "#5a6472", "#d9dde3"
_VARIABLES = {_INK: "--ink", _QUIET: "--quiet", _GRID: "--line"} | {c: f"--profile-{k}" for k, c in enumerate(PROFILE_COLOURS)}
_ACTIVITIES = {"driving": "#4c9be0", "sweeping": "#57b894", "mapping": "#e0a94c", "waiting": "#a7adb6"}
_OTHER_ACTIVITIES = ("#c58bd0", "#d98c8c", "#8fa7d8")
_COMPUTE, _COMPUTE_LABEL = "#d9534f", "computing (the clock stands)"
_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "evaluation_report",
    "font.family": "sans-serif",
    "font.size": 10.0,
    "axes.edgecolor": _QUIET,
    "axes.labelcolor": _INK,
    "text.color": _INK,
    "xtick.color": _QUIET,
    "ytick.color": _QUIET,
    "xtick.labelcolor": _INK,
    "ytick.labelcolor": _INK,
    "grid.color": _GRID,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
}
_WIDTH_IN = 4.3


def coverage_chart(campaign: Campaign, world: str, *, over_distance: bool = False) -> str | None:
    """Coverage of every run over simulated time, or over the distance driven; None when no run has a curve."""
    if not any(run.curve() for profile in campaign.profiles for run in campaign.runs_of(world, profile)):
        return None
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(_WIDTH_IN, 3.1), layout="constrained")
        axes = figure.add_subplot()
        # The reference is drawn last, on top.
        for profile in sorted(campaign.profiles, key=lambda name: name == campaign.reference):
            colour = profile_colour(campaign, profile)
            for run in campaign.runs_of(world, profile):
                _draw_curve(axes, run, over_distance, colour)
        axes.set(xlabel="distance driven [m]" if over_distance else "simulated time [min]", ylabel="coverage [%]")
        axes.set(ylim=(0, 103), xlim=(0, None), yticks=range(0, 101, 20))
        axes.grid(linewidth=0.6)
        axes.set_axisbelow(True)
        _draw_curve_legend(figure, campaign)
        return _svg(figure)


def profile_colour(campaign: Campaign, profile: str) -> str:
    """One colour a profile, in the order of the campaign."""
    return PROFILE_COLOURS[campaign.profiles.index(profile) % len(PROFILE_COLOURS)]


def _draw_curve(axes: Axes, run: Run, over_distance: bool, colour: str) -> None:
    points = run.curve()
    if not points:
        return
    x = [point[1] if over_distance else point[0] / 60.0 for point in points]
    y = [100.0 * point[2] for point in points]
    axes.plot(x, y, color=colour, linewidth=0.9, drawstyle="steps-post", solid_joinstyle="round")
    marker: dict[str, Any] = (
        {"marker": "o", "markersize": 2.6} if run.verdict else {"marker": "x", "markersize": 5.0, "markeredgewidth": 1.2}
    )
    axes.plot(x[-1:], y[-1:], color=colour, linestyle="none", **marker)


def _draw_curve_legend(figure: Figure, campaign: Campaign) -> None:
    handles: list[Any] = [Line2D([], [], color=profile_colour(campaign, p), lw=1.6, label=p) for p in campaign.profiles]
    ends: dict[str, Any] = {"color": _QUIET, "linestyle": "none"}
    handles.append(Line2D([], [], marker="o", markersize=3.5, label="succeeded", **ends))
    handles.append(Line2D([], [], marker="x", markersize=5.0, label="did not", **ends))
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=9, handlelength=1.3, columnspacing=1.4)


def activity_chart(campaign: Campaign, world: str) -> str | None:
    """One stacked bar a finished run: simulated minutes by activity, then the minutes for which the clock stood; None without any."""
    groups = [[run for run in campaign.runs_of(world, p) if run.averaged and _activities(run)] for p in campaign.profiles]
    runs = [run for group in groups for run in group]
    if not runs:
        return None
    names = _activity_names(runs)
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(_WIDTH_IN, 1.25 + 0.16 * len(runs) + 0.2 * len(groups)), layout="constrained")
        axes = figure.add_subplot()
        _draw_bars(axes, groups, names)
        axes.set(xlabel="simulated time, and compute time [min]", xlim=(0, None))
        axes.grid(axis="x", linewidth=0.6)
        axes.set_axisbelow(True)
        axes.tick_params(axis="y", length=0, labelsize=8.5)
        figure.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=9, handlelength=1.0, columnspacing=1.2)
        return _svg(figure)


def _activities(run: Run) -> dict[str, float]:
    """Minutes by activity; negative and unknown ones are left out."""
    parts = run.summary.get("activity_s")
    found = {name: run.number(f"activity_s.{name}") for name in parts} if isinstance(parts, dict) else {}
    found[_COMPUTE_LABEL] = run.number("compute_s")
    return {name: value / 60.0 for name, value in found.items() if value is not None and value >= 0}


def _activity_names(runs: Sequence[Run]) -> list[str]:
    """Those that occur: the known ones in their order, others, and the compute time at the end."""
    present = {name for run in runs for name, minutes in _activities(run).items() if minutes > 0}
    known = [name for name in _ACTIVITIES if name in present]
    others = sorted(present - set(known) - {_COMPUTE_LABEL})
    return [*known, *others, *([_COMPUTE_LABEL] if _COMPUTE_LABEL in present else [])]


def _draw_bars(axes: Axes, groups: Sequence[Sequence[Run]], names: Sequence[str]) -> None:
    others = [name for name in names if name not in _ACTIVITIES and name != _COMPUTE_LABEL]
    colours = {**_ACTIVITIES, _COMPUTE_LABEL: _COMPUTE}
    colours |= {name: _OTHER_ACTIVITIES[k % len(_OTHER_ACTIVITIES)] for k, name in enumerate(others)}
    places = _bar_places([len(group) for group in groups])
    runs = [run for group in groups for run in group]
    left = [0.0] * len(runs)
    for name in names:
        widths = [_activities(run).get(name, 0.0) for run in runs]
        axes.barh(places, widths, left=left, height=0.78, color=colours[name], label=name)
        left = [start + width for start, width in zip(left, widths, strict=True)]
    axes.set_yticks(places, [f"{run.profile} {run.seed}" for run in runs])
    axes.set_ylim(max(places) + 0.8, -0.8)


def _bar_places(counts: Sequence[int]) -> list[float]:
    """Rows from the top, with a gap between profiles."""
    places: list[float] = []
    for count in counts:
        begin = places[-1] + 1.8 if places else 0.0
        places += [begin + k for k in range(count)]
    return places


def _svg(figure: Figure) -> str:
    FigureCanvasSVG(figure)
    out = io.StringIO()
    figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None})
    text = out.getvalue()
    return text[text.index("<svg") :]


def embedded(svg: str, prefix: str, title: str) -> str:
    """The drawing for a page: CSS variables for colours, ids of its own, as wide as its column, and a title for readers that see none."""
    for colour, variable in _VARIABLES.items():
        svg = svg.replace(colour, f"var({variable})")
    svg = re.sub(r'\bid="([^"]+)"', rf'id="{prefix}-\1"', svg)
    svg = re.sub(r'(href="|url\()#', rf"\1#{prefix}-", svg)
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    head = re.sub(r'\s(width|height)="[^"]*"', "", svg[: svg.index(">")])
    return f'{head} role="img" aria-label="{title}"{svg[svg.index(">") :]}'


def standalone(svg: str) -> str:
    """The drawing as a file, on white."""
    end = svg.index(">") + 1
    return f'<?xml version="1.0" encoding="utf-8"?>\n{svg[:end]}\n<rect width="100%" height="100%" fill="#ffffff"/>{svg[end:]}'
