"""The robot description beside robot.yaml: its joints, links and shapes, and where each stands in base_link."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import transform_from_rpy
from robot_body.body import RobotBody
from robot_body.mounts import SensorMount
from robot_body.package_folder import PACKAGE_FOLDER
from robot_body.shapes import Shape, box_around, origin_of, shapes_of, triple

Array = NDArray[np.float64]
Read = TypeVar("Read")

URDF_FOLDER = PACKAGE_FOLDER / "urdf"
BASE = "base_link"


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint of the tree: T_parent_child at zero, the axis that it moves about, if it moves, and how far; None without a limit."""

    name: str
    kind: str
    parent: str
    child: str
    T_parent_child: Array
    axis: tuple[float, float, float]
    limits: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Description:
    """Joints by the name of their child, collision shapes by link, and of the links that weigh something mass (kg) and its middle (3,).

    `no_inertia`: those of the latter whose inertia is not given, or 0 about an axis.
    """

    joints: dict[str, Joint]
    shapes: dict[str, tuple[Shape, ...]]
    masses: dict[str, tuple[float, Array]]
    no_inertia: frozenset[str] = frozenset()

    def reach(self, link: str) -> tuple[Array, Array] | None:
        """Lower and upper corner (3,) in base_link of what a link's shapes take, all joints at zero; None where it has none."""
        return box_around([shape.reach(self.T_base_link(link)) for shape in self.shapes.get(link, ()) if not shape.is_missing])

    def hangs_on_base(self, link: str) -> bool:
        """Whether a chain of joints leads from base_link to a link."""
        try:
            self.chain(link)
        except ValueError:
            return False
        return True

    def moving(self, link: str) -> list[Joint]:
        """The joints between a link and base_link that move."""
        return [joint for joint in self.chain(link) if joint.kind != "fixed"]

    def firm(self, head: str) -> set[str]:
        """The links that are fixed to one and hang on it, and it itself."""
        found = {head}
        while more := {j.child for j in self.joints.values() if j.kind == "fixed" and j.parent in found} - found:
            found |= more
        return found

    def around(self, frame: str) -> list[str]:
        """The links whose shapes a frame lies in, all joints at zero. ValueError when no chain of joints leads to the frame."""
        place, links = self.T_base_link(frame)[:3, 3], [link for link in self.shapes if self.hangs_on_base(link)]
        return [link for link in links if any(shape.holds(self.T_base_link(link), place) for shape in self.shapes[link])]

    def housing(self, frame: str) -> set[str]:
        """The links that a sensor looks out of: its own, and those around it that it is fixed to, but for the body."""
        above = [joint.child for joint in self.chain(frame) if frame in self.firm(joint.child)]
        return {frame, *(link for link in self.around(frame) if link in above)} - {BASE}

    def T_base_link(self, link: str) -> Array:
        """Pose of a link in base_link, all joints at zero. ValueError when no chain of joints leads there."""
        T = np.eye(4)
        for joint in self.chain(link):
            T = joint.T_parent_child @ T
        return T

    def chain(self, link: str) -> list[Joint]:
        """The joints from a link up to base_link. ValueError when there is no such chain."""
        found: list[Joint] = []
        at = link
        while at != BASE:
            joint = self.joints.get(at)
            if joint is None or len(found) > len(self.joints):
                raise ValueError(f"robot_description has no chain of joints from {BASE} to {link}: {at} has no parent")
            found.append(joint)
            at = joint.parent
        return found


def urdf_file(robot: RobotBody) -> Path:
    """Where the robot's description lies: its own path, or a file of the package's folder."""
    return URDF_FOLDER / robot.urdf


def read_description(text: str, folder: Path | None = None) -> Description:
    """What a URDF, which lies in a folder, says of joints, shapes and masses. ValueError when it cannot be read."""
    try:
        root = ElementTree.fromstring(text)
        if any("xacro" in element.tag for element in root.iter()):
            raise ValueError("it is a xacro: make a URDF of it with xacro FILE > robot.urdf")
        joints = [_of(element, _joint) for element in root.findall("joint") if element.find("child") is not None]
        links = {str(link.get("name")): link for link in root.findall("link")}
        shapes = {name: _of(link, lambda of: shapes_of(of, folder)) for name, link in links.items()}
        masses = {name: found for name, link in links.items() if (found := _of(link, _mass)) is not None}
        no_inertia = frozenset(name for name in masses if not _of(links[name], _has_inertia))
    except (ElementTree.ParseError, AttributeError, TypeError, ValueError) as error:
        raise ValueError(f"robot_description cannot be read: {error}") from error
    return Description({joint.child: joint for joint in joints}, shapes, masses, no_inertia)


def with_base(text: str, base_frame: str) -> str:
    """A URDF whose link `base_frame` is called base_link, as everything here calls it. ValueError when it cannot be read."""
    if base_frame == BASE or not text:
        return text
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ValueError(f"robot_description cannot be read: {error}") from error
    for element in root.iter():
        for key in ("name",) if element.tag == "link" else ("link",):
            if element.get(key) == base_frame:
                element.set(key, BASE)
    return ElementTree.tostring(root, encoding="unicode")


def with_mount(description: Description, mount: SensorMount) -> Description:
    """The description with a sensor's frame where robot.yaml has it, if it has none itself."""
    if mount.xyz_m is None or mount.rpy_rad is None or mount.frame in description.joints:
        return description
    T = transform_from_rpy(mount.xyz_m, mount.rpy_rad)
    added = Joint(f"{mount.sensor} of robot.yaml", "fixed", mount.parent, mount.frame, T, (1.0, 0.0, 0.0))
    return replace(description, joints={**description.joints, mount.frame: added})


def _of(element: ElementTree.Element, read: Callable[[ElementTree.Element], Read]) -> Read:
    """What is read of a joint or a link; an error tells of which."""
    try:
        return read(element)
    except (AttributeError, TypeError, ValueError) as error:
        raise ValueError(f"{element.tag} {element.get('name')}: {error}") from error


def _joint(element: ElementTree.Element) -> Joint:
    axis = element.find("axis")
    ends = [str(element.find(end).get("link")) for end in ("parent", "child")]  # type: ignore[union-attr]
    turns_about = triple(None if axis is None else axis.get("xyz"), "1 0 0")
    return Joint(
        str(element.get("name")),
        str(element.get("type")),
        ends[0],
        ends[1],
        origin_of(element),
        turns_about,
        _limits(element.find("limit")),
    )


def _limits(limit: ElementTree.Element | None) -> tuple[float, float] | None:
    """Lower and upper; one that is left out is 0, as a URDF says it."""
    return None if limit is None else (float(limit.get("lower", "0")), float(limit.get("upper", "0")))


def _mass(link: ElementTree.Element) -> tuple[float, Array] | None:
    """Mass and its middle; None where it is not given, or not above zero."""
    inertial = link.find("inertial")
    mass = None if inertial is None else inertial.find("mass")
    if inertial is None or mass is None:
        return None
    kg = float(str(mass.get("value")))
    return (kg, origin_of(inertial)[:3, 3]) if kg > 0.0 else None


def _has_inertia(link: ElementTree.Element) -> bool:
    inertia = link.find("inertial/inertia")
    return inertia is not None and min(float(str(inertia.get(axis))) for axis in ("ixx", "iyy", "izz")) > 0.0
