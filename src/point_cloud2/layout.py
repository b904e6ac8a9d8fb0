"""Where the bytes of a cloud's fields are: any order and type of fields, either byte order, rows with or without padding."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

KINDS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""numpy's names of sensor_msgs/PointField's datatypes."""


class CloudField(Protocol):
    """A PointField."""

    name: str
    offset: int
    datatype: int


class CloudMessage(Protocol):
    """A PointCloud2, of whichever library."""

    fields: Sequence[CloudField]
    width: int
    height: int
    point_step: int
    row_step: int
    is_bigendian: bool
    data: bytes


def columns(message: CloudMessage, names: Sequence[str]) -> NDArray[np.void]:
    """(N,) records with the fields `names`, a row of the cloud after the other; ValueError when the message does not hold them."""
    fields = [_field(message, name) for name in names]
    kinds = [KINDS[field.datatype] for field in fields]
    ends = [field.offset + int(kind[1:]) for field, kind in zip(fields, kinds, strict=True)]
    if message.point_step < max(ends, default=1):
        raise ValueError(f"cloud with points of {message.point_step} bytes, whose field {names[int(np.argmax(ends))]} ends at {max(ends)}")
    order = ">" if message.is_bigendian else "<"
    record = np.dtype(
        {
            "names": list(names),
            "formats": [order + kind for kind in kinds],
            "offsets": [field.offset for field in fields],
            "itemsize": message.point_step,
        }
    )
    return _bytes(message).view(record)


def _field(message: CloudMessage, name: str) -> CloudField:
    found = [field for field in message.fields if field.name == name]
    if len(found) != 1:
        raise ValueError(f"cloud with {len(found)} fields {name}; it has {', '.join(f.name for f in message.fields) or 'none'}")
    if found[0].datatype not in KINDS:
        raise ValueError(f"cloud whose field {name} is of datatype {found[0].datatype}, which PointField does not know")
    return found[0]


def _bytes(message: CloudMessage) -> NDArray[np.uint8]:
    """The bytes of all points without padding.

    Drivers write the row's length, the whole cloud's or 0 into row_step. Data of just the points' size have no padding, whatever it says.
    """
    data = np.frombuffer(message.data, np.uint8)
    row, rows = message.width * message.point_step, message.height
    if len(data) < row * rows:
        raise ValueError(
            f"cloud of {rows} x {message.width} points of {message.point_step} bytes, row_step {message.row_step}, "
            f"cannot be read of {len(data)} bytes"
        )
    padded = len(data) > row * rows and message.row_step > row and len(data) >= message.row_step * (rows - 1) + row
    if not padded:
        return data[: row * rows]
    starts = message.row_step * np.arange(rows)
    return np.concatenate([data[start : start + row] for start in starts])
