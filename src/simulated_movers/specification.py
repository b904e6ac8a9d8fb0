"""What a world's file says of a mover: one frozen dataclass, checked by sentences."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import yaml

from stage_config import ConfigError, check_ranges, load_config, parameter, yaml_values

KINDS = ("person", "cart", "robot", "door")
WALKS = ("random", "path", "steps_in")
Place = tuple[float, ...]


@dataclass(frozen=True)
class MoverSpec:
    """A mover: what it is and where it goes; places are x, y in m in the world's coordinates."""

    kind: str = parameter("person", "", "what it is", choices=KINDS)
    name: str = parameter("", "", "what contacts.csv and movers.csv call it; empty: kind and number")
    walk: str = parameter(
        "random",
        "",
        "random: from place to place; path: along `path` and back; steps_in: a mean one, who steps into the robot's way",
        choices=WALKS,
    )
    start: Place = parameter((), "m", "x, y where it starts, of a door its hinge; empty: the first of `path`, or drawn from the seed")
    path: Place = parameter((), "m", "x, y, x, y ... of the places that it goes to in turn, and back")
    speed_mps: float = parameter(1.0, "m/s", "how fast it goes; of a door, its free edge", low=0.05, high=3.0)
    pause_s: float = parameter(
        1.0, "s", "how long it stands where it has come; a mean one in the way, a door open and shut", low=0.0, high=600.0
    )
    closed_rad: float = parameter(0.0, "rad", "where a door that is shut points to, seen from its hinge", low=-math.tau, high=math.tau)
    swing_rad: float = parameter(math.pi / 2, "rad", "how far a door opens", low=-math.pi, high=math.pi)
    width_m: float = parameter(0.9, "m", "width of a door", low=0.3, high=3.0)

    def validate(self) -> list[str]:
        """All that is wrong with it, each as a sentence."""
        found = check_ranges(self)
        if len(self.start) not in (0, 2) or not _are_numbers(self.start):
            found.append(f"start is {list(self.start)}, expected x and y")
        if len(self.path) % 2 or not _are_numbers(self.path):
            found.append(f"path is {list(self.path)}, expected x, y, x, y ...")
        if (self.walk == "path") != bool(self.path):
            found.append("walk: path and a path go together")
        elif self.walk == "path" and len(self.path) == 2:
            found.append(f"path has one place, [{list(self.path)}], expected two or more, as [[x, y], [x, y]]")
        elif self.walk == "path" and len(set(self.places)) < 2:
            found.append(f"path has {len(self.places)} places, all at {list(self.path[:2])}, expected two that differ")
        if self.kind == "door" and (self.walk != "random" or len(self.start) != 2):
            found.append("a door needs start, the x, y of its hinge, and has no walk")
        return found

    @property
    def places(self) -> list[Place]:
        """The (x, y) of its path."""
        return [self.path[i : i + 2] for i in range(0, len(self.path), 2)]

    def relative_to(self, origin: Sequence[float]) -> "MoverSpec":
        """The same mover, seen from an origin (x, y, ...) of the world."""
        start = tuple(v - origin[i % 2] for i, v in enumerate(self.start))
        return replace(self, start=start, path=tuple(v - origin[i % 2] for i, v in enumerate(self.path)))


def _are_numbers(values: Sequence[object]) -> bool:
    return all(isinstance(v, float) and math.isfinite(v) for v in values)


def specs_of(entries: object) -> tuple[MoverSpec, ...]:
    """The movers of a list of mappings, as a world's YAML has them below `movers`. ValueError in one line for the first wrong one."""
    if not isinstance(entries, list):
        raise ValueError(f"movers is {type(entries).__name__}, expected a list")
    specs = tuple(_spec(number, entry) for number, entry in enumerate(entries, 1))
    first: dict[str, int] = {}
    for number, spec in enumerate(specs, 1):
        if first.setdefault(spec.name, number) != number:
            raise ValueError(f"mover {number}: its name, {spec.name}, is that of mover {first[spec.name]}, too")
    return specs


def _spec(number: int, entry: object) -> MoverSpec:
    if not isinstance(entry, Mapping):
        raise ValueError(f"mover {number} is {entry!r}, expected fields such as kind: person")
    values = {str(key): value for key, value in entry.items()}
    path = values.get("path")
    if isinstance(path, list) and all(isinstance(place, list) for place in path):
        values["path"] = [v for place in path for v in place]
    try:
        spec = load_config(MoverSpec, values)
    except ConfigError as error:
        raise ValueError(f"mover {number}: {'; '.join(str(error).replace('MoverSpec: ', '').splitlines())}") from error
    return spec if spec.name else replace(spec, name=f"{spec.kind}_{number}")


def read_movers(path: Path) -> tuple[MoverSpec, ...]:
    """The movers of a YAML file, a list or one below `movers`. ValueError in one line with the file when it cannot be used."""
    try:
        found = yaml_values(path.read_text())
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: no YAML: {' '.join(str(error).split())}") from error
    try:
        return specs_of(found.get("movers") if isinstance(found, dict) else found)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
