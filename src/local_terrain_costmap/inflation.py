"""Inflation layer: costs that fall with the distance to the next lethal cell, as costmap_2d's does (thesis 6.2.1)."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from local_terrain_costmap.config import CostmapConfig
from local_terrain_costmap.view import FREE, INSCRIBED, LETHAL, NO_INFORMATION


def distance_to_lethal(cost: NDArray[np.uint8], resolution: float) -> NDArray[np.float64]:
    """(ny, nx) exact distances in metres between cell centres and the next LETHAL one's; inf where there is none."""
    lethal = cost == LETHAL
    if not lethal.any():
        return np.full(cost.shape, np.inf)
    distances: NDArray[np.float64] = ndimage.distance_transform_edt(~lethal, sampling=resolution)
    return distances


def inflation_cost(distance: NDArray[np.float64], contact_m: float, config: CostmapConfig) -> NDArray[np.uint8]:
    """Costs by distance in metres: LETHAL at 0, INSCRIBED up to `contact_m`, then exponential, FREE beyond the inflation radius."""
    decay = np.exp(-config.cost_scaling_factor * np.maximum(distance - contact_m, 0.0))
    cost = ((INSCRIBED - 1) * decay).astype(np.uint8)
    cost[distance > config.inflation_radius_m] = FREE
    cost[distance <= contact_m] = INSCRIBED
    cost[distance == 0.0] = LETHAL
    return cost


def inflated(cost: NDArray[np.uint8], contact_m: float, config: CostmapConfig) -> NDArray[np.uint8]:
    """(ny, nx) costs with inflation around LETHAL cells; unknown cells give way to INSCRIBED only, as in costmap_2d.

    `contact_m`: nearer to a lethal cell the robot's middle is a contact, whatever its heading: half its width.
    """
    around = inflation_cost(distance_to_lethal(cost, config.resolution_m), contact_m, config)
    unknown = cost == NO_INFORMATION
    return np.where(unknown, np.where(around >= INSCRIBED, around, NO_INFORMATION), np.maximum(cost, around)).astype(np.uint8)
