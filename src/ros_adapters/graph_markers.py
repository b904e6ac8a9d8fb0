"""The pose graph as rviz shows it: vertices, edges by kind, and the trajectory."""

from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import Point, PoseStamped, Vector3
from nav_msgs.msg import Path
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from ros_adapters.conversions import UNTURNED, header, pose_message
from ros_adapters.frames import frames

_COLOURS = {"odometry": ColorRGBA(0.6, 0.6, 0.6, 1.0), "match": ColorRGBA(1.0, 1.0, 1.0, 1.0), "loop": ColorRGBA(1.0, 0.2, 0.8, 1.0)}


def _marker(stamp_s: float, namespace: str, kind: int, size: float, colour: ColorRGBA, points: list[Point]) -> Marker:
    marker = Marker(
        header=header(stamp_s, frames().map),
        ns=namespace,
        id=0,
        type=kind,
        action=Marker.ADD,
        scale=Vector3(size, size, size),
        color=colour,
    )
    marker.pose.orientation = UNTURNED
    marker.points = points
    if not points:
        marker.action = Marker.DELETE
    return marker


def graph_markers(stamp_s: float, poses: NDArray[np.float64], edges: Sequence[tuple[int, int, str]]) -> MarkerArray:
    """(V, 4, 4) vertex poses and edges (i, j, kind) as spheres and lines."""
    at = [Point(*T[:3, 3]) for T in poses]
    markers = [_marker(stamp_s, "vertices", Marker.SPHERE_LIST, 0.22, ColorRGBA(1.0, 0.8, 0.0, 1.0), at)]
    for kind, colour in _COLOURS.items():
        ends = [at[k] for i, j, edge_kind in edges if edge_kind == kind for k in (i, j)]
        markers.append(_marker(stamp_s, kind, Marker.LINE_LIST, 0.06, colour, ends))
    return MarkerArray(markers)


def trajectory_message(stamp_s: float, stamps_s: Sequence[float], poses: NDArray[np.float64]) -> Path:
    """The vertices' poses as a path, each with the stamp of its sweep."""
    return Path(
        header(stamp_s, frames().map), [PoseStamped(header(s, frames().map), pose_message(T)) for s, T in zip(stamps_s, poses, strict=True)]
    )
