"""Where the robot's sensors sit: by the name of their frame, from the URDF or as the robot's file says."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

_KEYS = ("frame", "parent", "xyz", "rpy", "from")
Triple = tuple[float, float, float]


@dataclass(frozen=True)
class SensorMount:
    """A sensor's frame; its pose in `parent`, or None where the URDF says it."""

    sensor: str
    frame: str
    parent: str = ""
    xyz_m: Triple | None = None
    rpy_rad: Triple | None = None

    def as_mapping(self) -> dict[str, object]:
        """The mount as robot.yaml writes it."""
        if self.xyz_m is None or self.rpy_rad is None:
            return {"frame": self.frame, "from": "urdf"}
        return {"frame": self.frame, "parent": self.parent, "xyz": list(self.xyz_m), "rpy": list(self.rpy_rad)}


def read_mounts(values: object) -> tuple[tuple[SensorMount, ...], list[str]]:
    """The mounts of robot.yaml, sensor to frame and pose, in the order of their names; and what is wrong with them, a sentence each."""
    if not isinstance(values, Mapping):
        return (), [f"mounts = {values!r} is no mapping of sensors to frames"]
    problems = [f"mounts/{name}: {text}" for name, mount in values.items() for text in _problems(mount)]
    return tuple(_mount(str(name), mount) for name, mount in sorted(values.items(), key=str) if not _problems(mount)), problems


def _problems(mount: object) -> list[str]:
    if not isinstance(mount, Mapping):
        return [f"{mount!r} is no mapping; expected 'frame' with 'from: urdf', or with parent, xyz and rpy"]
    found = [f"unknown {key}; known: {', '.join(_KEYS)}" for key in mount if key not in _KEYS]
    if not _frame(mount, "frame"):
        found.append("has no frame")
    if "from" in mount:
        return found + _problems_of_source(mount)
    if not _frame(mount, "parent"):
        found.append("has no parent, nor 'from: urdf'")
    return found + [f"{key} = {mount.get(key)!r} is not three finite numbers" for key in ("xyz", "rpy") if _triple(mount.get(key)) is None]


def _problems_of_source(mount: Mapping[str, object]) -> list[str]:
    found = [] if mount["from"] == "urdf" else [f"from = {mount['from']!r} is none of urdf"]
    return found + [f"{key} contradicts 'from: {mount['from']}'" for key in ("parent", "xyz", "rpy") if key in mount]


def _triple(value: object) -> Triple | None:
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        return None
    if not all(isinstance(v, (int, float)) and not isinstance(v, bool) and math.isfinite(v) for v in value):
        return None
    return float(value[0]), float(value[1]), float(value[2])


def _frame(mount: Mapping[str, object], key: str) -> str:
    """A frame's name as tf knows it, without the slash that old drivers write; empty where it is none."""
    name = mount.get(key)
    return name.lstrip("/") if isinstance(name, str) else ""


def _mount(name: str, mount: Mapping[str, object]) -> SensorMount:
    if "from" in mount:
        return SensorMount(name, _frame(mount, "frame"))
    return SensorMount(name, _frame(mount, "frame"), _frame(mount, "parent"), _triple(mount["xyz"]), _triple(mount["rpy"]))
