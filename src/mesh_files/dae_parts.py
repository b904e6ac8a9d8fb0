"""Which of a scene's geometries are the part of a mesh file that somebody named: in COLLADA, by the name of its node."""

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection
from pathlib import Path

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
        str(instance.get("url", "")).removeprefix("#")
        for node in root.iterfind(".//{*}node")
        if name in (node.get("name"), node.get("id"))
        for instance in node.findall("{*}instance_geometry")
    ]
    return shown + [str(geometry.get("id")) for geometry in root.iterfind(".//{*}geometry") if geometry.get("name") == name]
