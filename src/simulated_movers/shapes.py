"""What movers are made of: boxes and round posts, some of which swing like legs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simulated_movers.specification import MoverSpec

Array = NDArray[np.float64]

LEG_SWING_RAD = 0.45  # of a person at a walk, either way
STRIDE_M = 1.4  # two steps
RADIUS_M = {"person": 0.3, "cart": 0.55, "robot": 0.6}  # of what they keep free around their middle
DOOR_M, DOOR_HEIGHT_M, DOOR_GAP_M = 0.04, 1.95, 0.02


@dataclass(frozen=True)
class Part:
    """A box, or a post whose radius is `half[0]`: half sizes (3,) in m, and its middle (3,) in the mover, z above the ground.

    `swing` is the share of the legs' angle that it swings by, about its upper end.
    """

    is_box: bool
    half: tuple[float, float, float]
    middle: tuple[float, float, float]
    swing: float = 0.0


def _box(length: float, width: float, low: float, high: float, x: float = 0.0) -> Part:
    return Part(True, (length / 2, width / 2, (high - low) / 2), (x, 0.0, (low + high) / 2))


def _post(radius: float, low: float, high: float, x: float = 0.0, y: float = 0.0, swing: float = 0.0) -> Part:
    return Part(False, (radius, radius, (high - low) / 2), (x, y, (low + high) / 2), swing)


PARTS: dict[str, tuple[Part, ...]] = {
    "person": (
        _post(0.07, 0.02, 0.85, y=0.1, swing=1.0),
        _post(0.07, 0.02, 0.85, y=-0.1, swing=-1.0),
        _post(0.18, 0.85, 1.45),
        _post(0.1, 1.45, 1.72),
    ),
    "cart": (
        _box(0.9, 0.55, 0.18, 0.3),
        _box(0.04, 0.55, 0.3, 1.0, x=-0.43),
        *(_post(0.05, 0.0, 0.18, x, y) for x in (-0.38, 0.38) for y in (-0.22, 0.22)),
    ),
    "robot": (_box(0.9, 0.6, 0.08, 0.4), _post(0.06, 0.4, 0.9)),
}


def parts_of(spec: MoverSpec) -> tuple[Part, ...]:
    """The parts of a mover; a door's leaf reaches from its hinge along x."""
    if spec.kind != "door":
        return PARTS[spec.kind]
    return (_box(spec.width_m, DOOR_M, DOOR_GAP_M, DOOR_HEIGHT_M, x=spec.width_m / 2),)


def part_poses(parts: tuple[Part, ...], place: Array, leg_rad: float) -> Array:
    """(P, 5) x, y, z of the middles, yaw and pitch of a mover's parts; `place` (4,) is its x, y, z on the ground and its yaw."""
    x, y, z, yaw = place
    c, s = np.cos(yaw), np.sin(yaw)
    poses = np.empty((len(parts), 5))
    for pose, part in zip(poses, parts, strict=True):
        pitch, (ahead, aside, up) = part.swing * leg_rad, part.middle
        ahead -= part.half[2] * np.sin(pitch)
        up += part.half[2] * (1.0 - np.cos(pitch))
        pose[:] = x + c * ahead - s * aside, y + s * ahead + c * aside, z + up, yaw, pitch
    return poses
