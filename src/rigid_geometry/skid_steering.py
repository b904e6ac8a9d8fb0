"""How a skid-steered robot slides on a slope while it turns: wheels that skid along do not hold against the slope."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

_ONE_IN_TEN = 0.1
_LEVEL = 0.02  # below it in proportion: where ground is level the side to which it falls is noise


def slide_per_rad(fall: ArrayLike, at_one_in_ten_m: float) -> NDArray[np.float64]:
    """Metres to its left that such a robot slides for every radian of a turn, to whichever side, and whatever it drives meanwhile.

    `fall`: the sine of the angle by which the ground falls to its left, negative to its right; `at_one_in_ten_m`: how far where that is
    0.1. It grows with the root, as measured in the simulator, over sixteen runs of `moon` and `ramp`: 0.02, 0.07, 0.11, 0.16, 0.17 and
    0.26 m where the fall is 0.01, 0.02, 0.05, 0.09, 0.18 and 0.27, in turns on the spot as in bends of any radius. Along its own
    direction the robot slides a fifth of that.
    """
    fall = np.asarray(fall, dtype=np.float64)
    return np.asarray(at_one_in_ten_m * fall / np.sqrt(_ONE_IN_TEN * np.maximum(np.abs(fall), _LEVEL)))
