"""Worlds of a few solids."""

import numpy as np

from pybullet_simulation.solids import Solid
from pybullet_simulation.world import World, joined


def world_of(*solids: Solid) -> World:
    """Solids as a world that starts in its origin."""
    vertices, triangles = joined(solids)
    return World("test", solids, (), vertices, triangles, np.array([vertices.min(0), vertices.max(0)]), (0.0, 0.0, 0.0), 0.0)
