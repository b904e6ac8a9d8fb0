"""The odometry that is held on the map, and the mapped surfaces around the robot for who holds it there."""

import numpy as np
import rospy
from explore_3dnav.srv import SetLocalMap
from numpy.typing import NDArray

from pose_graph_mapping.graph.mapper import PoseGraphMapper
from ros_adapters.conversions import cloud_message, pose_message
from ros_adapters.diagnostics import Diagnostics
from ros_adapters.frames import frames


def is_tracking() -> bool:
    """Whether scan_tracking_node stands between the odometry and who uses it, as /tracking says."""
    return bool(rospy.get_param("/tracking", False))


def odometry_topic() -> str:
    """Where the robot's odometry is: as tracked on the map, or as fused."""
    return "/odom_tracked" if is_tracking() else "/odom"


class LocalMapService:
    """Calls scan_tracking_node/set_map; it is a service, so that the map is there before anybody acts on the sweep."""

    def __init__(self, mapper: PoseGraphMapper) -> None:
        """`mapper` has the clouds."""
        self._mapper = mapper
        self._call = rospy.ServiceProxy("scan_tracking_node/set_map", SetLocalMap, persistent=True)

    def send(self, stamp_s: float, T_map_odom: NDArray[np.float64], diagnostics: Diagnostics) -> None:
        """The area around the last vertex; when nobody takes it the old one stays, and that is counted."""
        area = self._mapper.surroundings()
        assert area.normals is not None and area.origins is not None
        known = np.abs(area.normals).sum(axis=1) > 0.5
        message = cloud_message(stamp_s, frames().map, area.points[known], area.origins[known], area.normals[known])
        try:
            self._call(message, pose_message(T_map_odom))
        except rospy.ServiceException as error:
            diagnostics.dropped("local map not taken", str(error))
