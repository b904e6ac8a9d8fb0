#!/usr/bin/env python3
"""Counts the house: how long, how wide and how entangled the code is, read from its text. `test_house_counts.py` asks it.

scripts/count_house.py          # a table of what is counted, with the bars
scripts/count_house.py -v       # and every finding behind a number
"""

import ast
import re
import statistics
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from house_graph import import_circles

ROOT = Path(__file__).resolve().parents[1]
SRC = ROOT / "src"
TERRAIN = SRC / "octomap_server_3dnav" / "terrain"
PAGE, README = ROOT / "docs" / "terrain.md", ROOT / "README.md"
MOST_ARGUMENTS, MOST_LINES, MOST_CHARACTERS = 7, 300, 160
_WORD = re.compile(r"[A-Za-z0-9][\w.,'/%-]*")


@dataclass(frozen=True)
class Count:
    """One number of the table, what it may be at most, and the findings that make it."""

    name: str
    value: float
    bar: float
    found: tuple[str, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether it keeps to its bar."""
        return self.value <= self.bar


def modules(below: Path = SRC) -> list[Path]:
    """Python files, in their order."""
    return sorted(below.rglob("*.py"))


def parsed(path: Path) -> ast.Module:
    """The syntax tree of a file."""
    return ast.parse(path.read_text(encoding="utf-8"))


def line_count(path: Path) -> int:
    """Lines of a file, empty ones too."""
    return len(path.read_text(encoding="utf-8").splitlines())


def public_functions(path: Path, src: Path = SRC) -> Iterator[tuple[str, ast.FunctionDef]]:
    """Functions and methods that others may call, constructors and numba kernels among them, as "module:Class.name"."""

    def within(body: list[ast.stmt], prefix: str) -> Iterator[tuple[str, ast.FunctionDef]]:
        for node in body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                yield from within(node.body, f"{prefix}{node.name}.")
            elif isinstance(node, ast.FunctionDef) and (not node.name.startswith("_") or node.name in ("__init__", "__call__")):
                yield f"{path.relative_to(src)}:{prefix}{node.name}", node

    yield from within(parsed(path).body, "")


def arguments(function: ast.FunctionDef) -> list[ast.arg]:
    """All of them but self and cls."""
    given = [*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs]
    return [a for a in given if a.arg not in ("self", "cls")]


def speaks_of_any(function: ast.FunctionDef) -> bool:
    """Whether `Any` stands in its signature."""
    starred = [a for a in (function.args.vararg, function.args.kwarg) if a is not None]
    annotations = [a.annotation for a in (*arguments(function), *starred)] + [function.returns]
    return any(re.search(r"\bAny\b", ast.unparse(a)) for a in annotations if a is not None)


def long_modules() -> list[str]:
    """Modules of more than `MOST_LINES` lines."""
    return [f"{p.relative_to(SRC)}: {n} lines" for p in modules() if (n := line_count(p)) > MOST_LINES]


def wide_functions() -> list[str]:
    """Public functions of more than `MOST_ARGUMENTS` arguments."""
    return [f"{name}: {n} arguments" for p in modules() for name, f in public_functions(p) if (n := len(arguments(f))) > MOST_ARGUMENTS]


def untyped_functions() -> list[str]:
    """Public functions with `Any` in their signature."""
    return [name for p in modules() for name, f in public_functions(p) if speaks_of_any(f)]


def fields_of(path: Path, name: str) -> list[str]:
    """The fields of a dataclass."""
    (found,) = (n for n in parsed(path).body if isinstance(n, ast.ClassDef) and n.name == name)
    return [n.target.id for n in found.body if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)]


def prose(text: str) -> str:
    """A page without its figures in code fences, tables' rules and marks of Markdown."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"^\s*\|[\s:|-]+\|\s*$", "", text, flags=re.MULTILINE)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    return re.sub(r"[*`#|>]", " ", text)


def words_of(text: str) -> list[str]:
    """What a reader reads as words."""
    return _WORD.findall(prose(text))


def sentence_lengths(text: str) -> list[int]:
    """Words of every sentence; a heading, a line of a table and an item of a list end one, too."""
    ended = re.sub(r"^(#+ .*|\s*\|.*)$", r"\1.\n", text, flags=re.MULTILINE)
    ended = re.sub(r"\n\s*\n|\n(?=\s*([-*]|\d+\.) )", ".\n", ended)
    parts = re.split(r"(?<=[.!?])\s+", " ".join(prose(ended).split()))
    return [n for part in parts if (n := len(_WORD.findall(part))) > 1]


def terrain_counts() -> list[Count]:
    """What the terrain is measured by."""
    page = PAGE.read_text(encoding="utf-8")
    fields = fields_of(TERRAIN / "config.py", "TerrainConfig")
    sizes = [f"{p.name}: {line_count(p)}" for p in modules(TERRAIN)]
    return [
        Count("lines of terrain/", sum(map(line_count, modules(TERRAIN))), 1800, tuple(sizes)),
        Count("fields of TerrainConfig", len(fields), 20, tuple(fields)),
        Count("words of docs/terrain.md", len(words_of(page)), 1200),
        Count("its median sentence, words", statistics.median(sentence_lengths(page)), 18),
    ]


def readme_counts() -> list[Count]:
    """What the README is measured by: who reads it reads it once, in a hurry."""
    lines = README.read_text(encoding="utf-8").splitlines()
    wide = [f"line {k}: {len(line)} characters" for k, line in enumerate(lines, start=1) if len(line) > MOST_CHARACTERS]
    return [
        Count("lines of README.md", len(lines), 150),
        Count(f"lines of it over {MOST_CHARACTERS} characters", len(wide), 0, tuple(wide)),
        Count("words of it", len(words_of("\n".join(lines))), 1200),
        Count("its median sentence, words", statistics.median(sentence_lengths("\n".join(lines))), 20),
    ]


def house_counts() -> list[Count]:
    """What holds everywhere in src."""
    findings: dict[str, Callable[[], list[str]]] = {
        f"modules over {MOST_LINES} lines": long_modules,
        f"public functions over {MOST_ARGUMENTS} arguments": wide_functions,
        "public functions with Any": untyped_functions,
        "circles of imports": lambda: import_circles(SRC),
    }
    return [Count(name, len(found), 0, tuple(found)) for name, look in findings.items() for found in [look()]]


def main() -> None:
    """Prints the table."""
    for count in (*house_counts(), *terrain_counts(), *readme_counts()):
        print(f"{'' if count.holds else '*':1} {count.name:42} {count.value:6g}   at most {count.bar:g}")
        if "-v" in sys.argv[1:]:
            print("".join(f"      {line}\n" for line in count.found), end="")


if __name__ == "__main__":
    main()
