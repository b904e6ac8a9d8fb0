"""octomap_server's topics and the classified map, published for whoever listens."""

import numpy as np
from geometry_msgs.msg import Point, Quaternion, Vector3
from nav_msgs.msg import OccupancyGrid, Path
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from octomap_server_3dnav.navigation.class_colours import CLASS_RGB
from octomap_server_3dnav.navigation.local_grid import project
from octomap_server_3dnav.octree.octree import OctreeMap
from octomap_server_3dnav.terrain.classify import Terrain, TerrainClass
from ros_adapters.conversions import cloud_message, header, occupancy_grid_message, path_message
from ros_adapters.frames import frames
from ros_adapters.node import Node
from ros_adapters.octomap_messages import Octomap, whole_octomap

_UNTURNED = Quaternion(0.0, 0.0, 0.0, 1.0)
_LINK_COLOUR = ColorRGBA(0.9, 0.9, 0.9, 0.6)
_OCCUPIED_COLOUR = ColorRGBA(0.62, 0.65, 0.68, 1.0)
_CLASS_OVERSIZE = 1.03  # classified voxels are occupied ones too: without it rviz shows the grey of both at random


def _points(rows: NDArray[np.floating]) -> list[Point]:
    return [Point(x, y, z) for x, y, z in rows.tolist()]


def _cubes(stamp_s: float, namespace: str, number: int, centers: NDArray[np.floating], size: float, colour: ColorRGBA) -> Marker:
    marker = Marker(
        header=header(stamp_s, frames().map), ns=namespace, id=number, type=Marker.CUBE_LIST, scale=Vector3(size, size, size), color=colour
    )
    marker.pose.orientation = _UNTURNED
    marker.points = _points(centers)
    marker.action = Marker.ADD if marker.points else Marker.DELETE
    return marker


def terrain_markers(stamp_s: float, terrain: Terrain) -> MarkerArray:
    """The classes of all surface voxels as one cube list a class."""
    size = terrain.resolution * _CLASS_OVERSIZE
    return MarkerArray(
        [
            _cubes(stamp_s, c.name.lower(), int(c), terrain.centers(terrain.nodes_of(c)), size, ColorRGBA(*rgb, 1.0))
            for c, rgb in CLASS_RGB.items()
        ]
    )


def occupied_markers(stamp_s: float, tree: OctreeMap) -> MarkerArray:
    """octomap_server's occupied_cells_vis_array: one cube list a leaf size."""
    centers, sizes = tree.occupied_voxels()
    return MarkerArray(
        [_cubes(stamp_s, "occupied", i, centers[sizes == size], float(size), _OCCUPIED_COLOUR) for i, size in enumerate(np.unique(sizes))]
    )


def graph_lines(stamp_s: float, terrain: Terrain) -> MarkerArray:
    """The navigation graph's edges between traversable voxels (figure 6.4)."""
    traversable = (terrain.label == TerrainClass.TRAVERSABLE) & terrain.reached
    centers = terrain.centers()
    ends = []
    for direction in (0, 1):  # the other two are the same edges
        neighbour = terrain.neighbours[:, direction]
        linked = np.flatnonzero(traversable & (neighbour >= 0) & traversable[neighbour])
        ends.append(np.stack([centers[linked], centers[neighbour[linked]]], axis=1).reshape(-1, 3))
    marker = Marker(
        header=header(stamp_s, frames().map),
        ns="navigation_graph",
        type=Marker.LINE_LIST,
        scale=Vector3(0.01, 0.0, 0.0),
        color=_LINK_COLOUR,
    )
    marker.pose.orientation = _UNTURNED
    marker.points = _points(np.concatenate(ends) + np.array([0.0, 0.0, 0.06]))
    return MarkerArray([marker])


def projected_map(stamp_s: float, terrain: Terrain) -> OccupancyGrid:
    """octomap_server's 2-D map, of the robot's storey: 100 obstacle or cliff, 0 ground, -1 unknown."""
    centers = terrain.centers()
    low, high = centers.min(axis=0), centers.max(axis=0)
    x, y = ((low + high) / 2)[:2].tolist()
    grid = project(terrain, (x, y), float((high - low)[:2].max()) + 3 * terrain.resolution)
    return occupancy_grid_message(stamp_s, frames().map, grid.cost, grid.origin_xy, grid.resolution)


class MapTopics:
    """Builds a message only when somebody listens to its topic."""

    def __init__(self, node: Node) -> None:
        def latched(topic: str, message_type: type) -> object:
            return node.publisher(topic, message_type, large=True, latch=True)

        self._publishers = {
            "binary": latched("octomap_binary", Octomap),
            "full": latched("octomap_full", Octomap),
            "terrain": latched("terrain_markers", MarkerArray),
            "graph": latched("navigation_graph", MarkerArray),
            "occupied": latched("occupied_cells_vis_array", MarkerArray),
            "centers": latched("octomap_point_cloud_centers", PointCloud2),
            "projected": latched("projected_map", OccupancyGrid),
            "plan": latched("plan", Path),
        }

    def publish(self, stamp_s: float, tree: OctreeMap, terrain: Terrain, path: NDArray[np.float64] | None) -> None:
        """Everything about the newest map that has a listener."""
        makers = {
            "binary": lambda: whole_octomap(stamp_s, tree, binary=True),
            "full": lambda: whole_octomap(stamp_s, tree, binary=False),
            "terrain": lambda: terrain_markers(stamp_s, terrain),
            "graph": lambda: graph_lines(stamp_s, terrain),
            "occupied": lambda: occupied_markers(stamp_s, tree),
            "centers": lambda: cloud_message(stamp_s, frames().map, tree.occupied_voxels()[0], tree.occupied_voxels()[0]),
            "projected": lambda: projected_map(stamp_s, terrain),
            "plan": lambda: path_message(stamp_s, frames().map, np.zeros((0, 3)) if path is None else path, 0.0),
        }
        for name, make in makers.items():
            publisher = self._publishers[name]
            if publisher.get_num_connections():  # type: ignore[attr-defined]
                publisher.publish(make())  # type: ignore[attr-defined]
