"""ROS 1 messages of plain arrays, as Foxglove and other readers of MCAP know them; no ROS is needed for them."""

from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from rigid_geometry import quat_xyzw_from_transform
from rigid_geometry.transforms import Transform

Floats = NDArray[np.float64]
Colour = tuple[float, float, float]

MAP = "map"
TYPES = get_typestore(Stores.ROS1_NOETIC)
TYPES.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))  # it has no tf2
_SPHERES, _LINES, _FLOAT32, _INFO = 7, 5, 7, 2


def _new(name: str, *values: object) -> object:
    package, _, kind = name.partition("/")
    return TYPES.types[f"{package}/msg/{kind}"](*values)  # type: ignore[arg-type]


def _header(stamp_s: float, frame: str = MAP) -> object:
    seconds, nanoseconds = divmod(round(stamp_s * 1e9), 10**9)
    return _new("std_msgs/Header", 0, _new("builtin_interfaces/Time", seconds, nanoseconds), frame)


def cloud(stamp_s: float, points: NDArray[np.floating], columns: Mapping[str, NDArray[np.float32]] | None = None) -> object:
    """PointCloud2 of (N, 3) points in map, with a column of N numbers for each further name."""
    names = ["x", "y", "z", *(columns or {})]
    table = np.column_stack([points.astype(np.float32), *(columns or {}).values()]).astype(np.float32, copy=False)
    fields = [_new("sensor_msgs/PointField", name, 4 * i, _FLOAT32, 1) for i, name in enumerate(names)]
    size = 4 * len(names)
    data = np.frombuffer(np.ascontiguousarray(table).tobytes(), np.uint8)
    return _new("sensor_msgs/PointCloud2", _header(stamp_s), 1, len(table), fields, False, size, size * len(table), data, True)


def packed_rgb(colours: NDArray[np.floating]) -> NDArray[np.float32]:
    """(N,) colours as the field "rgb" has them, of (N, 3) shares of red, green and blue."""
    red, green, blue = (np.round(255 * np.asarray(colours)).astype(np.uint32)).T
    return cast(NDArray[np.float32], ((red << 16) | (green << 8) | blue).astype(np.uint32).view(np.float32))


def _point(xyz: Floats) -> object:
    return _new("geometry_msgs/Point", *map(float, xyz))


def _pose(T: Transform) -> object:
    return _new("geometry_msgs/Pose", _point(T[:3, 3]), _new("geometry_msgs/Quaternion", *map(float, quat_xyzw_from_transform(T))))


def path(stamp_s: float, stamps_s: Sequence[float], poses: Floats) -> object:
    """Path of (N, 4, 4) poses in map, each with its stamp."""
    posed = [_new("geometry_msgs/PoseStamped", _header(s), _pose(T)) for s, T in zip(stamps_s, poses, strict=True)]
    return _new("nav_msgs/Path", _header(stamp_s), posed)


def transform(stamp_s: float, T: Transform) -> object:
    """TFMessage of one frame in map."""
    moved = _new("geometry_msgs/Vector3", *map(float, T[:3, 3]))
    turned = _new("geometry_msgs/Quaternion", *map(float, quat_xyzw_from_transform(T)))
    stamped = _new("geometry_msgs/TransformStamped", _header(stamp_s), "base_link", _new("geometry_msgs/Transform", moved, turned))
    return _new("tf2_msgs/TFMessage", [stamped])


def spheres(stamp_s: float, name: str, points: Floats, size_m: float, colour: Colour) -> object:
    """Marker of (N, 3) points in map."""
    return _marker(stamp_s, name, _SPHERES, points, size_m, colour)


def lines(stamp_s: float, name: str, ends: Floats, width_m: float, colour: Colour) -> object:
    """Marker of lines, each between two of (2 N, 3) points in map."""
    return _marker(stamp_s, name, _LINES, ends, width_m, colour)


def markers(found: Sequence[object]) -> object:
    """MarkerArray."""
    return _new("visualization_msgs/MarkerArray", list(found))


def _marker(stamp_s: float, name: str, kind: int, points: Floats, size_m: float, colour: Colour) -> object:
    size, whole = _new("geometry_msgs/Vector3", size_m, size_m, size_m), _new("std_msgs/ColorRGBA", *colour, 1.0)
    place, forever = _pose(np.eye(4)), _new("builtin_interfaces/Duration", 0, 0)
    at = [_point(p) for p in points]
    return _new("visualization_msgs/Marker", _header(stamp_s), name, 0, kind, 0, place, size, whole, forever, False, at, [], "", "", False)


def event(stamp_s: float, state: str) -> object:
    """Log of what the robot does from now on."""
    return _new("rosgraph_msgs/Log", _header(stamp_s, ""), _INFO, "explore", state, "", "", 0, [])
