"""Bounds and no-go zones, and their file.

Ground is open where it lies in one of the bounds, or there are none, and in no no-go zone. All is in map, whose origin is where the robot
began. Terrain, goals and the judge ask the same question of them.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import ArrayLike, NDArray

from map_zones.polygon import Floats, distance_m, is_inside, polygon_problem, without_repeats
from stage_config import yaml_values
from whole_files import write_whole

_KINDS = ("bounds", "no_go")
_KEYS = {"polygon", "low", "high"}


@dataclass(frozen=True, eq=False)
class Zone:
    """Ground whose height is between `low_m` and `high_m` above or below a polygon (K, 2), x and y in map.

    The ring may be closed: its last corner is dropped then.
    """

    polygon: Floats
    low_m: float = -math.inf
    high_m: float = math.inf

    def __post_init__(self) -> None:
        object.__setattr__(self, "polygon", without_repeats(self.polygon))

    def problem(self) -> str:
        """What is wrong with it, as words; empty where nothing is."""
        if not self.low_m < self.high_m:
            return f"low = {self.low_m:g} is not below high = {self.high_m:g}"
        return polygon_problem(self.polygon)

    def contains(self, xyz: Floats) -> NDArray[np.bool_]:
        """(N,) of points (N, 3) of ground."""
        return is_inside(self.polygon, xyz[:, :2]) & self._is_level(xyz)

    def touches(self, xyz: Floats, voxel_m: float) -> NDArray[np.bool_]:
        """(N,) whether the centre (N, 3) of a voxel of ground lies in it, or half a voxel beside it: a thin zone leads past all centres."""
        is_near = self.contains(xyz)
        beside = np.flatnonzero(~is_near & self._is_level(xyz))
        is_near[beside] = distance_m(self.polygon, xyz[beside, :2]) <= voxel_m / 2.0
        return is_near

    def depth_m(self, xyz: Floats) -> Floats:
        """(N,) metres by which points (N, 3) of ground lie inside, negative outside it, -inf on other levels."""
        away = distance_m(self.polygon, xyz[:, :2])
        signed = np.where(is_inside(self.polygon, xyz[:, :2]), away, -away)
        return np.where(self._is_level(xyz), signed, -np.inf)

    def _is_level(self, xyz: Floats) -> NDArray[np.bool_]:
        return np.asarray((xyz[:, 2] >= self.low_m) & (xyz[:, 2] <= self.high_m))


@dataclass(frozen=True, eq=False)
class Zones:
    """Where the robot may drive: inside of any of the `bounds`, if there are any, and in none of `no_go`."""

    bounds: tuple[Zone, ...] = field(default=())
    no_go: tuple[Zone, ...] = field(default=())

    @property
    def are_set(self) -> bool:
        """Whether there are any."""
        return bool(self.bounds or self.no_go)

    def problems(self) -> list[str]:
        """All that is wrong with them, as sentences."""
        named = [(f"{kind}[{i}]", zone) for kind in _KINDS for i, zone in enumerate(getattr(self, kind))]
        return [f"{name}: {problem}" for name, zone in named if (problem := zone.problem())]

    def closed(self, xyz: Floats, voxel_m: float = 0.0) -> NDArray[np.bool_]:
        """(N,) whether the robot may not be on points (N, 3) of ground, which are centres of voxels.

        A no-go zone that is thinner than a voxel closes what it leads through.
        """
        out = np.zeros(len(xyz), dtype=bool)
        if self.bounds:
            out |= ~np.any([zone.contains(xyz) for zone in self.bounds], axis=0)
        for zone in self.no_go:
            out |= zone.touches(xyz, voxel_m)
        return out

    def depth_m(self, xyz: Floats) -> Floats:
        """(N,) metres by which points (N, 3) of ground lie where the robot may not be; 0 where it may."""
        depth = np.zeros(len(xyz))
        if self.bounds:
            depth = np.maximum(depth, np.min([-zone.depth_m(xyz) for zone in self.bounds], axis=0))
        for zone in self.no_go:
            depth = np.maximum(depth, zone.depth_m(xyz))
        return depth

    def why_closed(self, xyz: ArrayLike) -> str:
        """Why the robot may not be on a point (3,) of ground, as words; empty where it may."""
        point = np.asarray(xyz, dtype=np.float64)[None]
        for i, zone in enumerate(self.no_go):
            if zone.contains(point)[0]:
                return f"({point[0, 0]:.2f}, {point[0, 1]:.2f}) lies in no_go[{i}]"
        return f"({point[0, 0]:.2f}, {point[0, 1]:.2f}) lies outside the bounds" if self.closed(point)[0] else ""


NO_ZONES = Zones()


def zones_from_mapping(values: object) -> Zones:
    """Of {bounds: [{polygon: [[x, y], ...], low: , high: }], no_go: [...]}, all optional but the polygon; ValueError lists all problems."""
    if not isinstance(values, Mapping) or set(values) - set(_KINDS):
        raise ValueError(f"zones are a mapping of {' and '.join(_KINDS)}, each a list, not {_short(values)}")
    problems: list[str] = []
    found = {kind: tuple(_zones(kind, values.get(kind) or [], problems)) for kind in _KINDS}
    if problems:
        raise ValueError("; ".join(problems))
    zones = Zones(**found)
    if problems := zones.problems():
        raise ValueError("; ".join(problems))
    return zones


def _zones(kind: str, entries: object, problems: list[str]) -> list[Zone]:
    if not isinstance(entries, list):
        problems.append(f"{kind}: expected a list of zones, not {_short(entries)}")
        return []
    zones = []
    for i, entry in enumerate(entries):
        try:
            zones.append(_zone(entry))
        except (ValueError, TypeError) as error:
            problems.append(f"{kind}[{i}]: {error}")
    return zones


def _zone(entry: object) -> Zone:
    if not isinstance(entry, Mapping) or "polygon" not in entry or set(entry) - _KEYS:
        raise ValueError(f"expected polygon, and where wanted low and high, not {_short(entry)}")
    try:
        polygon = np.array(entry["polygon"], dtype=np.float64)
    except (ValueError, TypeError) as error:
        raise ValueError(f"polygon: expected [[x, y], ...], not {_short(entry['polygon'])}") from error
    return Zone(polygon, float(entry.get("low", -math.inf)), float(entry.get("high", math.inf)))


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def zones_mapping(zones: Zones) -> dict[str, list[dict[str, object]]]:
    """What `zones_from_mapping` makes the same zones of."""
    return {kind: [_entry(zone) for zone in getattr(zones, kind)] for kind in _KINDS}


def _entry(zone: Zone) -> dict[str, object]:
    limits = {"low": zone.low_m, "high": zone.high_m}
    return {"polygon": zone.polygon.tolist(), **{key: value for key, value in limits.items() if math.isfinite(value)}}


def read_zones(path: Path) -> Zones:
    """Of a YAML file; ValueError, with the file's name, for one that is none."""
    try:
        return zones_from_mapping(yaml_values(path.read_text(encoding="utf-8")) or {})
    except (OSError, yaml.YAMLError, UnicodeDecodeError, ValueError) as error:
        raise ValueError(f"{path}: {' '.join(str(error).split())}") from error


def write_zones(zones: Zones, path: Path) -> None:
    """As a file that `read_zones` reads; OSError where the disk does not take it."""
    write_whole(path, yaml.safe_dump(zones_mapping(zones), sort_keys=False))
