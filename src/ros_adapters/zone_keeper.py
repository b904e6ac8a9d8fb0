"""Bounds and no-go zones as people set them: by parameter, file and service; kept in the run's folder, and shown in rviz."""

import math
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rospy
from explore_3dnav.msg import ZoneList
from explore_3dnav.srv import SetZones, SetZonesRequest, SetZonesResponse
from geometry_msgs.msg import Point, Vector3
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray

from map_zones import Zone, Zones, read_zones, write_zones, zones_from_mapping
from ros_adapters.asking import waiting_for
from ros_adapters.conversions import UNTURNED, header
from ros_adapters.frames import frames
from ros_adapters.node import Node
from ros_adapters.zone_messages import zone_list, zones_of
from whole_files import refusal

FILE, REPLAN = "zones.yaml", "move_base_node/replan"
_BOUNDS, _NO_GO = ColorRGBA(0.2, 0.9, 0.3, 1.0), ColorRGBA(0.95, 0.2, 0.2, 1.0)
_WIDTH_M = 0.05
Place = NDArray[np.float64]
_MEMORY = "zones"


class ZoneKeeper:
    """Serves /explore/set_zones, publishes /explore/zones (MarkerArray) and /explore/zone_list (ZoneList), latched, reads ~zones,
    or those of the session in the run's folder.

    Wrong ones end the node with exit code 2.
    """

    def __init__(self, node: Node, use: Callable[[Zones], None], draw: Callable[[], None], robot: Callable[[], Place | None]) -> None:
        """`use` takes new zones, and `draw` shows the map with them; `robot` tells where (3,) in map it stood on the ground last, None
        while that is not known."""
        self._node, self._use, self._draw, self._robot, self._folder = node, use, draw, robot, node.run_folder()
        self._replan = rospy.ServiceProxy(REPLAN, Trigger)
        self._markers = node.publisher("explore/zones", MarkerArray, latch=True)
        self._list = node.publisher("explore/zone_list", ZoneList, latch=True)
        try:
            given = rospy.get_param("~zones", None)
            zones = self._of_the_session() if given is None else zones_from_mapping(given)
        except ValueError as error:
            sys.stderr.write(f"{node.name}: wrong parameter: zones: {error}\n")
            sys.exit(2)
        self._keep(node.life.kept(_MEMORY, zones))
        node.serve("explore/set_zones", SetZones, self._on_set)

    def _of_the_session(self) -> Zones:
        """Those that held when a session ended that goes on now; none in a new one."""
        path = None if self._folder is None else Path(self._folder) / FILE
        return read_zones(path) if path is not None and path.is_file() else Zones()

    def _keep(self, zones: Zones) -> None:
        self._use(zones)
        self._node.life.keep(_MEMORY, zones)
        if self._folder is not None:
            path = Path(self._folder) / FILE
            problem = ""
            try:
                write_zones(zones, path) if zones.are_set else path.unlink(missing_ok=True)
            except OSError as error:
                problem = refusal(error, path)
            self._node.diagnostics.on_terminal("the zones are not on disk", problem)
        self._markers.publish(zone_markers(zones))
        self._list.publish(zone_list(zones))

    def _draw_map(self) -> None:
        """The zones hold, and are kept, also where the map cannot be drawn with them."""
        try:
            self._draw()
        except ValueError as error:
            self._node.diagnostics.dropped("map not drawn with new zones", str(error))

    def _tell_follower(self) -> None:
        """A robot that drives stands now, and a sweep decides anew."""
        try:
            with waiting_for(REPLAN):
                self._replan()
        except rospy.ServiceException as error:
            self._node.diagnostics.dropped("move_base_node not told of zones", str(error))

    def _on_set(self, request: SetZonesRequest) -> SetZonesResponse:
        frame, expected = request.header.frame_id.lstrip("/"), frames().map
        if frame not in ("", expected):
            return SetZonesResponse(False, f"zones in frame {frame!r}, expected {expected!r}")
        zones = zones_of(request.bounds, request.no_go)
        with self._node.lock:
            problems, at = zones.problems(), self._robot()
            if not problems and at is not None and (why := zones.why_closed(at)):
                problems = [f"the robot at {why}"]
            if problems:
                return SetZonesResponse(False, "; ".join(problems))
            self._keep(zones)
            self._draw_map()
            self._tell_follower()
        return SetZonesResponse(True, f"{len(zones.bounds)} bounds, {len(zones.no_go)} no-go zones")


def zone_markers(zones: Zones) -> MarkerArray:
    """Their outlines, at both heights where these are given; green the bounds, red the no-go zones."""
    markers = [Marker(action=Marker.DELETEALL)]
    for name, kind, colour in (("bounds", zones.bounds, _BOUNDS), ("no_go", zones.no_go, _NO_GO)):
        for zone in kind:
            heights = [h for h in (zone.low_m, zone.high_m) if math.isfinite(h)] or [0.0]
            markers += [_outline(name, len(markers), zone, height, colour) for height in heights]
    return MarkerArray(markers)


def _outline(name: str, number: int, zone: Zone, height: float, colour: ColorRGBA) -> Marker:
    marker = Marker(
        header=header(0.0, frames().map), ns=name, id=number, type=Marker.LINE_STRIP, scale=Vector3(_WIDTH_M, 0.0, 0.0), color=colour
    )
    marker.pose.orientation = UNTURNED
    marker.points = [Point(x, y, height) for x, y in [*zone.polygon.tolist(), zone.polygon[0].tolist()]]
    return marker
