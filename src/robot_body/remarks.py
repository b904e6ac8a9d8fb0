"""What is told of a robot description that can be simulated: what of it is missing, and what stands for that."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from robot_body.body import RobotBody
from robot_body.shapes import box_around, found_mesh, pictures_of
from robot_body.urdf import Description, read_description, with_mount

_SMALL_M = 0.05  # a sensor's case, a bracket


def description_remarks(robot: RobotBody, text: str, folder: Path) -> list[str]:
    """A sentence each on a robot's URDF, which lies in a folder. ValueError when it cannot be read."""
    root, description = ElementTree.fromstring(text), read_description(text, folder)
    return [*_on_pictures(root, folder), *_on_inertia(description), *_on_what_is_only_seen(robot, root, description, folder)]


def _on_pictures(root: ElementTree.Element, folder: Path) -> Iterator[str]:
    names = {str(mesh.get("filename")) for mesh in root.findall("link/visual/geometry/mesh")}
    for name in sorted(names):
        if found_mesh(name, folder) is None:
            yield f"{name} is missing: rviz will not show it, and nothing else needs it"


def _on_inertia(description: Description) -> Iterator[str]:
    links = sorted(link for link in description.no_inertia if description.hangs_on_base(link))
    if links:
        yield f"{', '.join(links)}: mass without an inertia above 0: that of the box around its shapes is taken"


def _on_what_is_only_seen(robot: RobotBody, root: ElementTree.Element, description: Description, folder: Path) -> Iterator[str]:
    """Links without a collision shape that are no small thing, but for those that carry the laser."""
    laser = robot.mount("laser")
    carrying = {joint.child for joint in with_mount(description, laser).chain(laser.frame)}
    bare = {str(link.get("name")): link for link in root.findall("link") if link.find("collision") is None}
    seen = [name for name, link in bare.items() if name not in carrying and description.hangs_on_base(name) and _is_large(link, folder)]
    if seen:
        yield f"{', '.join(seen)}: no collision shape: no laser sees it in simulation, nothing touches it, and no outline is checked for it"


def _is_large(link: ElementTree.Element, folder: Path) -> bool:
    """Whether its pictures take more than a sensor's case; unknown where one cannot be read, and then they may."""
    try:
        around = box_around([shape.reach(np.eye(4)) for shape in pictures_of(link, folder) if not shape.is_missing])
    except ValueError:
        return True
    return around is not None and bool((around[1] - around[0]).max() > _SMALL_M)
