"""The robot description beside robot.yaml: where its joints are, how far its shapes reach, and where the two contradict each other."""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import rotation_angles, transform_from_rpy, transform_points
from robot_body.body import RobotBody
from robot_body.mounts import SensorMount

Array = NDArray[np.float64]

URDF_FOLDER = Path(__file__).resolve().parents[2] / "urdf"
BASE = "base_link"
_SAME_M, _SAME_RAD = 1e-3, 1e-3
_MOST_AROUND_M = 0.05  # by so much an outline may be larger than the shapes: cables, and a laser that tilts up


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint of the tree: T_parent_child at zero, and the axis that it moves about, if it moves."""

    name: str
    kind: str
    parent: str
    child: str
    T_parent_child: Array
    axis: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Description:
    """Joints by the name of their child, and the (8, 3) corners of the boxes around each link's collision shapes, in that link."""

    joints: dict[str, Joint]
    corners: dict[str, Array]
    wheel_radii_m: dict[str, tuple[float, float]]

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


def read_description(text: str) -> Description:
    """What a URDF says of joints and shapes. ValueError when it cannot be read."""
    try:
        root = ElementTree.fromstring(text)
        joints = [_joint(element) for element in root.findall("joint") if element.find("child") is not None]
        links = {str(link.get("name")): link for link in root.findall("link")}
        corners = {name: np.vstack(boxes) for name, link in links.items() if (boxes := [*_boxes(link)])}
    except (ElementTree.ParseError, AttributeError, TypeError) as error:
        raise ValueError(f"robot_description cannot be read: {error}") from error
    return Description({joint.child: joint for joint in joints}, corners, dict(_cylinders(links)))


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
    return Description({**description.joints, mount.frame: added}, description.corners, description.wheel_radii_m)


def contradictions(robot: RobotBody, text: str) -> list[str]:
    """Where robot.yaml and a URDF say different things, a sentence each; what the URDF has not contradicts nothing."""
    try:
        description = read_description(text)
        return [*_of_wheels(robot, description), *_of_outline(robot, description), *_of_mounts(robot, description)]
    except ValueError as error:
        return [str(error)]


def _numbers(text: str | None, default: str) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in (text or default).split())
    return x, y, z


def _origin(element: ElementTree.Element) -> Array:
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    return np.asarray(transform_from_rpy(_numbers(origin.get("xyz"), "0 0 0"), _numbers(origin.get("rpy"), "0 0 0")))


def _joint(element: ElementTree.Element) -> Joint:
    axis = element.find("axis")
    ends = [str(element.find(end).get("link")) for end in ("parent", "child")]  # type: ignore[union-attr]
    turns_about = _numbers(None if axis is None else axis.get("xyz"), "1 0 0")
    return Joint(str(element.get("name")), str(element.get("type")), ends[0], ends[1], _origin(element), turns_about)


def _boxes(link: ElementTree.Element) -> Iterator[Array]:
    for collision in link.findall("collision"):
        box, cylinder = collision.find("geometry/box"), collision.find("geometry/cylinder")
        if box is not None:
            half = np.array(_numbers(box.get("size"), "0 0 0")) / 2
        elif cylinder is not None:
            radius, length = float(str(cylinder.get("radius"))), float(str(cylinder.get("length")))
            half = np.array([radius, radius, length / 2])
        else:
            continue
        corners = np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * half
        yield np.asarray(transform_points(_origin(collision), corners), dtype=np.float64)


def _cylinders(links: dict[str, ElementTree.Element]) -> Iterator[tuple[str, tuple[float, float]]]:
    for name, link in links.items():
        cylinder = link.find("collision/geometry/cylinder")
        if cylinder is not None:
            yield name, (float(str(cylinder.get("radius"))), float(str(cylinder.get("length"))))


def _differing(name: str, ours_m: float, theirs_m: float) -> Iterator[str]:
    if abs(ours_m - theirs_m) > _SAME_M:
        yield f"{name} = {ours_m:.4g}, and the URDF has {theirs_m:.4g}"


