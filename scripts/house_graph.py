"""Who imports whom, read from the text of the code: the graph that `count_house.py` and the rules of the house ask."""

import ast
from functools import cache
from pathlib import Path


@cache
def modules_below(src: Path) -> dict[str, Path]:
    """Dotted name of every module and package below a folder, and its file."""
    paths = sorted(src.rglob("*.py"))
    return {".".join(p.relative_to(src).with_suffix("").parts).removesuffix(".__init__"): p for p in paths}


def imported_modules(path: Path, src: Path) -> set[str]:
    """Modules below `src` that a file imports, inside functions and for types, too."""
    known, found = modules_below(src), set()
    for node in ast.walk(_tree(path)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= (inner & known.keys()) | ({node.module} if inner - known.keys() else set())
    return found & known.keys()


def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def import_circles(src: Path) -> list[str]:
    """Groups of modules that import each other, for types, too, as "a -> b -> a"."""
    edges = {name: imported_modules(path, src) - {name} for name, path in modules_below(src).items()}
    for name in edges:  # whoever imports from another package loads that package first
        outside = [to for to in edges[name] if to.partition(".")[0] != name.partition(".")[0]]
        edges[name] |= {to.rpartition(".")[0] for to in outside} & edges.keys()
    return sorted({" -> ".join(circle) for name in sorted(edges) if (circle := _circle_from(name, edges))})


def _circle_from(start: str, edges: dict[str, set[str]]) -> list[str] | None:
    """The shortest way from a module back to itself, told from the first of its names on; None when there is none."""
    ways, seen = [[start]], set()
    while ways:
        way = ways.pop(0)
        for following in sorted(edges[way[-1]]):
            if following == start:
                first = way.index(min(way))
                around = way[first:] + way[:first]
                return [*around, around[0]]
            if following not in seen:
                seen.add(following)
                ways.append([*way, following])
    return None
