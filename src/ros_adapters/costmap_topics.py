"""costmap_2d's topics of the local costmap: the whole of it, what has changed since, and the footprint on it."""

import numpy as np
from geometry_msgs.msg import Point32, Polygon, PolygonStamped
from nav_msgs.msg import OccupancyGrid

from local_terrain_costmap.view import CostmapView
from rigid_geometry import transform_points
from rigid_geometry.transforms import Transform
from robot_body import RobotBody
from ros_adapters.built_types import message_class
from ros_adapters.conversions import header
from ros_adapters.frames import frames
from ros_adapters.grid_messages import occupancy_grid_message
from ros_adapters.node import Node

try:
    from map_msgs.msg import OccupancyGridUpdate as OccupancyGridUpdate
except ImportError:
    OccupancyGridUpdate = message_class(
        "map_msgs/OccupancyGridUpdate",
        "std_msgs/Header header\nint32 x\nint32 y\nuint32 width\nuint32 height\nint8[] data\n",
        "std_msgs/Header",
    )


# costmap_2d's translation of costs for OccupancyGrid: free 0, inscribed 99, lethal 100, unknown -1, between them 1..98
_OCCUPANCY_OF_COST = np.concatenate([[0], np.linspace(1, 98, 252), [99, 100, -1]]).astype(np.int8)


def costmap_message(stamp_s: float, view: CostmapView, height_m: float) -> OccupancyGrid:
    """The OccupancyGrid that costmap_2d publishes, drawn at a height in map."""
    grid = occupancy_grid_message(stamp_s, frames().map, _OCCUPANCY_OF_COST[view.cost], view.origin_xy, view.resolution)
    grid.info.origin.position.z = height_m
    return grid


class CostmapTopics:
    """As costmap_2d: the whole where the window has moved or somebody new listens, else the rectangle that has changed, if any has."""

    def __init__(self, node: Node, robot: RobotBody) -> None:
        self._whole = node.publisher("local_costmap/costmap", OccupancyGrid, latch=True)
        self._updates = node.publisher("local_costmap/costmap_updates", OccupancyGridUpdate)
        self._footprint = node.publisher("local_costmap/footprint", PolygonStamped)
        x, y = robot.half_length_m, robot.half_width_m
        self._corners = np.array([[x, y, 0.0], [-x, y, 0.0], [-x, -y, 0.0], [x, -y, 0.0]])
        self._sent: CostmapView | None = None
        self._listeners = 0

    @property
    def have_listeners(self) -> bool:
        """Whether anybody wants to know."""
        return any(topic.get_num_connections() for topic in (self._whole, self._footprint))

    def publish(self, stamp_s: float, view: CostmapView, T_map_base: Transform) -> None:
        """The footprint, and what the listeners lack of `view`, drawn at the robot's height."""
        if self._footprint.get_num_connections():
            corners = [Point32(*corner) for corner in transform_points(T_map_base, self._corners).tolist()]
            self._footprint.publish(PolygonStamped(header(stamp_s, frames().map), Polygon(corners)))
        before, self._listeners = self._listeners, self._whole.get_num_connections()
        if not self._listeners:
            return
        if self._sent is None or self._listeners > before or self._sent.origin_xy != view.origin_xy:
            self._whole.publish(costmap_message(stamp_s, view, float(T_map_base[2, 3])))
        elif view is not self._sent:
            self._publish_changes(stamp_s, self._sent, view)
        self._sent = view

    def _publish_changes(self, stamp_s: float, sent: CostmapView, view: CostmapView) -> None:
        rows, columns = np.nonzero(sent.cost != view.cost)
        if not len(rows):
            return
        y, x, end_y, end_x = rows.min(), columns.min(), rows.max() + 1, columns.max() + 1
        update = OccupancyGridUpdate(header=header(stamp_s, frames().map), x=int(x), y=int(y), width=int(end_x - x), height=int(end_y - y))
        update.data = _OCCUPANCY_OF_COST[view.cost[y:end_y, x:end_x]].ravel().tolist()
        self._updates.publish(update)
