"""What a world is made of, and the YAML file that says it: its file, where the robot starts, how much of it is explored.

world: hall.sdf          # or rooms, doors, ramp, moon, a mesh, a height map
start: [1, 2, 1.57]      # x y yaw, or x y z yaw
area: [20, 15]
models: [models]         # folders, relative to this file
ground: 0.0              # a floor at this height, where the file has none
"""

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path

import yaml

from stage_config import nearest, yaml_values

DESCRIPTION_SUFFIXES = (".yaml", ".yml")


@dataclass(frozen=True)
class WorldDescription:
    """A world by name or file, in metres; None or empty where nothing was said.

    `start`: x y yaw or x y z yaw. `area`: x y, of which so much around the start is explored. `size`: x y z of a height map. `scale`:
    metres a unit of a mesh. `up`: its upward axis. `models`: folders with the models of an SDF file. `ground`: height of a floor that is
    added. `movers`: what moves, as it stands in the file.
    """

    world: str
    start: tuple[float, ...] | None = None
    area: tuple[float, float] | None = None
    size: tuple[float, float, float] | None = None
    scale: float | None = None
    up: str | None = None
    models: tuple[Path, ...] = ()
    ground: float | None = None
    movers: object = None


def described(given: WorldDescription) -> WorldDescription:
    """A description whose world is no YAML file any more: what that says, and over it what is given. ValueError as of reading it."""
    if Path(given.world).suffix.lower() not in DESCRIPTION_SUFFIXES:
        return given
    told = {field.name: getattr(given, field.name) for field in dataclasses.fields(given) if field.name != "world"}
    return dataclasses.replace(
        read_description(Path(given.world)), **{name: value for name, value in told.items() if value not in (None, ())}
    )


def read_description(path: Path) -> WorldDescription:
    """The description in a YAML file; ValueError in one line, with file and key, for anything in it that is wrong."""
    try:
        values = yaml_values(path.read_bytes())
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ValueError(f"{path}: cannot be read as YAML: {' '.join(str(error).split())}") from error
    if not isinstance(values, dict) or not isinstance(values.get("world"), str):
        raise ValueError(f"{path}: expected keys and values, of which world: FILE is one")
    if Path(values["world"]).suffix.lower() in DESCRIPTION_SUFFIXES:
        raise ValueError(f"{path}: world: {values['world']} is a description, too")
    if not isinstance(values.get("up", ""), str):
        raise ValueError(f"{path}: up: {values['up']!r} is no axis")
    known = [field.name for field in dataclasses.fields(WorldDescription)]
    if unknown := [str(key) for key in values if key not in known]:
        raise ValueError(f"{path}: {'; '.join(f'unknown key {key}{nearest(key, known)}' for key in unknown)}")
    return WorldDescription(
        world=_world(values["world"], path.parent),
        start=_floats(path, values, "start", (3, 4)),
        area=_floats(path, values, "area", (2,)),  # type: ignore[arg-type]
        size=_floats(path, values, "size", (3,)),  # type: ignore[arg-type]
        scale=_float(path, values, "scale"),
        up=values.get("up"),
        models=_models(path, values.get("models")),
        ground=_float(path, values, "ground"),
        movers=values.get("movers"),
    )


def _world(text: str, folder: Path) -> str:
    """A file relative to the folder; the name of a built-in world, which has no suffix, as it is."""
    return str(folder / text) if Path(text).suffix else text


def _floats(path: Path, values: dict[str, object], key: str, lengths: tuple[int, ...]) -> tuple[float, ...] | None:
    value = values.get(key)
    if value is None:
        return None
    counts = " or ".join(map(str, lengths))
    if not isinstance(value, list) or len(value) not in lengths or not all(_is_number(v) for v in value):
        raise ValueError(f"{path}: {key}: {value!r} is no list of {counts} finite numbers")
    return tuple(map(float, value))


def _float(path: Path, values: dict[str, object], key: str) -> float | None:
    value = values.get(key)
    if value is not None and not _is_number(value):
        raise ValueError(f"{path}: {key}: {value!r} is no finite number")
    return None if value is None else float(value)  # type: ignore[arg-type]


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _models(path: Path, value: object) -> tuple[Path, ...]:
    folders = [] if value is None else [value] if isinstance(value, str) else value
    if not isinstance(folders, list) or not all(isinstance(folder, str) for folder in folders):
        raise ValueError(f"{path}: models: {value!r} is no list of folders")
    return tuple(path.parent / folder for folder in folders)
