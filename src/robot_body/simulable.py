"""Whether a robot can be simulated by its description: it needs weight, wheels on the ground, and its meshes."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robot_body.agreement import contradictions
from robot_body.body import RobotBody
from robot_body.shapes import found_mesh
from robot_body.tilting_mount import laser_mount
from robot_body.urdf import BASE, Description, read_description
from robot_body.wheels import CASTER_M, casters, driven_wheels

Array = NDArray[np.float64]


def simulation_problems(robot: RobotBody, text: str, folder: Path) -> list[str]:
    """What keeps a robot, whose URDF lies in a folder, from being simulated: a sentence each, contradictions to its file included."""
    try:
        description = read_description(text, folder)
        if broken := [*_of_tree(description, text), *_of_meshes(description)]:
            return broken
        problems = [*_of_weight(description), *_of_wheels(description), *contradictions(robot, text, folder)]
        return problems or [*_of_standing(description), *_of_mount(robot, text)]
    except ValueError as error:
        return [str(error)]


def missing_visuals(text: str, folder: Path) -> list[str]:
    """Meshes that only a picture of the robot would need, and that are not there."""
    names = [str(mesh.get("filename")) for mesh in ElementTree.fromstring(text).findall("link/visual/geometry/mesh")]
    return sorted({name for name in names if found_mesh(name, folder) is None})


def _of_tree(description: Description, text: str) -> Iterator[str]:
    """Joints without their links, and links without a joint. What base_link itself hangs on may be there, if it weighs nothing."""
    if BASE not in description.shapes:
        yield f"the URDF has no link {BASE}"
        return
    for joint in description.joints.values():
        for link in (joint.parent, joint.child):
            if link not in description.shapes:
                yield f"joint {joint.name}: the URDF has no link {link}"
        if joint.kind in ("revolute", "prismatic") and not joint.is_limited:
            yield f"joint {joint.name} is {joint.kind} and has no limit: give it lower, upper, effort and velocity"
    above, at = set(), BASE
    while at in description.joints and at not in above:
        at = description.joints[at].parent
        above.add(at)
    loose = [link for link in description.shapes if link not in above and not description.hangs_on_base(link)]
    weighs = [link for link in above if link in description.masses or description.shapes.get(link)]
    if loose or weighs:
        yield f"no joint leads from {BASE} to {', '.join(loose + weighs)}"


def _of_meshes(description: Description) -> Iterator[str]:
    bare = [link for link, shapes in description.shapes.items() if any(shape.is_missing for shape in shapes)]
    if bare:
        yield f"the mesh of a collision shape of {', '.join(bare)} is missing: put it beside the URDF, or its package on ROS_PACKAGE_PATH"


def _of_weight(description: Description) -> Iterator[str]:
    """What is joined firmly weighs something together: base_link with what is fixed to it, and each part that moves."""
    heads = [BASE, *(joint.child for joint in description.joints.values() if joint.kind != "fixed")]
    weightless = [head for head in heads if description.hangs_on_base(head) and not _firm(description, head) & description.masses.keys()]
    if weightless:
        yield f"an inertial with a mass and an inertia above 0 is missing in {', '.join(weightless)}"


def _firm(description: Description, head: str) -> set[str]:
    """The links that are fixed to one, and it itself."""
    found = {head}
    while more := {j.child for j in description.joints.values() if j.kind == "fixed" and j.parent in found} - found:
        found |= more
    return found


def _of_wheels(description: Description) -> Iterator[str]:
    wheels = driven_wheels(description)
    left, right = (sum(wheel.is_left is side for wheel in wheels) for side in (True, False))
    if left != right or not wheels:
        yield (
            f"{left} wheels on the left and {right} on the right: expected as many on each side, each with a joint of type continuous "
            "about y and a collision shape"
        )
        return
    ground_m = min(wheel.lowest_m for wheel in wheels)
    feet = {w.link: w.lowest_m for w in wheels} | {c.link: c.foot_m[2] for c in casters(description)}
    for link, low_m in feet.items():
        if abs(low_m - ground_m) > CASTER_M:
            yield f"{link} is {abs(low_m - ground_m):.3g} m {'above' if low_m > ground_m else 'below'} the ground of the wheels"


def _of_standing(description: Description) -> Iterator[str]:
    feet = [w.xyz_m[:2] for w in driven_wheels(description)] + [c.foot_m[:2] for c in casters(description)]
    middle = _middle_of_weight(description)
    if not _surround(np.array(feet), middle[:2]):
        yield (
            f"its weight is at x {middle[0]:.3g} y {middle[1]:.3g}, which the wheels and casters do not surround: it falls over. "
            "A caster is a link of its own, with a sphere or cylinder down to the ground"
        )


def _middle_of_weight(description: Description) -> Array:
    found = {link: (kg, T[:3, :3] @ middle + T[:3, 3]) for link, kg, middle, T in _weights(description)}
    total = sum(kg for kg, _ in found.values())
    return np.asarray(sum(kg * place for kg, place in found.values()) / total)


def _weights(description: Description) -> Iterator[tuple[str, float, Array, Array]]:
    for link, (kg, middle) in description.masses.items():
        if description.hangs_on_base(link):
            yield link, kg, middle, description.T_base_link(link)


def _surround(feet: Array, point: Array) -> bool:
    """Whether a point (2,) lies inside the hull of (N, 2) feet: no half of the plane around it is without a foot."""
    bearings = np.sort(np.arctan2(*(feet - point).T[::-1]))
    gaps = np.diff(bearings, append=bearings[0] + 2.0 * np.pi)
    return bool(gaps.max() < np.pi)


def _of_mount(robot: RobotBody, text: str) -> Iterator[str]:
    try:
        laser_mount(text, robot.mount("laser"))
    except ValueError as error:
        yield f"mounts/laser: {error}"
