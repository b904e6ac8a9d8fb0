"""Frontiers with their cost, and the goal, for rviz."""

from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from octomap_server_3dnav.exploration.decision import Decision
from rigid_geometry import transform_from_rpy
from ros_adapters.conversions import UNTURNED, header, pose_message
from ros_adapters.frames import frames

_FRONTIER_COLOUR, _CHOSEN_COLOUR = ColorRGBA(0.2, 0.4, 1.0, 1.0), ColorRGBA(0.1, 0.9, 0.2, 1.0)
_BALL, _TEXT, _ARROW = Vector3(0.25, 0.25, 0.25), Vector3(0.0, 0.0, 0.25), Vector3(0.5, 0.1, 0.1)


def frontier_markers(stamp_s: float, decision: Decision) -> MarkerArray:
    """The frontiers with their cost in metres, the one that was chosen green, and the goal as an arrow."""
    markers = [Marker(action=Marker.DELETEALL)]
    for i, frontier in enumerate(decision.frontiers):
        x, y, z = frontier.xyz
        colour = _CHOSEN_COLOUR if frontier.xyz == decision.frontier else _FRONTIER_COLOUR
        ball = Marker(ns="frontiers", id=i, type=Marker.SPHERE, scale=_BALL, color=colour)
        cost = Marker(ns="cost", id=i, type=Marker.TEXT_VIEW_FACING, scale=_TEXT, color=colour, text=f"{frontier.cost:.1f}")
        ball.pose.position, cost.pose.position = Point(x, y, z), Point(x, y, z + 0.35)
        ball.pose.orientation = cost.pose.orientation = UNTURNED
        markers += [ball, cost]
    if decision.goal is not None:
        x, y, z, yaw = decision.goal
        arrow = Marker(ns="goal", type=Marker.ARROW, scale=_ARROW, color=_CHOSEN_COLOUR)
        arrow.pose = pose_message(transform_from_rpy((x, y, z + 0.1), (0.0, 0.0, yaw)))
        markers.append(arrow)
    for marker in markers:
        marker.header = header(stamp_s, frames().map)
    return MarkerArray(markers)
