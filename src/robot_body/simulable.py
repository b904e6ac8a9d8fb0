"""Whether a robot can be simulated by its description: it needs weight, wheels on the ground, and its meshes."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robot_body.agreement import contradictions
from robot_body.body import RobotBody
from robot_body.tilting_mount import LEAST_TILT_RAD, laser_mount, tilt_limits
from robot_body.urdf import BASE, Description, read_description, with_mount
from robot_body.wheels import CASTER_M, casters, driven_wheels, steered_wheels

Array = NDArray[np.float64]
_OFF_MIDDLE_M = 0.02  # a fifth of what its margins hold
_LIGHTEST_KG_M3, _HEAVIEST_KG_M3 = 60.0, 20_000.0  # foam, and all metals: robots have 200 to 1,700


def simulation_problems(robot: RobotBody, text: str, folder: Path) -> list[str]:
    """What keeps a robot, whose URDF lies in a folder, from being simulated: a sentence each, contradictions to its file included."""
    try:
        description = read_description(text, folder)
        if broken := [*_of_names(text), *_of_tree(description), *_of_numbers(text), *_of_meshes(description), *_of_steering(description)]:
            return broken
        problems = [*_of_weight(description), *_of_wheels(description), *contradictions(robot, text, folder)]
        return problems or [*_of_standing(description), *_of_laser(robot, description, text), *_of_imu(robot, description)]
    except ValueError as error:
        return [str(error)]


def _of_names(text: str) -> Iterator[str]:
    """What is there twice: only one of both would be taken, and not by everybody the same."""
    root = ElementTree.fromstring(text)
    for kind, names in (
        ("link", [link.get("name") for link in root.findall("link")]),
        ("joint", [joint.get("name") for joint in root.findall("joint")]),
        ("joint to link", [child.get("link") for child in root.findall("joint/child")]),
    ):
        if twice := sorted({str(name) for name in names if names.count(name) > 1}):
            yield f"the URDF has more than one {kind} {', '.join(twice)}"


def _of_numbers(text: str) -> Iterator[str]:
    """Masses and inertias that no body has; 0 is a frame's."""
    for link in ElementTree.fromstring(text).findall("link"):
        values = [mass.get("value") for mass in link.findall("inertial/mass")]
        values += [inertia.get(axis) for inertia in link.findall("inertial/inertia") for axis in ("ixx", "iyy", "izz")]
        if not all(0.0 <= float(str(value)) < np.inf for value in values):
            yield f"link {link.get('name')}: mass and inertia are {' '.join(map(str, values))}, expected numbers above 0"


def _of_tree(description: Description) -> Iterator[str]:
    """Joints without their links, and links without a joint. What base_link itself hangs on may be there, if it weighs nothing."""
    if BASE not in description.shapes:
        yield f"the URDF has no link {BASE}"
        return
    for joint in description.joints.values():
        for link in (joint.parent, joint.child):
            if link not in description.shapes:
                yield f"joint {joint.name}: the URDF has no link {link}"
        if joint.kind in ("revolute", "prismatic") and joint.limits is None:
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
    """What is joined firmly weighs together what its shapes may: base_link with what is fixed to it, and each part that moves."""
    heads = [BASE, *(joint.child for joint in description.joints.values() if joint.kind != "fixed")]
    weightless = [head for head in heads if description.hangs_on_base(head) and not description.firm(head) & description.masses.keys()]
    if weightless:
        yield f"an inertial with a mass above 0 is missing in {', '.join(weightless)}"
        return
    for head in filter(description.hangs_on_base, heads):
        kg, m3 = _mass_and_volume(description, description.firm(head))
        if m3 > 0.0 and not _LIGHTEST_KG_M3 < kg / m3 < _HEAVIEST_KG_M3:
            yield (
                f"{head} weighs {kg:g} kg with all that is fixed to it, {kg / m3:.3g} kg for each m3 of its shapes: "
                "an inertial is missing there, or its mass is not in kg"
            )


def _mass_and_volume(description: Description, links: set[str]) -> tuple[float, float]:
    """Of links together: kg, and m3 of the boxes around their collision shapes."""
    reaches = [shape.reach(np.eye(4)) for link in links for shape in description.shapes.get(link, ())]
    kg = sum(description.masses[link][0] for link in links & description.masses.keys())
    return kg, float(sum(np.prod(high - low) for low, high in reaches))


def _of_steering(description: Description) -> Iterator[str]:
    for link, joint in steered_wheels(description):
        yield f"joint {joint} steers {link}: the robot turns by the difference of its sides, steered wheels are not known"


def _of_wheels(description: Description) -> Iterator[str]:
    wheels = driven_wheels(description)
    left, right = (sum(wheel.is_left is side for wheel in wheels) for side in (True, False))
    if left != right or not wheels:
        yield (
            f"{left} wheels on the left and {right} on the right: expected as many on each side, each with a joint of type continuous "
            "about y and a collision shape"
        )
        return
    middle = np.mean([wheel.xyz_m[:2] for wheel in wheels], axis=0)
    if np.abs(middle).max() > _OFF_MIDDLE_M:
        yield f"the middle of the wheels is at x {middle[0]:.3g} y {middle[1]:.3g} in {BASE}: put {BASE} there, the robot turns about it"
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


def _of_laser(robot: RobotBody, description: Description, text: str) -> Iterator[str]:
    """Its mount moves about y, far enough to see the ground, and no shape but its housing and what moves with it is around it."""
    laser = robot.mount("laser")
    try:
        tilt, _, _ = laser_mount(text, laser)
        low, high = tilt_limits(text, laser)
        seen = with_mount(description, laser)
        around = [link for link in seen.around(laser.frame) if link not in seen.housing(laser.frame) and not seen.moving(link)]
    except ValueError as error:
        yield f"mounts/laser: {error}"
        return
    if around:
        yield f"mounts/laser: {laser.frame} lies inside a collision shape of {', '.join(around)}, and would see nothing else"
    if tilt and not low <= 0.0 < LEAST_TILT_RAD <= high:
        yield f"joint {tilt} tilts from {low:.3g} to {high:.3g} rad: it must reach 0, and {LEAST_TILT_RAD} down to see the ground"


def _of_imu(robot: RobotBody, description: Description) -> Iterator[str]:
    imu = robot.mount("imu")
    if moving := with_mount(description, imu).moving(imu.frame):
        yield f"mounts/imu: {imu.frame} moves with joint {moving[0].name}, and has to stand firm on {BASE}"