def _wheels(description: Description) -> list[str]:
    """Links that turn without end about y and are cylinders."""
    joints = description.joints.values()
    turning = [j.child for j in joints if j.kind == "continuous" and j.axis == (0.0, 1.0, 0.0)]
    return [link for link in turning if link in description.wheel_radii_m]


def _of_wheels(robot: RobotBody, description: Description) -> Iterator[str]:
    wheels = _wheels(description)
    if not wheels:
        return
    places = np.array([description.T_base_link(wheel)[:3, 3] for wheel in wheels])
    radius_m, width_m = description.wheel_radii_m[wheels[0]]
    yield from _differing("wheel_radius_m", robot.wheel_radius_m, radius_m)
    yield from _differing("wheel_width_m", robot.wheel_width_m, width_m)
    yield from _differing("track_m", robot.track_m, float(np.ptp(places[:, 1])))
    yield from _differing("wheelbase_m", robot.wheelbase_m, float(np.ptp(places[:, 0])))
    yield from _differing("base_height_m", robot.base_height_m, radius_m - float(places[:, 2].min()))


def _of_outline(robot: RobotBody, description: Description) -> Iterator[str]:
    reached = {link: transform_points(description.T_base_link(link), corners) for link, corners in description.corners.items()}
    if not reached:
        return
    low, high = np.vstack([*reached.values()]).min(axis=0), np.vstack([*reached.values()]).max(axis=0)
    half = np.maximum(-low, high)
    yield from _too_small_or_large("length_m", robot.length_m, 2 * float(half[0]))
    yield from _too_small_or_large("width_m", robot.width_m, 2 * float(half[1]))
    yield from _too_small_or_large("height_m", robot.height_m, robot.base_height_m + float(high[2]))
    belly = [points[:, 2].min() for link, points in reached.items() if link not in _wheels(description)]
    if belly and robot.ground_clearance_m > robot.base_height_m + min(belly) + _SAME_M:
        yield f"ground_clearance_m = {robot.ground_clearance_m:.4g}, and the URDF has {robot.base_height_m + min(belly):.4g}"


def _too_small_or_large(name: str, ours_m: float, theirs_m: float) -> Iterator[str]:
    if not -_SAME_M <= ours_m - theirs_m <= _MOST_AROUND_M:
        yield f"{name} = {ours_m:.4g}, and the shapes of the URDF take {theirs_m:.4g}; it may be more by up to {_MOST_AROUND_M:g}"


def _of_mounts(robot: RobotBody, description: Description) -> Iterator[str]:
    for mount in robot.mounts:
        joint = description.joints.get(mount.frame)
        if mount.xyz_m is None or mount.rpy_rad is None:
            if joint is None and mount.frame != BASE:
                yield f"mounts/{mount.sensor}: the URDF has no frame {mount.frame}"
        elif joint is None:
            if mount.parent != BASE and mount.parent not in description.joints:
                yield f"mounts/{mount.sensor}: the URDF has no frame {mount.parent}"
        elif joint.parent != mount.parent:
            yield f"mounts/{mount.sensor}: {mount.frame} is mounted on {mount.parent}, and in the URDF on {joint.parent}"
        else:
            yield from _pose_differing(mount, transform_from_rpy(mount.xyz_m, mount.rpy_rad), joint.T_parent_child)


def _pose_differing(mount: SensorMount, ours: Array, theirs: Array) -> Iterator[str]:
    off_m = float(np.linalg.norm(ours[:3, 3] - theirs[:3, 3]))
    off_rad = float(rotation_angles((ours[:3, :3].T @ theirs[:3, :3])[None])[0])
    if off_m > _SAME_M or off_rad > _SAME_RAD:
        yield f"mounts/{mount.sensor}: {mount.frame} is {off_m:.4g} m and {off_rad:.4g} rad from where the URDF has it"
