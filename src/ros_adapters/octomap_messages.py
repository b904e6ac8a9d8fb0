"""octomap_msgs: the installed package where there is one, else the same types built from their definitions."""

import numpy as np
from std_msgs.msg import Header

from octomap_server_3dnav.octree.octree import OctreeMap
from ros_adapters.built_types import PARTS, message_class
from ros_adapters.conversions import ros_time
from ros_adapters.frames import frames

try:
    from octomap_msgs.msg import Octomap as Octomap
    from octomap_msgs.srv import BoundingBoxQuery as BoundingBoxQuery
    from octomap_msgs.srv import GetOctomap as GetOctomap
except ImportError:

    def _service_class(name: str, md5: str, request: type, response: type) -> type:
        """A service type as rospy takes it."""
        return type(name, (), {"_type": f"octomap_msgs/{name}", "_md5sum": md5, "_request_class": request, "_response_class": response})

    Octomap = message_class("octomap_msgs/Octomap", PARTS["octomap_msgs/Octomap"], "std_msgs/Header")
    GetOctomap = _service_class(
        "GetOctomap",
        "be9d2869d24fe40d6bc21ac21f6bb2c5",
        message_class("octomap_msgs/GetOctomapRequest", ""),
        message_class("octomap_msgs/GetOctomapResponse", "octomap_msgs/Octomap map\n", "octomap_msgs/Octomap", "std_msgs/Header"),
    )
    BoundingBoxQuery = _service_class(
        "BoundingBoxQuery",
        "93aa3d73b866f04880927745f4aab303",
        message_class("octomap_msgs/BoundingBoxQueryRequest", "geometry_msgs/Point min\ngeometry_msgs/Point max\n", "geometry_msgs/Point"),
        message_class("octomap_msgs/BoundingBoxQueryResponse", ""),
    )


def octomap_message(stamp_s: float, frame: str, resolution: float, data: bytes, *, binary: bool) -> "Octomap":
    """An OcTree's data (binary: writeBinaryData, else writeData) as octomap_msgs/Octomap."""
    header = Header(stamp=ros_time(stamp_s), frame_id=frame)
    return Octomap(header=header, binary=binary, id="OcTree", resolution=resolution, data=np.frombuffer(data, np.int8).tolist())


def whole_octomap(stamp_s: float, tree: OctreeMap, *, binary: bool) -> "Octomap":
    """All of a tree in the map frame, as octomap_server publishes and serves it."""
    return octomap_message(stamp_s, frames().map, tree.resolution, tree.to_binary() if binary else tree.to_full(), binary=binary)
