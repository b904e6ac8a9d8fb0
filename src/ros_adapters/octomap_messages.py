"""octomap_msgs/Octomap: the installed package where there is one, else the same type built from its definition."""

import numpy as np
from std_msgs.msg import Header

from ros_adapters.conversions import ros_time

_DEFINITION = """Header header
bool binary
string id
float64 resolution
int8[] data
================================================================================
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
"""

try:
    from octomap_msgs.msg import Octomap as Octomap
except ImportError:
    from genpy.dynamic import generate_dynamic

    Octomap = generate_dynamic("octomap_msgs/Octomap", _DEFINITION)["octomap_msgs/Octomap"]


def octomap_message(stamp_s: float, frame: str, resolution: float, data: bytes, *, binary: bool) -> "Octomap":
    """An OcTree's data (binary: writeBinaryData, else writeData) as octomap_msgs/Octomap."""
    header = Header(stamp=ros_time(stamp_s), frame_id=frame)
    return Octomap(header=header, binary=binary, id="OcTree", resolution=resolution, data=np.frombuffer(data, np.int8).tolist())


def octomap_bytes(message: "Octomap") -> bytes:
    """The bytes of a received Octomap; ValueError when it is not an OcTree with a usable resolution."""
    if message.id != "OcTree" or not message.resolution > 0:
        raise ValueError(f"octomap of type {message.id!r} and resolution {message.resolution}, expected an OcTree")
    return np.asarray(message.data, dtype=np.int8).tobytes()
