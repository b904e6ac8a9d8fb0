"""Clouds laid out as drivers lay them out, for any order of bytes and any padding of rows."""

from dataclasses import dataclass
from typing import Any

import numpy as np

CODES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
STAMP_S = 1_700_000_000.25

LAYOUTS: dict[str, tuple[int, tuple[tuple[str, str, int], ...]]] = {
    "velodyne": (22, (("x", "f4", 0), ("y", "f4", 4), ("z", "f4", 8), ("intensity", "f4", 12), ("ring", "u2", 16), ("time", "f4", 18))),
    "ouster": (
        48,
        (
            *(("x", "f4", 0), ("y", "f4", 4), ("z", "f4", 8), ("intensity", "f4", 16), ("t", "u4", 20)),
            *(("reflectivity", "u2", 24), ("ring", "u2", 26), ("ambient", "u2", 28), ("range", "u4", 32)),
        ),
    ),
    "livox": (
        26,
        (
            *(("x", "f4", 0), ("y", "f4", 4), ("z", "f4", 8), ("intensity", "f4", 12)),
            *(("tag", "u1", 16), ("line", "u1", 17), ("timestamp", "f8", 18)),
        ),
    ),
    "livox offset": (
        19,
        (
            ("offset_time", "u4", 0),
            ("x", "f4", 4),
            ("y", "f4", 8),
            ("z", "f4", 12),
            ("reflectivity", "u1", 16),
            ("tag", "u1", 17),
            ("line", "u1", 18),
        ),
    ),
    "hesai": (26, (("x", "f4", 0), ("y", "f4", 4), ("z", "f4", 8), ("intensity", "f4", 12), ("timestamp", "f8", 16), ("ring", "u2", 24))),
    "doubles": (28, (("z", "f8", 0), ("x", "f8", 8), ("ring", "u1", 16), ("y", "f8", 20))),
}


@dataclass
class Field:
    """A PointField."""

    name: str
    offset: int
    datatype: int
    count: int = 1


@dataclass
class Cloud:
    """A PointCloud2 without its header."""

    fields: list[Field]
    height: int
    width: int
    point_step: int
    row_step: int
    data: bytes
    is_bigendian: bool = False


def cloud(driver: str, values: dict[str, Any], *, rows: int = 1, big: bool = False, padding: int = 0) -> Cloud:
    """A cloud of a driver's layout with (N,) values by field."""
    step, layout = LAYOUTS[driver]
    order = ">" if big else "<"
    record = np.dtype(
        {
            "names": [name for name, _, _ in layout],
            "formats": [order + kind for _, kind, _ in layout],
            "offsets": [offset for _, _, offset in layout],
            "itemsize": step,
        }
    )
    table = np.zeros(len(values["x"]), record)
    for name, column in values.items():
        table[name] = column
    width = len(table) // rows
    lines = np.frombuffer(table.tobytes(), np.uint8).reshape(rows, width * step)
    data = np.pad(lines, ((0, 0), (0, padding)), constant_values=0xEE).tobytes()
    fields = [Field(name, offset, CODES[kind]) for name, kind, offset in layout]
    return Cloud(fields, rows, width, step, width * step + padding, data, big)


def ramp(count: int) -> dict[str, Any]:
    """x y z of points that differ in every number."""
    n = np.arange(count)
    return {"x": 1.0 + n, "y": -0.5 * n, "z": 0.25 * n - 1.0}


def xyz(values: dict[str, Any]) -> np.ndarray:
    return np.stack([values[name] for name in "xyz"], axis=1)
