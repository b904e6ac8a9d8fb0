"""octomap_server's topics and the classified map, published for whoever listens."""

from collections.abc import Callable
from functools import partial

import numpy as np
import rospy
from geometry_msgs.msg import Point, Vector3
from nav_msgs.msg import OccupancyGrid, Path
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from octomap_server_3dnav.navigation.class_colours import CLASS_RGB
from octomap_server_3dnav.navigation.local_grid import project
from octomap_server_3dnav.octree.octree import OctreeMap
from octomap_server_3dnav.terrain.classify import Terrain, TerrainClass
from ros_adapters.conversions import UNTURNED, cloud_message, header, path_message
from ros_adapters.frames import frames
from ros_adapters.grid_messages import occupancy_grid_message
from ros_adapters.node import Node
from ros_adapters.octomap_messages import Octomap, whole_octomap

Voxels = tuple[NDArray[np.float32], NDArray[np.float32]]

_LINK_COLOUR = ColorRGBA(0.9, 0.9, 0.9, 0.6)
_OCCUPIED_COLOUR = ColorRGBA(0.62, 0.65, 0.68, 1.0)
_FREE_COLOUR = ColorRGBA(0.3, 0.8, 0.3, 0.3)
_CLASS_OVERSIZE = 1.03  # classified voxels are occupied ones too: without it rviz shows the grey of both at random


def _points(rows: NDArray[np.floating]) -> list[Point]:
    return [Point(x, y, z) for x, y, z in rows.tolist()]


def _cubes(stamp_s: float, namespace: str, number: int, centers: NDArray[np.floating], size: float, colour: ColorRGBA) -> Marker:
    marker = Marker(
        header=header(stamp_s, frames().map), ns=namespace, id=number, type=Marker.CUBE_LIST, scale=Vector3(size, size, size), color=colour
    )
    marker.pose.orientation = UNTURNED
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


def voxel_markers(stamp_s: float, voxels: Voxels, namespace: str = "occupied", colour: ColorRGBA = _OCCUPIED_COLOUR) -> MarkerArray:
    """Centres (N, 3) and edges (N,) as octomap_server shows voxels: one cube list an edge."""
    centers, sizes = voxels
    return MarkerArray(
        [_cubes(stamp_s, namespace, i, centers[sizes == size], float(size), colour) for i, size in enumerate(np.unique(sizes))]
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
    marker.pose.orientation = UNTURNED
    marker.points = _points(np.concatenate(ends) + np.array([0.0, 0.0, 0.06]))
    return MarkerArray([marker])


def projected_map(stamp_s: float, terrain: Terrain) -> OccupancyGrid:
    """octomap_server's 2-D map, of the robot's storey: 100 obstacle or cliff, 0 ground, -1 unknown."""
    centers = terrain.centers()
    if not len(centers):
        return occupancy_grid_message(stamp_s, frames().map, np.zeros((0, 0), np.int8), (0.0, 0.0), terrain.resolution)
    low, high = centers.min(axis=0), centers.max(axis=0)
    x, y = ((low + high) / 2)[:2].tolist()
    grid = project(terrain, (x, y), float((high - low)[:2].max()) + 3 * terrain.resolution)
    return occupancy_grid_message(stamp_s, frames().map, grid.cost, grid.origin_xy, grid.resolution)


class _Latecomers(rospy.SubscribeListener):
    """Makes the newest message of a topic for who subscribes when it was not made, as nobody listened."""

    def __init__(self, catch_up: Callable[[], None]) -> None:
        super().__init__()
        self._catch_up = catch_up

    def peer_subscribe(self, topic_name: str, topic_publish: object, peer_publish: object) -> None:
        """rospy's."""
        self._catch_up()


class MapTopics:
    """Latched topics whose messages are made when somebody listens, or begins to."""

    def __init__(self, node: Node, shown_z_m: tuple[float, float] = (-np.inf, np.inf)) -> None:
        """`shown_z_m`: least and greatest height of the voxels that are shown one by one, from the next map on."""
        self.shown_z_m = shown_z_m
        self._not_made: dict[str, Callable[[], object]] = {}
        self._publishers = {
            topic: node.publisher(topic, message_type, large=True, latch=True, listener=_Latecomers(partial(self._catch_up, topic)))
            for topic, message_type in (
                ("octomap_binary", Octomap),
                ("octomap_full", Octomap),
                ("occupied_cells_vis_array", MarkerArray),
                ("free_cells_vis_array", MarkerArray),
                ("octomap_point_cloud_centers", PointCloud2),
                ("terrain_markers", MarkerArray),
                ("navigation_graph", MarkerArray),
                ("projected_map", OccupancyGrid),
                ("plan", Path),
            )
        }

    def publish(self, stamp_s: float, tree: OctreeMap, terrain: Terrain | None, path: NDArray[np.float64] | None) -> None:
        """The newest map and the last decision's path; without a terrain octomap_server's topics only."""
        self._publish("octomap_binary", lambda: whole_octomap(stamp_s, tree, binary=True))
        self._publish("octomap_full", lambda: whole_octomap(stamp_s, tree, binary=False))
        self._publish("occupied_cells_vis_array", lambda: voxel_markers(stamp_s, self._shown(tree.occupied_voxels())))
        self._publish("free_cells_vis_array", lambda: voxel_markers(stamp_s, self._shown(tree.free_voxels()), "free", _FREE_COLOUR))
        self._publish("octomap_point_cloud_centers", lambda: self._centers(stamp_s, tree))
        if terrain is not None:
            self._publish("terrain_markers", lambda: terrain_markers(stamp_s, terrain))
            self._publish("navigation_graph", lambda: graph_lines(stamp_s, terrain))
            self._publish("projected_map", lambda: projected_map(stamp_s, terrain))
            self._publish("plan", lambda: path_message(stamp_s, frames().map, np.zeros((0, 3)) if path is None else path, 0.0))

    def _publish(self, topic: str, make: Callable[[], object]) -> None:
        self._not_made[topic] = make
        if self._publishers[topic].get_num_connections():
            self._catch_up(topic)

    def _catch_up(self, topic: str) -> None:
        make = self._not_made.pop(topic, None)
        if make is not None:
            self._publishers[topic].publish(make())

    def _centers(self, stamp_s: float, tree: OctreeMap) -> PointCloud2:
        centers, _ = self._shown(tree.occupied_voxels())
        return cloud_message(stamp_s, frames().map, centers, centers)

    def _shown(self, voxels: Voxels) -> Voxels:
        centers, sizes = voxels
        low, high = self.shown_z_m
        shown = (centers[:, 2] >= low) & (centers[:, 2] <= high)
        return centers[shown], sizes[shown]
