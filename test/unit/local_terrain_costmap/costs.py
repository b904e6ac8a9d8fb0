"""What a costmap says of single places."""

from local_terrain_costmap import NO_INFORMATION
from local_terrain_costmap.view import CostmapView


def cost_at(view: CostmapView, x: float, y: float) -> int:
    """The cost under a place of the map; NO_INFORMATION outside the window."""
    column, row = (
        int((v - origin) / view.resolution + 1e-9) if v >= origin else -1 for v, origin in zip((x, y), view.origin_xy, strict=True)
    )
    ny, nx = view.cost.shape
    return int(view.cost[row, column]) if 0 <= row < ny and 0 <= column < nx else NO_INFORMATION
