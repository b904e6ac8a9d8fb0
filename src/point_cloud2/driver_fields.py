"""What is read from which field of a cloud, and which drivers write it: the one table of it, for the code and for docs/sensors.md."""

from dataclasses import dataclass
from enum import Enum


class Use(Enum):
    """What a field is read for."""

    POINT = "point"
    BEAM_START = "start of the beam"
    NORMAL = "normal"
    RING = "ring"
    TIME = "time"
    TIME_OF_DAY = "time of day"
    RANGE = "no return"
    TAG = "noise"


@dataclass(frozen=True)
class DriverField:
    """A field, or fields that come together; `kinds`: numpy's kinds of numbers that it may be of."""

    use: Use
    names: tuple[str, ...]
    kinds: str
    meaning: str
    drivers: str


FIELDS = (
    DriverField(Use.POINT, ("x", "y", "z"), "f", "metres; NaN, infinite or all three 0: no return", "all"),
    DriverField(Use.BEAM_START, ("vp_x", "vp_y", "vp_z"), "f", "metres; without it the cloud's origin", "this package"),
    DriverField(Use.NORMAL, ("normal_x", "normal_y", "normal_z"), "f", "unit vector", "this package, PCL"),
    DriverField(Use.RING, ("ring",), "iu", "number of the laser, from below or from above", "Velodyne, Ouster, Hesai, Robosense"),
    DriverField(Use.RING, ("line",), "iu", "the same", "Livox"),
    DriverField(Use.RING, ("channel",), "iu", "the same", "Ouster, Nebula"),
    DriverField(Use.TIME, ("time",), "fiu", "after the stamp: seconds, or nanoseconds of whole numbers", "Velodyne"),
    DriverField(Use.TIME, ("t",), "fiu", "the same", "Ouster"),
    DriverField(Use.TIME, ("offset_time",), "fiu", "the same", "Livox"),
    DriverField(Use.TIME, ("time_stamp",), "fiu", "the same", "Nebula"),
    DriverField(Use.TIME_OF_DAY, ("timestamp",), "f", "seconds, micro- or nanoseconds of the stamp's clock", "Hesai, Robosense, Livox"),
    DriverField(Use.RANGE, ("range",), "fiu", "0: no return", "Ouster"),
    DriverField(Use.TAG, ("tag",), "iu", "bit 0x20: third echo or noise, left out", "Livox"),
)


def fields_for(use: Use) -> tuple[DriverField, ...]:
    """Those that are read for something, the first that a cloud has counts."""
    return tuple(field for field in FIELDS if field.use is use)


def field_table() -> str:
    """The table as Markdown."""
    kinds = {"f": "float32, float64", "iu": "whole number", "fiu": "any number"}
    head = ["| read for | field | type | meaning | written by |", "|---|---|---|---|---|"]
    rows = [f"| {f.use.value} | `{' '.join(f.names)}` | {kinds[f.kinds]} | {f.meaning} | {f.drivers} |" for f in FIELDS]
    return "\n".join([*head, *rows]) + "\n"
