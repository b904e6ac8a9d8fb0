"""Points and beams of a cloud, whichever driver wrote it: what is a hit, what no return, when and by which laser it was measured."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from point_cloud2.driver_fields import DriverField, Use, fields_for
from point_cloud2.layout import KINDS, CloudMessage, columns

Floats = NDArray[np.floating]

CLOCK_TOLERANCE_S = 1.0  # beams are measured this near to their cloud's stamp, or another clock gave their times
NOISE_BIT = 0x20
_NANOSECONDS = 1e-9


@dataclass(frozen=True, eq=False)
class PointTable:
    """The hits of a cloud, in metres in its frame: (N, 3) points, starts of their beams, and normals; None for what is not told."""

    points: Floats
    origins: Floats | None
    normals: Floats | None


@dataclass(frozen=True, eq=False)
class BeamCloud:
    """The beams of a lidar: (N, 3) points, a row of NaN for no return; (N,) rings and (N,) seconds after the stamp, None when not told."""

    points: Floats
    rings: NDArray[np.integer] | None
    times_s: NDArray[np.float64] | None


def read_points(message: CloudMessage) -> PointTable:
    """The hits alone, maybe none of them; ValueError when the message cannot be read, or has no x y z."""
    points = _vectors(message, _needed(message, Use.POINT))
    origins, normals = (_vectors(message, field) if field else None for field in (_first(message, u) for u in (Use.BEAM_START, Use.NORMAL)))
    kept = _is_return(message, points) & ~_is_noise(message)
    if origins is not None:
        kept &= np.isfinite(origins).all(axis=1)
    if kept.all():
        return PointTable(points, origins, normals)
    return PointTable(points[kept], None if origins is None else origins[kept], None if normals is None else normals[kept])


def read_beams(message: CloudMessage, stamp_s: float) -> BeamCloud:
    """The beams, less those that are noise or of no known time; `stamp_s` is the message's.

    ValueError as for `read_points`, and for times of another clock.
    """
    points = _vectors(message, _needed(message, Use.POINT))
    points[~_is_return(message, points)] = np.nan
    rings, times_s = _rings(message), _times_s(message, stamp_s)
    kept = ~_is_noise(message) if times_s is None else ~_is_noise(message) & np.isfinite(times_s)
    if kept.all():
        return BeamCloud(points, rings, times_s)
    return BeamCloud(points[kept], None if rings is None else rings[kept], None if times_s is None else times_s[kept])


def _first(message: CloudMessage, use: Use) -> DriverField | None:
    """The first field for a use that the message has in a type that can be read."""
    kinds = {field.name: KINDS.get(field.datatype, "-")[0] for field in message.fields}
    for field in fields_for(use):
        if all(kinds.get(name, "-") in field.kinds for name in field.names):
            return field
    return None


def _needed(message: CloudMessage, use: Use) -> DriverField:
    field, there = _first(message, use), ", ".join(f"{f.name} ({KINDS.get(f.datatype, f.datatype)})" for f in message.fields)
    if field is None:
        raise ValueError(f"cloud without float fields {', '.join(fields_for(use)[0].names)}; it has {there or 'none'}")
    return field


def _vectors(message: CloudMessage, field: DriverField) -> Floats:
    """(N, 3) float32, or float64 where the message has it."""
    table = columns(message, field.names)
    kind = np.result_type(*(table.dtype[name].newbyteorder("=") for name in field.names))
    vectors: Floats = np.stack([table[name] for name in field.names], axis=1).astype(kind, copy=False)
    return vectors


def _is_return(message: CloudMessage, points: Floats) -> NDArray[np.bool_]:
    """(N,) whether the beam met something: drivers write NaN, or zeros, where it did not."""
    with np.errstate(invalid="ignore"):  # of bits that are no number
        found = np.isfinite(points).all(axis=1) & points.any(axis=1)
    if field := _first(message, Use.RANGE):
        found &= columns(message, field.names)[field.names[0]] != 0
    return np.asarray(found)


def _is_noise(message: CloudMessage) -> NDArray[np.bool_]:
    field = _first(message, Use.TAG)
    if field is None:
        return np.zeros(message.width * message.height, np.bool_)
    return np.asarray(columns(message, field.names)[field.names[0]] & NOISE_BIT != 0)


def _rings(message: CloudMessage) -> NDArray[np.integer] | None:
    """As the field says; of a cloud in rows without one, the row."""
    if field := _first(message, Use.RING):
        return np.asarray(columns(message, field.names)[field.names[0]].astype(np.uint16))
    return np.repeat(np.arange(message.height, dtype=np.uint16), message.width) if message.height > 1 else None


def _times_s(message: CloudMessage, stamp_s: float) -> NDArray[np.float64] | None:
    if field := _first(message, Use.TIME):
        values = columns(message, field.names)[field.names[0]]
        return np.asarray(values.astype(np.float64) * (1.0 if values.dtype.kind == "f" else _NANOSECONDS))
    if field := _first(message, Use.TIME_OF_DAY):
        return _after(columns(message, field.names)[field.names[0]].astype(np.float64), stamp_s, field.names[0])
    return None


def _after(times: NDArray[np.float64], stamp_s: float, name: str) -> NDArray[np.float64]:
    """Seconds after the stamp of times of day, whose unit is the one in which they lie at the stamp; NaN where there is none."""
    known = np.isfinite(times) & (times != 0.0)
    if not known.any():
        return np.full(times.shape, np.nan)
    for unit in (1.0, 1e-6, _NANOSECONDS):
        after = np.where(known, times * unit - stamp_s, np.nan)
        if (np.abs(after[known]) < CLOCK_TOLERANCE_S).all():
            return np.asarray(after)
    raise ValueError(
        f"cloud whose field {name} says {times[known][0]:.3f}, which in s, us or ns is not within {CLOCK_TOLERANCE_S:g} s of its stamp "
        f"{stamp_s:.3f} s: set the driver to stamp with one clock"
    )
