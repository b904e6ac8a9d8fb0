"""Where the robot may drive: bounds and no-go zones, polygons in map with a range of heights, as people draw them."""

from map_zones.closed_columns import ClosedColumns
from map_zones.zones import NO_ZONES, Zone, Zones, read_zones, write_zones, zones_from_mapping, zones_mapping

__all__ = ["NO_ZONES", "ClosedColumns", "Zone", "Zones", "read_zones", "write_zones", "zones_from_mapping", "zones_mapping"]
