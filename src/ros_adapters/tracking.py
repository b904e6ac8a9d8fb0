"""The odometry that is held on the map, and the mapped surfaces around the robot for who holds it there."""

import numpy as np
import rospy
from explore_3dnav.srv import SetLocalMap
from numpy.typing import NDArray

from pose_graph_mapping.graph.finished_map import Mapper
from pose_graph_mapping.graph.mapping_update import MappingUpdate
from ros_adapters.asking import AskedService
from ros_adapters.conversions import cloud_message, covariance_ros_order, pose_message
from ros_adapters.diagnostics import Diagnostics
from ros_adapters.frames import frames

_LEAST_SIGMAS = np.repeat([0.005, 0.002], 3)  # m and rad: no match is better


def pose_covariance(update: MappingUpdate) -> NDArray[np.float64]:
    """(6, 6) of the newest vertex: translation, then rotation, about the axes of map; the least of the first one, which defines the map."""
    least = np.diag(_LEAST_SIGMAS**2)
    if update.result is None:
        return least
    turn = np.kron(np.eye(2), update.vertex_poses[-1][:3, :3])
    return np.asarray(turn @ covariance_ros_order(update.result.covariance) @ turn.T + least)


class LocalMapService:
    """Calls scan_tracking_node/set_map; it is a service, so that the map is there before anybody acts on the sweep."""

    def __init__(self, mapper: Mapper) -> None:
        """`mapper` has the clouds."""
        self._mapper = mapper
        self._call = AskedService("scan_tracking_node/set_map", SetLocalMap)

    def send(self, stamp_s: float, update: MappingUpdate, diagnostics: Diagnostics, *, stands: bool) -> None:
        """The area around the last vertex; when nobody takes it the old one stays, and that is counted.

        `stands`: the robot is where the sweep was placed, so the match tells how well its pose is known.
        """
        covariance = pose_covariance(update).ravel().tolist() if stands and (update.match_used or update.result is None) else []
        try:
            area = self._mapper.surroundings()
            assert area.normals is not None and area.origins is not None
            known = np.abs(area.normals).sum(axis=1) > 0.5
            message = cloud_message(stamp_s, frames().map, area.points[known], area.origins[known], area.normals[known])
            self._call(message, pose_message(update.T_map_odom), covariance)
        except (
            rospy.ServiceException,
            ValueError,
        ) as error:  # ValueError: the graph is not solvable
            diagnostics.dropped("local map not taken", str(error))
