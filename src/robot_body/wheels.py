"""What a robot stands on by its description: wheels that its drive turns, and casters, which only carry."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_body.urdf import Description, Joint

Array = NDArray[np.float64]

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
    """The wheels: links with shapes that turn without end about y, nothing else between them and base_link turning. In their order."""
    return [wheel for joint in description.joints.values() if (wheel := _wheel(description, joint)) is not None]


def casters(description: Description) -> list[Caster]:
    """What else stands: other links that turn without end, and balls and rolls that come to the ground of the wheels."""
    wheels = driven_wheels(description)
    ground_m = min((wheel.lowest_m for wheel in wheels), default=-np.inf)
    return list(_casters(description, {wheel.link for wheel in wheels}, ground_m))


def _wheel(description: Description, joint: Joint) -> Wheel | None:
    if joint.kind != "continuous" or not description.hangs_on_base(joint.child):
        return None
    if any(above.kind != "prismatic" for above in description.moving(joint.parent)):
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
        rolls = joint is not None and joint.kind == "continuous" and bool(description.moving(joint.parent))
        is_round = all(shape.kind in ("sphere", "cylinder") for shape in shapes)
        if rolls or (is_round and low <= ground_m + CASTER_M):
            yield Caster(link, (x / 2, y / 2, low), radius_m, rolls)
