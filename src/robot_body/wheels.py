"""What a robot stands on by its description: wheels that its drive turns, and casters, which only carry."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from robot_body.urdf import Description, Joint

_ALONG = 0.999  # cosine between a wheel's axle and the y axis
CASTER_M = 0.005  # a ball or roll of the body that comes so near to the ground carries it


@dataclass(frozen=True)
class Wheel:
    """A driven wheel: its middle in base_link, and whether it rolls forward where its joint turns positively (1) or negatively (-1)."""

    joint: str
    link: str
    xyz_m: tuple[float, float, float]
    radius_m: float
    width_m: float
    forward: float

    @property
    def is_left(self) -> bool:
        """On which side it is."""
        return self.xyz_m[1] > 0.0

    @property
    def lowest_m(self) -> float:
        """Its lowest point in base_link."""
        return self.xyz_m[2] - self.radius_m


@dataclass(frozen=True)
class Caster:
    """What stands on the ground and is not driven: a ball that is fixed, or a wheel that turns freely; `foot_m` its lowest point."""

    link: str
    foot_m: tuple[float, float, float]
    radius_m: float
    rolls: bool


def driven_wheels(description: Description) -> list[Wheel]:
    """The wheels, in their order: links with shapes that turn without end about y.

    Between them and base_link only limited joints move, none of which steers: they stay at zero. A wheel behind one that turns comes
    down to the ground of the others, to its own radius at least; what is higher is part of an arm.
    """
    return [wheel for wheel in _wheels(description) if _steering(description, wheel.link) is None]


def steered_wheels(description: Description) -> list[tuple[str, str]]:
    """The links of what else would be wheels, each with the limited joint that turns it about z rather than about a level axis."""
    found = ((wheel.link, _steering(description, wheel.link)) for wheel in _wheels(description))
    return [(link, joint) for link, joint in found if joint is not None]


def casters(description: Description) -> list[Caster]:
    """What else stands: links that turn without end behind a swivel that does, and balls and rolls down to the ground of the wheels."""
    wheels = driven_wheels(description)
    ground_m = min((wheel.lowest_m for wheel in wheels), default=-np.inf)
    return list(_casters(description, {wheel.link for wheel in wheels}, ground_m))


def _wheels(description: Description) -> list[Wheel]:
    """Those that are steered, too."""
    found = [wheel for joint in description.joints.values() if (wheel := _wheel(description, joint)) is not None]
    ground_m = min((wheel.lowest_m for wheel in found), default=-np.inf)
    return [wheel for wheel in found if wheel.lowest_m < ground_m + wheel.radius_m or not _turning_above(description, wheel.link)]


def _turning_above(description: Description, link: str) -> list[Joint]:
    """The joints that turn between base_link and the joint of a link."""
    return [joint for joint in description.moving(link)[1:] if joint.kind != "prismatic"]


def _steering(description: Description, link: str) -> str | None:
    axes = {joint.name: description.T_base_link(joint.child)[:3, :3] @ joint.axis for joint in _turning_above(description, link)}
    return next((name for name, axis in axes.items() if abs(axis[2]) > np.hypot(axis[0], axis[1])), None)


def _wheel(description: Description, joint: Joint) -> Wheel | None:
    if joint.kind != "continuous" or not description.hangs_on_base(joint.child):
        return None
    if any(above.kind not in ("prismatic", "revolute") for above in description.moving(joint.parent)):
        return None
    T, reach = description.T_base_link(joint.child), description.reach(joint.child)
    axis = T[:3, :3] @ joint.axis
    if reach is None or not abs(axis[1]) > _ALONG * np.linalg.norm(axis):
        return None
    x, y, z = ((reach[0] + reach[1]) / 2).tolist()
    _, width_m, height_m = (reach[1] - reach[0]).tolist()
    return Wheel(joint.name, joint.child, (x, y, z), height_m / 2, width_m, 1.0 if axis[1] > 0.0 else -1.0)


def _casters(description: Description, wheels: set[str], ground_m: float) -> Iterator[Caster]:
    for link, shapes in description.shapes.items():
        reach = description.reach(link) if link not in wheels and description.hangs_on_base(link) else None
        if reach is None:
            continue
        x, y, z = (reach[0] + reach[1]).tolist()
        low, radius_m, joint = float(reach[0][2]), float(reach[1][2] - reach[0][2]) / 2, description.joints.get(link)
        rolls = joint is not None and joint.kind == "continuous" and _swivels(description, joint.parent)
        is_round = all(shape.kind in ("sphere", "cylinder") for shape in shapes)
        if rolls or (is_round and low <= ground_m + CASTER_M):
            yield Caster(link, (x / 2, y / 2, low), radius_m, rolls)


def _swivels(description: Description, link: str) -> bool:
    return any(joint.kind == "continuous" for joint in description.moving(link))
