"""How those kernels are compiled that are called for every voxel."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit

Index = int | np.integer
"""A whole number as kernels pass it on."""

Kernel = TypeVar("Kernel", bound=Callable[..., Any])
_LEAN: dict[str, Any] = {"_nrt": False, "forceinline": True}  # the first as numba compiles its own sorting


def lean_njit(function: Kernel) -> Kernel:
    """`njit(cache=True)` for what makes no arrays and calls nothing that does; numba refuses others.

    It does not count who holds the arrays that it is given, and becomes part of the kernel that calls it: both take longer, for a dozen
    arrays, than what a look-up does with them.
    """
    return cast(Kernel, njit(cache=True, **_LEAN)(function))
