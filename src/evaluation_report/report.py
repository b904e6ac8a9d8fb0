"""Writes a campaign's report: report.html (one file), report.md with the charts in figures/, and results.json."""

import html
import re
import shutil
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from evaluation_report.campaign import Campaign, load_campaign
from evaluation_report.charts import PROFILE_COLOURS, embedded, standalone
from evaluation_report.content import Content, report_content
from evaluation_report.results import results
from evaluation_report.tables import Cell, Table
from exploration_evaluation import write_json
from whole_files import write_whole

_NUMBER_AND_UNIT = re.compile(r"(?<=\d) (?=(?:%|m²|m|cm|s|min|deg|m/s)(?:\W|$))")
_TEMPLATES = Path(__file__).parent / "templates"


def write_report(campaign_dir: Path) -> tuple[Path, Path]:
    """Reports a campaign folder in whatever state it is; returns the paths of report.html and report.md.

    Replaces an earlier report whole. ValueError when campaign.json is missing or does not say what was asked for.
    """
    campaign = load_campaign(campaign_dir)
    content = report_content(campaign)
    write_json(campaign.directory / "results.json", results(campaign))
    figures = _write_figures(campaign, content)
    environment = _environment()
    pages = (("report.html", "report.html.j2"), ("report.md", "report.md.j2"))
    for name, template in pages:
        text = environment.get_template(template).render(c=content, figures=figures, colours=PROFILE_COLOURS)
        write_whole(campaign.directory / name, text)
    return campaign.directory / "report.html", campaign.directory / "report.md"


def _environment() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=lambda name: bool(name) and str(name).endswith(".html.j2"),
        undefined=StrictUndefined,
        finalize=_with_units_kept,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["css"] = Markup((_TEMPLATES / "report.css").read_text(encoding="utf-8"))
    environment.filters["drawing"] = lambda svg, prefix, title: Markup(embedded(svg, prefix, html.escape(title, quote=True)))
    environment.filters["markdown_table"] = markdown_table
    environment.filters["markdown_text"] = markdown_text
    return environment


def _with_units_kept(value: Any) -> Any:
    """Text whose numbers are not parted from their units at the end of a line."""
    return _NUMBER_AND_UNIT.sub("\u00a0", value) if isinstance(value, str) and not isinstance(value, Markup) else value


def markdown_text(text: str) -> str:
    """Text in which Markdown finds no marks of its own and no end of a cell or line."""
    plain = " ".join(text.split())
    for mark in "\\|*_`<[":
        plain = plain.replace(mark, f"\\{mark}")
    return plain


def markdown_table(table: Table) -> str:
    """A pipe table; the first column to the left, numbers to the right."""
    lines = [table.columns, (":--", *["--:"] * (len(table.columns) - 1))]
    heads = [markdown_text(column) for column in lines[0]]
    body = ["| " + " | ".join(_markdown_cell(cell, row.kind) for cell in row.cells) + " |" for row in table.rows]
    return "\n".join(["| " + " | ".join(heads) + " |", "|" + "|".join(lines[1]) + "|", *body])


def _markdown_cell(cell: Cell, kind: str) -> str:
    text = f"{cell.text} ({cell.note})" if cell.note else cell.text
    # A lone ~ would strike nothing, but two of them in a row of cells could.
    shown = markdown_text(text).replace("~", "\\~")
    return f"**{shown}**" if kind == "mean" and shown and not cell.note else shown


def _write_figures(campaign: Campaign, content: Content) -> dict[str, str]:
    """Charts as files of their own; returns the names below the folder, by world and kind."""
    folder = campaign.directory / "figures"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    written = {}
    for world in content.worlds:
        for kind, svg in (("coverage", world.time_chart), ("distance", world.distance_chart), ("activity", world.activity_chart)):
            if svg:
                name = f"figures/{kind}_{world.name}.svg"
                write_whole(campaign.directory / name, standalone(svg))
                written[f"{world.name} {kind}"] = name
    return written
