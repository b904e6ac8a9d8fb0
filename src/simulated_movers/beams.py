"""Where beams meet moving boxes and posts, each at its own time: closed forms, for a few dozen parts and some thousand beams a tick."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numba
import numpy as np
from numpy.typing import NDArray

from simulated_movers.shapes import Part

Array = NDArray[np.float64]
Floats = NDArray[np.float32]


@dataclass(frozen=True)
class MovingParts:
    """Boxes and posts over K ticks of `tick_s`: (K + 1, P, 5) x, y, z, yaw and pitch of their middles at the ends of the ticks."""

    is_box: NDArray[np.bool_]
    half: Array
    poses: Array
    tick_s: float

    @classmethod
    def of(cls, parts: Sequence[tuple[str, Part]], poses: Array, tick_s: float) -> "MovingParts":
        """Parts with the names of their movers, as a crowd has them."""
        is_box, half = (np.array([getattr(part, field) for _, part in parts]) for field in ("is_box", "half"))
        return cls(is_box, half, poses, tick_s)

    def at(self, share: float) -> Array:
        """(P, 5) poses at a share of the first tick."""
        return np.asarray((1.0 - share) * self.poses[0] + share * self.poses[1])

    def hits(self, rays: Floats, times_s: Array) -> tuple[Floats, Floats]:
        """(N,) distances along (N, 6) rays (origin, unit direction) at (N,) seconds to the nearest part, inf for none, and (N,) cosines of
        incidence."""
        found: tuple[Floats, Floats] = _hits(rays.astype(np.float64), times_s / self.tick_s, self.poses, self.is_box, self.half)
        return found


def joined_parts(ticks: Sequence[MovingParts]) -> MovingParts | None:
    """Consecutive ticks as one; None without any."""
    if not ticks:
        return None
    return replace(ticks[0], poses=np.concatenate([ticks[0].poses, *(tick.poses[1:] for tick in ticks[1:])]))


@numba.njit(cache=True)
def _slab(origin, direction, half):  # type: ignore[no-untyped-def]  # numba
    """When a ray enters and leaves a slab about 0."""
    if direction == 0.0:
        return (-np.inf, np.inf) if abs(origin) <= half else (np.inf, -np.inf)
    a, b = (-half - origin) / direction, (half - origin) / direction
    return min(a, b), max(a, b)


@numba.njit(cache=True)
def _round(ox, oy, dx, dy, radius):  # type: ignore[no-untyped-def]  # numba
    """When a ray enters and leaves an endless post about z."""
    a, c = dx * dx + dy * dy, ox * ox + oy * oy - radius * radius
    if a == 0.0:
        return (-np.inf, np.inf) if c <= 0.0 else (np.inf, -np.inf)
    b = ox * dx + oy * dy
    root = b * b - a * c
    if root < 0.0:
        return np.inf, -np.inf
    root = np.sqrt(root)
    return (-b - root) / a, (-b + root) / a


@numba.njit(cache=True)
def _enters(o, d, half, is_box):  # type: ignore[no-untyped-def]  # numba
    """Distance to where a ray first meets a part's surface, inf for never, and the cosine there; all in the part's own frame."""
    enters, leaves = _slab(o[2], d[2], half[2])
    axis = 2
    if is_box:
        for k in range(2):
            a, b = _slab(o[k], d[k], half[k])
            if a > enters:
                enters, axis = a, k
            leaves = min(leaves, b)
    else:
        a, b = _round(o[0], o[1], d[0], d[1], half[0])
        if a > enters:
            enters, axis = a, 3
        leaves = min(leaves, b)
    if enters > leaves or enters <= 0.0:
        return np.inf, 0.0
    if axis < 3:
        return enters, abs(d[axis])
    x, y = o[0] + enters * d[0], o[1] + enters * d[1]
    return enters, abs(x * d[0] + y * d[1]) / half[0]


@numba.njit(cache=True)
def _hits(rays, ticks, poses, is_box, half):  # type: ignore[no-untyped-def]  # numba
    n, last = rays.shape[0], poses.shape[0] - 2
    hits, cosines = np.full(n, np.inf, np.float32), np.zeros(n, np.float32)
    o, d = np.empty(3), np.empty(3)
    for i in range(n):
        k = max(0, min(int(ticks[i]), last))
        u = ticks[i] - k
        for p in range(is_box.size):
            pose = (1 - u) * poses[k, p] + u * poses[k + 1, p]
            x, y, z = rays[i, 0] - pose[0], rays[i, 1] - pose[1], rays[i, 2] - pose[2]
            along = x * rays[i, 3] + y * rays[i, 4] + z * rays[i, 5]
            if x * x + y * y + z * z - along * along > half[p, 0] ** 2 + half[p, 1] ** 2 + half[p, 2] ** 2:
                continue
            cy, sy, cp, sp = np.cos(pose[3]), np.sin(pose[3]), np.cos(pose[4]), np.sin(pose[4])
            ahead, across = cy * x + sy * y, cy * rays[i, 3] + sy * rays[i, 4]
            o[0], o[1], o[2] = cp * ahead - sp * z, cy * y - sy * x, sp * ahead + cp * z
            d[0], d[1], d[2] = cp * across - sp * rays[i, 5], cy * rays[i, 4] - sy * rays[i, 3], sp * across + cp * rays[i, 5]
            hit, cosine = _enters(o, d, half[p], is_box[p])
            if hit < hits[i]:
                hits[i], cosines[i] = hit, cosine
    return hits, cosines
