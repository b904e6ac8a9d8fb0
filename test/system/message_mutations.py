"""Right messages of every type that a node takes, and wrong ones made of them: a seeded mutation of any ROS message."""

import copy
import math
import random
import struct
from collections.abc import Iterator
from typing import Any

import genpy
import numpy as np

_FLOATS = (math.nan, math.inf, -math.inf, 0.0, -1.0, 1e-300, 1e30, -1e30, 5e9)
_TEXTS = ("", "/", "nowhere", "base_link", "map", "x" * 5000, "\u00e4\u00f6\u2603 \n", "%s {} \\0", "../../etc", "NaN")
_TIMES = (genpy.Time(0, 0), genpy.Time(0, 1), genpy.Time(1, 0), genpy.Time(4294967295, 999999999), genpy.Time(2000000000, 0))
_RANGES = {"int8": (-128, 127), "uint8": (0, 255), "int16": (-32768, 32767), "uint16": (0, 65535)}
_RANGES |= {"int32": (-(2**31), 2**31 - 1), "uint32": (0, 2**32 - 1), "int64": (-(2**63), 2**63 - 1), "uint64": (0, 2**64 - 1)}
_RANGES |= {"byte": _RANGES["int8"], "char": _RANGES["uint8"]}


def fields_of(message: Any) -> Iterator[tuple[Any, str, str]]:
    """(owner, field, type) of every field, also within messages, and within the first few of a list of messages."""
    for name, kind in zip(message.__slots__, message._slot_types, strict=True):
        yield message, name, kind
        value = getattr(message, name)
        for inner in value[:3] if isinstance(value, (list, tuple)) else [value]:
            if isinstance(inner, genpy.Message):
                yield from fields_of(inner)


def mutated(message: Any, rng: random.Random) -> Any:
    """A copy of which one to four fields are wrong; it can still be sent."""
    found = copy.deepcopy(message)
    for _ in range(rng.choice((1, 1, 2, 4))):
        owner, name, kind = rng.choice(list(fields_of(found)))
        setattr(owner, name, _other(getattr(owner, name), kind, rng))
    return found


def of_no_numbers(message: Any) -> Any:
    """A copy in which every floating point number is NaN: no stage can use it."""
    found = copy.deepcopy(message)
    for owner, name, kind in list(fields_of(found)):
        value = getattr(owner, name)
        if kind in ("float32", "float64"):
            setattr(owner, name, math.nan)
        elif kind.startswith(("float32[", "float64[")):
            setattr(owner, name, [math.nan] * len(value))
        elif kind == "uint8[]" and hasattr(owner, "point_step"):
            owner.data = np.full(len(value) // 4, np.nan, np.float32).tobytes()
    return found


def _other(value: Any, kind: str, rng: random.Random) -> Any:
    element, _, size = kind.partition("[")
    if size:
        return _other_list(value, element, size.rstrip("]"), rng)
    if kind in ("float32", "float64"):
        return rng.choice(_FLOATS)
    if kind == "string":
        return rng.choice(_TEXTS)
    if kind == "bool":
        return not value
    if kind == "time":
        return rng.choice((*_TIMES, genpy.Time.from_sec(max(value.to_sec() + rng.choice((-3.0, -0.01, 5.0)), 0.0))))
    if kind == "duration":
        return rng.choice((genpy.Duration(-1), genpy.Duration(2**31 - 1)))
    if kind in _RANGES:
        low, high = _RANGES[kind]
        return rng.choice((low, high, 0, 1, min(max(int(value) + rng.choice((-1, 1)), low), high)))
    return value  # a message: its own fields are mutated


def _other_list(value: Any, element: str, size: str, rng: random.Random) -> Any:
    values = bytearray(value) if isinstance(value, (bytes, bytearray)) else list(value)
    if not size:
        values = rng.choice((values[:0], values[: len(values) // 2], values[:-1], values * 2, values[::-1], values))
    for _ in range(min(len(values), 3)):
        index = rng.randrange(len(values))
        values[index] = rng.choice((0, 255, 127)) if isinstance(values, bytearray) else _other(values[index], element, rng)
    return bytes(values) if isinstance(values, bytearray) else values


def can_be_sent(message: Any) -> bool:
    """Whether rospy can put the message on the wire."""
    try:
        message.serialize(_Nowhere())
    except (genpy.SerializationError, struct.error, TypeError, ValueError, UnicodeError):
        return False
    return True


class _Nowhere:
    """What a message is serialised into to see whether that works."""

    def write(self, data: bytes) -> None:
        """Forgets it."""

    def tell(self) -> int:
        """Where it would be."""
        return 0

    def getvalue(self) -> bytes:
        """Nothing."""
        return b""
