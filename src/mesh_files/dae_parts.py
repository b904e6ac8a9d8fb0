"""Which of a scene's geometries are the part of a mesh file that somebody named, and which a COLLADA file shows that nobody could read."""

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Iterator
from pathlib import Path

_SURFACES = ("triangles", "polylist", "polygons", "tristrips", "trifans")
_COPY = re.compile(r"_\d+$")  # what trimesh adds to the name of a geometry that is there twice


def parts_of_node(path: Path, name: str, geometries: Collection[str]) -> set[str]:
    """The names among those of a scene's geometries that are the part `name`, or that its node shows; empty when there is none."""
    wanted, own = {name}, set(geometries) if path.suffix.lower() == ".obj" else set()
    if path.suffix.lower() == ".dae":
        root = ElementTree.parse(path).getroot()
        wanted |= set(_shown_by(root, name))
        own = {str(geometry.get("id")) for geometry in root.iterfind(".//{*}geometry")}
    return {each for each in geometries if each in wanted or (each not in own and _COPY.sub("", each) in wanted)}


def _shown_by(root: ElementTree.Element, name: str) -> list[str]:
    """Ids of the geometries that bear a name, or that a node of that name shows."""
    shown = [
        _target(instance)
        for node in root.iterfind(".//{*}node")
        if name in (node.get("name"), node.get("id"))
        for instance in node.findall("{*}instance_geometry")
    ]
    return shown + [str(geometry.get("id")) for geometry in root.iterfind(".//{*}geometry") if geometry.get("name") == name]


def unread_geometries(path: Path, geometries: Collection[str], part: str | None = None) -> tuple[str, ...]:
    """Names of what the scene of a COLLADA file shows, or the node `part` of it, and is not among a scene's geometries; not of mere lines.

    So its reader leaves out what it does not know, such as strips of lines with all of their geometry, and what hangs on a skeleton.
    """
    root = ElementTree.parse(path).getroot()
    by_id = {str(geometry.get("id")): geometry for geometry in root.iterfind(".//{*}geometry")}
    read = {*geometries, *(_COPY.sub("", each) for each in geometries)}
    lost = [each for each in dict.fromkeys(_shown_in_scene(root) if part is None else _shown_by(root, part)) if each not in read]
    return tuple(str(by_id[each].get("name") or each) if each in by_id else each for each in lost if _has_surface(by_id.get(each)))


def _has_surface(geometry: ElementTree.Element | None) -> bool:
    """Whether it has more than lines; one that is not there may."""
    if geometry is None:
        return True
    return any(surface.get("count") != "0" for tag in _SURFACES for surface in geometry.iterfind(f".//{{*}}{tag}"))


def _shown_in_scene(root: ElementTree.Element) -> Iterator[str]:
    """Ids of the geometries of the scene; of what is skinned or morphed, those of its source."""
    holders = {str(e.get("id")): e for tag in ("visual_scene", "node", "controller") for e in root.iterfind(f".//{{*}}{tag}")}
    waiting, seen = [_target(scene) for scene in root.iterfind("{*}scene/{*}instance_visual_scene")], set[str]()
    while waiting:
        at = waiting.pop()
        if at in seen:
            continue
        seen.add(at)
        if at not in holders:  # of a skin, the geometry itself
            yield at
            continue
        yield from map(_target, holders[at].iterfind(".//{*}instance_geometry"))
        waiting += [_target(one) for tag in ("instance_controller", "instance_node") for one in holders[at].iterfind(f".//{{*}}{tag}")]
        waiting += [_target(one, "source") for tag in ("skin", "morph") for one in holders[at].findall(f"{{*}}{tag}")]


def _target(reference: ElementTree.Element, attribute: str = "url") -> str:
    return str(reference.get(attribute, "")).removeprefix("#")
