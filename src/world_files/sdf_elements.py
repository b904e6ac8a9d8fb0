"""Elements of an SDF file: XML that knows its file and line, and the numbers and poses in it. First step of `sdf_world`."""

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import transform_from_quat, transform_from_rpy

Element = ElementTree.Element
Transform = NDArray[np.float64]

_FARTHEST = 1e9  # in metres: what no place on earth is away
_PLACE = "{place}"  # an attribute that no XML can have


def read_xml(path: Path) -> Element:
    """The root of a file. ValueError with the line when it cannot be read."""
    builder, parser = ElementTree.TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler = lambda tag, given: builder.start(tag, {**given, _PLACE: f"{path}:{parser.CurrentLineNumber}"})
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(path.read_bytes(), True)
        return builder.close()
    except expat.ExpatError as error:
        raise ValueError(f"{path}:{error.lineno}: cannot be read as XML: {expat.errors.messages[error.code]}") from error
    except (OSError, ValueError, LookupError) as error:
        raise ValueError(f"{path}: cannot be read: {error}") from error


def place(element: Element) -> str:
    """FILE:LINE of an element."""
    return str(element.get(_PLACE))


def wrong(element: Element, what: str) -> ValueError:
    """An error that names file, line and element."""
    name = f" {element.get('name')!r}" if element.get("name") else ""
    return ValueError(f"{place(element)}: <{element.tag}{name}>: {what}")


def text_of(element: Element | None, tag: str = ".") -> str:
    """The text of an element, or of its child; "" when there is none."""
    found = None if element is None else element.find(tag)
    return "" if found is None else (found.text or "").strip()


def numbers(element: Element, wanted: int) -> tuple[float, ...]:
    """So many finite numbers; ValueError names the element otherwise."""
    words = (element.text or "").split()
    try:
        values = tuple(map(float, words))
    except ValueError as error:
        raise wrong(element, f"{' '.join(words)!r} is not {wanted} numbers") from error
    if len(values) != wanted:
        raise wrong(element, f"{len(values)} numbers, {' '.join(words)!r}, where {wanted} are wanted")
    if not all(abs(value) < _FARTHEST for value in values):
        raise wrong(element, f"{' '.join(words)!r} is not finite, or beyond {_FARTHEST:g}")
    return values


def child_numbers(element: Element, tag: str, default: Sequence[float]) -> tuple[float, ...]:
    """The numbers of a child, or SDF's own default where it is not there."""
    child = element.find(tag)
    return tuple(default) if child is None else numbers(child, len(default))


def sizes(element: Element, tag: str, wanted: int) -> tuple[float, ...]:
    """So many lengths of a child: ValueError when it is not there, or one is not above 0. SDF's defaults would make up a size."""
    child = element.find(tag)
    if child is None:
        raise wrong(element, f"it has no <{tag}>")
    found = numbers(child, wanted)
    if min(found) <= 0.0:
        raise wrong(child, f"{' '.join(f'{v:g}' for v in found)} is not above 0")
    return found


def read_pose(pose: Element | None) -> Transform:
    """The transform of a <pose>, the identity where there is none: x y z roll pitch yaw, in degrees if it says so, or with a quaternion."""
    if pose is None or not (pose.text or "").strip():
        return np.eye(4)
    kind = pose.get("rotation_format", "euler_rpy")
    if kind == "quat_xyzw":
        values = numbers(pose, 7)
        length = math.hypot(*values[3:])
        if length < 1e-6:
            raise wrong(pose, "its quaternion is 0")
        x, y, z, w = (value / length for value in values[3:])
        return transform_from_quat(values[:3], (x, y, z, w))
    if kind != "euler_rpy":
        raise wrong(pose, f"rotation_format {kind!r} is neither euler_rpy nor quat_xyzw")
    x, y, z, *angles = numbers(pose, 6)
    roll, pitch, yaw = map(math.radians, angles) if pose.get("degrees") in ("true", "1") else angles
    return transform_from_rpy((x, y, z), (roll, pitch, yaw))
