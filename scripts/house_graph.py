"""Who imports and who calls whom, read from the text of the code: the graphs that `count_house.py` and the rules of the house ask."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass, field
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


@dataclass
class _Module:
    """What a module defines and knows by name: functions as "Class.name" or "name", classes, and imported names to "module:name"."""

    functions: dict[str, ast.FunctionDef] = field(default_factory=dict)
    classes: set[str] = field(default_factory=set)
    imported: dict[str, str] = field(default_factory=dict)


def calls_reached(src: Path, package: str, start: str) -> list[str]:
    """Functions and methods of a package that a function reaches, itself among them; names as "module:Class.name".

    Static, by names: whatever function a body names counts as called, numba kernels too. A method on an object counts wherever a class that
    the module defines or imports has one of that name, so that it is a little too many rather than too few.
    """
    modules = {n: _read(p, src) for n, p in modules_below(src).items() if n == package or n.startswith(package + ".")}
    reached, open_ = {start}, [start]
    while open_:
        module, _, name = open_.pop().partition(":")
        for called in _named_in(modules, module, name):
            if called not in reached:
                reached.add(called)
                open_.append(called)
    return sorted(reached)


def _read(path: Path, src: Path) -> _Module:
    found = _Module()
    for node in _tree(path).body:
        if isinstance(node, ast.FunctionDef):
            found.functions[node.name] = node
        elif isinstance(node, ast.ClassDef):
            found.classes.add(node.name)
            found.functions |= {f"{node.name}.{n.name}": n for n in node.body if isinstance(n, ast.FunctionDef)}
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                found.imported[alias.asname or alias.name] = f"{inner}:" if inner in modules_below(src) else f"{node.module}:{alias.name}"
    return found


def _named_in(modules: dict[str, _Module], module: str, name: str) -> Iterator[str]:
    """The package's functions that a function's body names."""
    here = modules[module]
    for node in (inner for line in here.functions[name].body for inner in ast.walk(line)):
        if isinstance(node, ast.Name):
            yield from _meant_by(modules, module, node.id)
        elif isinstance(node, ast.Attribute):
            base = here.imported.get(node.value.id, "") if isinstance(node.value, ast.Name) else ""
            if base.endswith(":"):
                yield from _meant_by(modules, base[:-1], node.attr)
            else:
                yield from _methods(modules, module, node.attr)


def _meant_by(modules: dict[str, _Module], module: str, name: str) -> Iterator[str]:
    """The function of a name in a module, or what making an object of a class of that name calls."""
    if module not in modules:
        return
    here = modules[module]
    if name in here.functions:
        yield f"{module}:{name}"
    elif name in here.classes:
        yield from (f"{module}:{name}.{m}" for m in ("__init__", "__post_init__") if f"{name}.{m}" in here.functions)
    elif name in here.imported:
        origin, _, inner = here.imported[name].partition(":")
        if inner and origin != module:
            yield from _meant_by(modules, origin, inner)


def _methods(modules: dict[str, _Module], module: str, name: str) -> Iterator[str]:
    here = modules[module]
    classes = [(module, c) for c in here.classes]
    classes += [(o, c) for o, _, c in (i.partition(":") for i in here.imported.values()) if o in modules and c in modules[o].classes]
    yield from (f"{o}:{c}.{name}" for o, c in classes if f"{c}.{name}" in modules[o].functions)
