"""A polygon seen from above: what is wrong with it, what lies inside, and how far its border is. All corners are (K, 2), in metres."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_LEAST_AREA_M2 = 0.01


def polygon_problem(corners: Floats) -> str:
    """What is wrong with it, as words; empty where nothing is."""
    if corners.ndim != 2 or corners.shape[1:] != (2,) or len(corners) < 3:
        return "it needs three corners or more, each of x and y"
    if not np.isfinite(corners).all():
        return "a corner is no finite number"
    if _crosses_itself(corners):
        return "its sides cross"
    after = np.roll(corners, -1, axis=0)
    area_m2 = abs(float((corners[:, 0] * after[:, 1] - after[:, 0] * corners[:, 1]).sum())) / 2.0
    return f"it is empty: {area_m2:.3f} m2" if area_m2 < _LEAST_AREA_M2 else ""


def without_repeats(corners: Floats) -> Floats:
    """Without corners that the next one repeats, as the last of a ring that is closed."""
    if corners.ndim != 2:
        return corners
    return np.asarray(corners[(corners != np.roll(corners, -1, axis=0)).any(axis=1)])


def is_inside(corners: Floats, xy: Floats) -> NDArray[np.bool_]:
    """(N,) whether points (N, 2) lie inside, by the number of sides that a ray from each crosses."""
    inside = np.zeros(len(xy), dtype=bool)
    x, y = xy[:, 0], xy[:, 1]
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if ay != by:
            inside ^= ((ay > y) != (by > y)) & (x < ax + (y - ay) * (bx - ax) / (by - ay))
    return inside


def distance_m(corners: Floats, xy: Floats) -> Floats:
    """(N,) of points (N, 2) from the nearest side, inside or outside."""
    best = np.full(len(xy), np.inf)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = b - a
        share = np.clip((xy - a) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(xy - a - share[:, None] * along, axis=1))
    return best


def _crosses_itself(corners: Floats) -> bool:
    """Whether two sides that are not neighbours meet."""
    count, after = len(corners), np.roll(corners, -1, axis=0)
    for i in range(count):
        for j in range(i + 2, count - (i == 0)):
            if _meet(corners[i], after[i], corners[j], after[j]):
                return True
    return False


def _meet(a: Floats, b: Floats, c: Floats, d: Floats) -> bool:
    """Each reaches the other's line, and their boxes overlap: on one line only the boxes tell whether they are apart."""
    if (np.maximum(a, b) < np.minimum(c, d)).any() or (np.maximum(c, d) < np.minimum(a, b)).any():
        return False
    return _side(a, b, c) * _side(a, b, d) <= 0.0 and _side(c, d, a) * _side(c, d, b) <= 0.0


def _side(a: Floats, b: Floats, p: Floats) -> float:
    """Positive where p lies to the left of the line from a to b."""
    return float((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]))
