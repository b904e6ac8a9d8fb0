"""What rviz shows of exploration to be clicked: a sphere above the robot, and one at each corner of a zone, to be dragged."""

from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import InteractiveMarker, InteractiveMarkerControl, Marker

from map_zones.editing import BOUNDS
from ros_adapters.conversions import UNTURNED, header
from ros_adapters.frames import frames

ROBOT = "robot"
_ABOVE_M, _SPHERE_M, _CORNER_M = 1.5, 0.4, 0.35
_ROBOT_COLOUR = ColorRGBA(0.2, 0.55, 1.0, 0.85)
_GREEN, _RED = ColorRGBA(0.2, 0.9, 0.3, 1.0), ColorRGBA(0.95, 0.2, 0.2, 1.0)
_LEVEL = Quaternion(0.0, 0.70710678, 0.0, 0.70710678)  # turns the plane in which one drags from upright to level


def robot_marker(told: str) -> InteractiveMarker:
    """Goes with the robot; `told` stands beside it."""
    marker = InteractiveMarker(header=header(0.0, frames().base), name=ROBOT, description=told, scale=0.6)
    marker.pose = Pose(Point(0.0, 0.0, _ABOVE_M), UNTURNED)
    marker.controls = [_control(InteractiveMarkerControl.BUTTON, _sphere(_SPHERE_M, _ROBOT_COLOUR))]
    return marker


def corner_marker(name: str, kind: str, xyz: tuple[float, float, float]) -> InteractiveMarker:
    """In map; it is dragged in the plane, and has a menu."""
    marker = InteractiveMarker(header=header(0.0, frames().map), name=name, description="", scale=2.0 * _CORNER_M)
    marker.pose = Pose(Point(*xyz), UNTURNED)
    control = _control(InteractiveMarkerControl.MOVE_PLANE, _sphere(_CORNER_M, _GREEN if kind == BOUNDS else _RED))
    control.orientation = _LEVEL
    marker.controls = [control]
    return marker


def _control(mode: int, shape: Marker) -> InteractiveMarkerControl:
    return InteractiveMarkerControl(interaction_mode=mode, always_visible=True, markers=[shape], orientation=UNTURNED)


def _sphere(size_m: float, colour: ColorRGBA) -> Marker:
    marker = Marker(type=Marker.SPHERE, scale=Vector3(size_m, size_m, size_m), color=colour)
    marker.pose.orientation = UNTURNED
    return marker
