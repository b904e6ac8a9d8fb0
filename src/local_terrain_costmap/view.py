"""What the costmap hands on: costs with the place where they lie. Values are those of costmap_2d."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

FREE: Final = 0
INSCRIBED: Final = 253
LETHAL: Final = 254
NO_INFORMATION: Final = 255


@dataclass(frozen=True)
class CostmapView:
    """Costs of one moment: `cost` (ny, nx) uint8, row = y, column = x, `origin_xy` the lower left corner in map, metres.

    `unknown` (ny, nx): where nothing is known of the ground, also where that costs INSCRIBED; None: where `cost` says so.
    """

    cost: NDArray[np.uint8]
    origin_xy: tuple[float, float]
    resolution: float
    unknown: NDArray[np.bool_] | None = None
