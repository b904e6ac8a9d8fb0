"""What the mapping node tells of every sweep, and shows of the graph in rviz."""

import numpy as np
from explore_3dnav.msg import MappedSweep
from nav_msgs.msg import Path
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import MarkerArray

from pose_graph_mapping.graph.finished_map import Mapper
from pose_graph_mapping.graph.mapping_update import MappingUpdate
from rigid_geometry.transforms import Transform
from ros_adapters.conversions import cloud_message, header, pose_message
from ros_adapters.frames import frames
from ros_adapters.graph_markers import graph_markers, trajectory_message
from ros_adapters.node import Node


class MappingTopics:
    """Publishes /mapped_sweep, /pose_graph, /trajectory, and /cloud_map when somebody listens."""

    def __init__(self, node: Node, mapper: Mapper) -> None:
        """`mapper` has the graph and the clouds that are shown."""
        self._mapper = mapper
        self._mapped = node.publisher("mapped_sweep", MappedSweep, large=True, latch=True)  # for a terrain node that is started again
        self._graph = node.publisher("pose_graph", MarkerArray, latch=True)
        self._trajectory = node.publisher("trajectory", Path, latch=True)
        self._cloud_map = node.publisher("cloud_map", PointCloud2, large=True, latch=True)

    def repeat(self, mapped: MappedSweep) -> None:
        """A sweep of which perhaps nobody has heard."""
        self._mapped.publish(mapped)

    def publish(self, stamp_s: float, update: MappingUpdate, cloud: PointCloud2, free: PointCloud2) -> None:
        """A sweep that is mapped, its points as they came, and the graph after it."""
        mapped = MappedSweep(
            header=header(stamp_s, frames().map), vertex_id=update.vertex_id, loop_closures=update.loop_closures, cloud=cloud, free=free
        )
        mapped.vertex_poses, mapped.match_refused = [pose_message(T) for T in update.vertex_poses], update.match_refused
        self._mapped.publish(mapped)
        edges = [(i, j, kind.value) for i, j, kind in self._mapper.graph.edges()]
        self._graph.publish(graph_markers(stamp_s, self._mapper.graph.poses(), edges))
        self._trajectory.publish(trajectory_message(stamp_s, self._mapper.stamps_s, update.vertex_poses))
        if self._cloud_map.get_num_connections():
            points = self._mapper.map_cloud()
            assert points.origins is not None
            self._cloud_map.publish(cloud_message(stamp_s, frames().map, points.points, points.origins))

    def publish_failure(self, stamp_s: float, reason: str, T_map_base: Transform | None) -> MappedSweep:
        """A sweep that was lost, and where the robot is by odometry, None where nobody knows: whoever waits for this sweep must go on.

        What was told of it, for `repeat`.
        """
        stamps_s, poses = (list(kept) for kept in self._mapper.kept())
        if T_map_base is not None:
            poses, stamps_s = [*poses, T_map_base], [*stamps_s, stamp_s]
        failed = MappedSweep(header=header(stamp_s, frames().map), vertex_id=len(poses) - 1, failure=reason, lost=T_map_base is None)
        failed.vertex_poses = [pose_message(T) for T in poses]
        self._mapped.publish(failed)
        self._trajectory.publish(trajectory_message(stamp_s, stamps_s, np.stack(poses)))
        return failed
