"""Zones as somebody draws them: squares, whose corners are moved, added and taken away. What comes of it is judged by `Zones.problems`."""

from dataclasses import dataclass, replace

import numpy as np

from map_zones.polygon import Floats
from map_zones.zones import Zone, Zones

BOUNDS, NO_GO = KINDS = ("bounds", "no_go")


@dataclass(frozen=True)
class Corner:
    """One corner of one zone of a kind, by their numbers."""

    kind: str
    zone: int
    corner: int

    @property
    def name(self) -> str:
        """As `corner_of` reads it."""
        return f"{self.kind}/{self.zone}/{self.corner}"


def corner_of(name: str) -> Corner:
    """The corner of a name; ValueError for one that is none."""
    kind, *numbers = name.split("/")
    if kind not in KINDS or len(numbers) != 2 or not all(n.isdecimal() for n in numbers):
        raise ValueError(f"{name!r} names no corner of a zone")
    return Corner(kind, int(numbers[0]), int(numbers[1]))


def corners(zones: Zones) -> dict[Corner, Floats]:
    """(2,) x and y in map of all corners."""
    return {Corner(kind, i, k): xy for kind in KINDS for i, zone in enumerate(_of(zones, kind)) for k, xy in enumerate(zone.polygon)}


def with_square(zones: Zones, kind: str, centre: tuple[float, float], side_m: float) -> Zones:
    """With one more zone, along the axes of map, of any height."""
    square = np.array(centre) + side_m * (np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) - 0.5)
    return _with(zones, kind, (*_of(zones, kind), Zone(square)))


def moved(zones: Zones, at: Corner, xy: tuple[float, float]) -> Zones:
    """With a corner elsewhere."""
    polygon = _polygon(zones, at).copy()
    polygon[at.corner] = xy
    return _with_polygon(zones, at, polygon)


def with_corner_after(zones: Zones, at: Corner) -> Zones:
    """With one more corner, half way to the next."""
    polygon = _polygon(zones, at)
    middle = (polygon[at.corner] + polygon[(at.corner + 1) % len(polygon)]) / 2.0
    return _with_polygon(zones, at, np.insert(polygon, at.corner + 1, middle, axis=0))


def without_corner(zones: Zones, at: Corner) -> Zones:
    """Without a corner."""
    return _with_polygon(zones, at, np.delete(_polygon(zones, at), at.corner, axis=0))


def without_zone(zones: Zones, at: Corner) -> Zones:
    """Without the zone of a corner."""
    _polygon(zones, at)
    return _with(zones, at.kind, tuple(zone for i, zone in enumerate(_of(zones, at.kind)) if i != at.zone))


def _of(zones: Zones, kind: str) -> tuple[Zone, ...]:
    return zones.bounds if kind == BOUNDS else zones.no_go


def _with(zones: Zones, kind: str, of_kind: tuple[Zone, ...]) -> Zones:
    return replace(zones, bounds=of_kind) if kind == BOUNDS else replace(zones, no_go=of_kind)


def _polygon(zones: Zones, at: Corner) -> Floats:
    """ValueError for a corner that is not there: somebody else has set other zones meanwhile."""
    of_kind = _of(zones, at.kind)
    if at.zone >= len(of_kind) or at.corner >= len(of_kind[at.zone].polygon):
        raise ValueError(f"there is no corner {at.name} any more")
    return of_kind[at.zone].polygon


def _with_polygon(zones: Zones, at: Corner, polygon: Floats) -> Zones:
    changed = tuple(replace(zone, polygon=polygon) if i == at.zone else zone for i, zone in enumerate(_of(zones, at.kind)))
    return _with(zones, at.kind, changed)
