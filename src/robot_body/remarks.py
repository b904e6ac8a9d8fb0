"""What is told of a robot description that can be simulated: what of it is missing, and what stands for that."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

from robot_body.shapes import found_mesh
from robot_body.urdf import Description, read_description


def description_remarks(text: str, folder: Path) -> list[str]:
    """A sentence each on a URDF that lies in a folder. ValueError when it cannot be read."""
    return [*_on_pictures(text, folder), *_on_inertia(read_description(text, folder))]


def _on_pictures(text: str, folder: Path) -> Iterator[str]:
    names = {str(mesh.get("filename")) for mesh in ElementTree.fromstring(text).findall("link/visual/geometry/mesh")}
    for name in sorted(names):
        if found_mesh(name, folder) is None:
            yield f"{name} is missing: rviz will not show it, and nothing else needs it"


def _on_inertia(description: Description) -> Iterator[str]:
    links = sorted(link for link in description.no_inertia if description.hangs_on_base(link))
    if links:
        yield f"{', '.join(links)}: mass without an inertia above 0: that of the box around its shapes is taken"
