"""The robot description as the physics engine needs it: without pictures, with every mesh at hand, no link without a mass, and every
joint fixed that is neither the laser's nor a wheel's nor a caster's: nothing drives it."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import trimesh

from robot_body import Shape, casters, driven_wheels, mesh_surface, read_description
from robot_body.urdf import Description

_DUST = "1e-6"  # kg, kg m^2: what a frame without a mass weighs; the engine would take it for 1 kg
_WATER_KG_M3 = 1000.0


def write_simulated_urdf(urdf: Path, folder: Path, tilt_joint: str | None) -> Path:
    """Writes such a description of the links from base_link on into a folder, with its meshes; where it lies. The tilt joint moves."""
    text = urdf.read_text(encoding="utf-8")
    root, description = ElementTree.fromstring(text), read_description(text, urdf.parent)
    kept = {link for link in description.shapes if description.hangs_on_base(link)}
    links = [link for link in root.findall("link") if link.get("name") in kept]
    joints = [joint for joint in root.findall("joint") if _children(joint) & kept - {"base_link"}]
    moving = {tilt_joint} | _rolling(description)
    for joint in joints:
        if joint.get("name") not in moving:
            joint.set("type", "fixed")
    for link in links:
        name = str(link.get("name"))
        if name not in description.masses:
            _give_mass(link)
        elif name in description.no_inertia:
            _give_inertia(link, description.masses[name][0], description.shapes[name])
        for i, (collision, shape) in enumerate(zip(link.findall("collision"), description.shapes[name], strict=True)):
            if shape.mesh is not None:
                hull = trimesh.Trimesh(*mesh_surface(shape.mesh, shape.scale)).convex_hull
                hull.export(folder / f"{name}_{i}.obj")
                _replace_mesh(collision, f"{name}_{i}.obj")
        for visual in link.findall("visual"):
            link.remove(visual)
    for other in list(root):
        if other not in links and other not in joints:
            root.remove(other)
    path = folder / "robot.urdf"
    ElementTree.ElementTree(root).write(path)
    return path


def _rolling(description: Description) -> set[str]:
    """The joints without a limit of wheels and casters."""
    links = [wheel.link for wheel in driven_wheels(description)] + [caster.link for caster in casters(description)]
    return {joint.name for link in links for joint in description.moving(link) if joint.kind == "continuous"}


def _children(joint: ElementTree.Element) -> set[str]:
    return {str(child.get("link")) for child in joint.findall("child")}


def _give_mass(link: ElementTree.Element) -> None:
    for inertial in link.findall("inertial"):
        link.remove(inertial)
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "mass", value=_DUST)
    ElementTree.SubElement(inertial, "inertia", ixx=_DUST, ixy="0", ixz="0", iyy=_DUST, iyz="0", izz=_DUST)


def _give_inertia(link: ElementTree.Element, kg: float, shapes: tuple[Shape, ...]) -> None:
    """That of a box around its shapes, as heavy all over; without shapes that of a ball as dense as water."""
    inertial = link.find("inertial")
    assert inertial is not None
    if shapes:
        low, high = (np.stack(corners) for corners in zip(*(shape.reach(np.eye(4)) for shape in shapes), strict=True))
        squares = (high.max(axis=0) - low.min(axis=0)) ** 2
        moments = kg * (squares.sum() - squares) / 12.0
    else:
        moments = np.full(3, 0.4 * kg * (0.75 * kg / (np.pi * _WATER_KG_M3)) ** (2 / 3))
    for old in inertial.findall("inertia"):
        inertial.remove(old)
    for origin in inertial.findall("origin"):
        origin.attrib.pop("rpy", None)
    ixx, iyy, izz = (f"{max(moment, float(_DUST)):.6g}" for moment in moments)
    ElementTree.SubElement(inertial, "inertia", ixx=ixx, ixy="0", ixz="0", iyy=iyy, iyz="0", izz=izz)


def _replace_mesh(collision: ElementTree.Element, name: str) -> None:
    geometry = collision.find("geometry")
    assert geometry is not None
    geometry.clear()
    ElementTree.SubElement(geometry, "mesh", filename=name)
