"""What a check found: one row a question, with its level and one line of advice, and the table of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum


class Level(IntEnum):
    """How bad it is; the numbers are those of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2


@dataclass(frozen=True)
class Row:
    """One answer: which input, what was asked of it, what was found; `advice` is empty when all is right."""

    level: Level
    source: str
    asked: str
    found: str
    advice: str = ""


def worst(rows: Sequence[Row]) -> Level:
    """The highest level; ERROR when nothing was asked."""
    return max((row.level for row in rows), default=Level.ERROR)


def judged(source: str, asked: str, found: str, *faults: tuple[bool, Level, str]) -> Row:
    """The row of the first fault that holds: (whether it holds, its level, its advice); OK when none does."""
    for holds, level, advice in faults:
        if holds:
            return Row(level, source, asked, found, advice)
    return Row(Level.OK, source, asked, found)


def table(rows: Sequence[Row]) -> str:
    """The rows in columns, each advice on a line below its row."""
    cells = [(row.level.name.lower() if row.level is Level.OK else row.level.name, row.source, row.asked, row.found) for row in rows]
    widths = [max((len(cell[i]) for cell in cells), default=0) for i in range(3)]
    lines = []
    for row, cell in zip(rows, cells, strict=True):
        lines.append("  ".join([*(text.ljust(width) for text, width in zip(cell, widths, strict=False)), row.found]).rstrip())
        if row.advice:
            lines.append(f"{' ' * (widths[0] + 2)}-> {row.advice}")
    return "\n".join(lines)
