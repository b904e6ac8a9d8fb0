"""Faults of a simulated sensor, for tests: its messages do not come, no value in them is a number, or they are stamped too early."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from pybullet_simulation.records import Sample

SILENT, NAN, LATE = KINDS = ("silent", "nan", "late")
LATE_S = 3.0  # by which a stamp is too old: longer than whatever waits for a message of the same time
_KEPT = ("stamp_s", "names", "rings", "times_s")


@dataclass(frozen=True)
class SensorFault:
    """Of the messages of a sensor that come from `begin_s` until `end_s`, in seconds since the simulator's start."""

    kind: str
    topic: str
    begin_s: float
    end_s: float


def read_fault(text: str, topics: tuple[str, ...]) -> SensorFault:
    """From KIND TOPIC FROM TO. ValueError names what is wrong."""
    try:
        kind, topic, begin, end = text.split()
        found = SensorFault(kind, topic, float(begin), float(end))
    except ValueError:
        raise ValueError(f"faults = {text.strip()!r}: expected KIND TOPIC FROM TO, such as silent /scan 20 25") from None
    if kind not in KINDS:
        raise ValueError(f"faults = {text.strip()!r}: no such kind; there are {', '.join(KINDS)}")
    if topic not in topics:
        raise ValueError(f"faults = {text.strip()!r}: no sensor of that topic; there are {', '.join(topics)}")
    if not found.begin_s < found.end_s:
        raise ValueError(f"faults = {text.strip()!r}: does not end after it begins")
    return found


def faulty(sample: Sample, kind: str) -> Sample:
    """The sample as a sensor with that fault gives it; as it is where `kind` is empty."""
    if kind == LATE:
        return replace(sample, stamp_s=sample.stamp_s - LATE_S)
    if kind == NAN:
        unknown: dict[str, Any] = {f.name: _no_number(getattr(sample, f.name)) for f in fields(sample) if f.name not in _KEPT}
        return replace(sample, **unknown)
    return sample


def _no_number(value: object) -> object:
    if isinstance(value, np.ndarray):
        return np.full_like(value, np.nan)
    return (np.nan,) * len(value) if isinstance(value, tuple) else np.nan
