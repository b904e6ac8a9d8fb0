"""Small algebra of (3, 3) matrices about rotations."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def skew(v: Array) -> Array:
    """(3, 3) matrix of the cross product with v (3,) from the left."""
    x, y, z = v.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def renormalised(R: Array) -> Array:
    """The rotation nearest to a product of many, (3, 3): one Newton step, enough where rounding is all that is wrong."""
    return np.asarray(R @ (1.5 * np.eye(3) - 0.5 * R.T @ R), dtype=np.float64)
