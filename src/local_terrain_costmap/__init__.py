"""Local costmap of the follower: a window in the map frame that rolls with the robot, made of three layers.

Terrain comes from the local classification at every sweep. Obstacles come from the short horizontal scans between sweeps or, of a
robot that maps while it drives, from single lines at any tilt. Inflation comes from both (thesis 5.5.2, 6.2.1, figure 6.3).
In: grids and points of the map frame. Out: a `CostmapView` for the path follower.
"""

from local_terrain_costmap.config import CostmapConfig
from local_terrain_costmap.costmap import LocalCostmap
from local_terrain_costmap.view import FREE, INSCRIBED, LETHAL, NO_INFORMATION, CostmapView

__all__ = ["FREE", "INSCRIBED", "LETHAL", "NO_INFORMATION", "CostmapConfig", "CostmapView", "LocalCostmap"]
