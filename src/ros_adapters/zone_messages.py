"""Zones as messages, both ways."""

import math
from collections.abc import Sequence

import numpy as np
from explore_3dnav.msg import Zone as ZoneMessage
from explore_3dnav.msg import ZoneList
from geometry_msgs.msg import Point32, Polygon

from map_zones import Zone, Zones
from ros_adapters.conversions import header
from ros_adapters.frames import frames


def zones_of(bounds: Sequence[ZoneMessage], no_go: Sequence[ZoneMessage]) -> Zones:
    """Of two lists of messages; what is wrong with them `Zones.problems` tells."""
    return Zones(tuple(map(_zone_of, bounds)), tuple(map(_zone_of, no_go)))


def zone_list(zones: Zones) -> ZoneList:
    """The same as a message."""
    return ZoneList(header(0.0, frames().map), [_message(z) for z in zones.bounds], [_message(z) for z in zones.no_go])


def _zone_of(message: ZoneMessage) -> Zone:
    polygon = np.array([[p.x, p.y] for p in message.polygon.points], dtype=np.float64).reshape(-1, 2)
    low, high = (message.low, message.high) if message.low or message.high else (-math.inf, math.inf)
    return Zone(polygon, low, high)


def _message(zone: Zone) -> ZoneMessage:
    """Both heights 0 say any: so infinite ones are told."""
    limits = (0.0, 0.0) if math.isinf(zone.low_m) and math.isinf(zone.high_m) else (zone.low_m, zone.high_m)
    return ZoneMessage(Polygon([Point32(x, y, 0.0) for x, y in zone.polygon.tolist()]), *limits)
