"""The arguments of ./calibrate_mount that have the form NAME:=VALUE: those of its launch file, and what is wrong with them."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path

from explore_command.arguments import NAMED_WORLDS, REALISMS, UPS, ArgumentProblem
from whole_files import check_folder, check_not_read

HELP = """usage: ./calibrate_mount [robot_file:=FILE urdf:=FILE] [sweeps:=N] [mount_calibration:=FILE]
       ./calibrate_mount sim:=true [world:=W] [seed:=N] [...]
       ./calibrate_mount --from BAG|FOLDER --out FILE.yaml [...]    more: ./calibrate_mount --from --help

Calibrates the tilting mount at one place, in one minute: the robot stands on level ground and sweeps. If you turn it
on the spot between two sweeps, both headings count. The robot's drivers run, and no exploration does. With sim:=true
robot and world are simulated, under a ROS master of its own. With --from it reads a recording.

arguments:
  robot_file:=FILE         the robot; default config/robot.yaml
  urdf:=FILE               its description; default the one that its drivers have loaded, with sim:=true urdf/husky.urdf
  sweeps:=N                how many sweeps are made, 1 to 100; default 3
  mount_calibration:=FILE  the file to write; default ~/.ros/explore_3dnav/mount_calibration.yaml, of a simulated robot
                           simulated_mount_calibration.yaml beside it
  overrides:=FILE          YAML with parameters by node, loaded last
  sim:=true                simulate robot and world

with sim:=true:
  world:=W                 rooms, doors, ramp, moon, or a FILE as in ./explore; default rooms
  seed:=N                  sets start, noise, slip and clutter; default 1
  rate:=R                  at most R times real time, 0: as fast as the machine can; default 1
  realism:= movers:= start:= scale:= up:= size:= area:= models:= ground:=    as the options of ./explore

Example: ./calibrate_mount sim:=true world:=rooms mount_calibration:=/tmp/mount.yaml.
Exit code: 0 saved, 1 nothing was observable, 2 a wrong argument or an input that does not come, 130 interrupted."""

_OF_BOTH = ("robot_file", "urdf", "sweeps", "mount_calibration", "overrides", "sim")
_OF_SIMULATION = ("world", "seed", "rate", "realism", "movers", "start", "scale", "up", "size", "area", "models", "ground")
_READ = ("robot_file", "urdf", "overrides")
_TRUTHS = {"true": "true", "1": "true", "false": "false", "0": "false"}


def live_arguments(words: Sequence[str]) -> dict[str, str]:
    """The launch file's arguments by name, files with their full paths. ArgumentProblem for a wrong name or value."""
    found = dict(_named(word) for word in words)
    sim = found["sim"] = _TRUTHS.get(found.get("sim", "false").lower(), "")
    if not sim:
        raise ArgumentProblem("sim:= is true or false")
    if sim == "false" and (simulated := [name for name in found if name in _OF_SIMULATION]):
        raise ArgumentProblem(f"{simulated[0]}:= is of a simulated world: add sim:=true")
    _check_numbers(found)
    _check_choices(found)
    return _with_files(found)


def _named(word: str) -> tuple[str, str]:
    name, sign, value = word.partition(":=")
    if not sign or name not in (*_OF_BOTH, *_OF_SIMULATION):
        known = f"{', '.join(_OF_BOTH)}; with sim:=true {', '.join(_OF_SIMULATION)}"
        raise ArgumentProblem(f"{word}: expected NAME:=VALUE, with a NAME of {known}; or --from BAG")
    return name, value


def _check_numbers(found: dict[str, str]) -> None:
    if "sweeps" in found:
        from mount_calibration import asked_sweeps  # loads numpy: not for who only asks for help

        asked_sweeps(found["sweeps"])
    if not found.get("seed", "1").isdecimal():
        raise ArgumentProblem(f"seed:={found['seed']}: expected a whole number from 0 on")
    if not 0.0 <= _number(found.get("rate", "1")) < math.inf:
        raise ArgumentProblem(f"rate:={found['rate']}: expected a number from 0 on, times real time")


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _check_choices(found: dict[str, str]) -> None:
    for name, choices in (("realism", REALISMS), ("up", ("", *UPS))):
        if found.get(name, choices[0]) not in choices:
            raise ArgumentProblem(f"{name}:={found[name]}: expected one of {', '.join(filter(None, choices))}")
    world = found.get("world", NAMED_WORLDS[0])
    if world not in NAMED_WORLDS and not Path(world).is_file():
        raise ArgumentProblem(f"world:={world}: no such world or file; worlds are {', '.join(NAMED_WORLDS)}, or a FILE as in ./explore")


def _with_files(found: dict[str, str]) -> dict[str, str]:
    """Nodes do not run where they were asked for: paths are full ones. What is empty is as the launch file has it."""
    found = {name: value for name, value in found.items() if value}
    for name in _READ:
        if name in found and not Path(found[name]).expanduser().is_file():
            raise ArgumentProblem(f"{name}:={found[name]}: no such file")
    for name in (*_READ, "mount_calibration", "world", "movers"):
        path = Path(found.get(name, "")).expanduser()
        if name == "mount_calibration" or (name in found and path.is_file()):
            found |= {name: str(path.absolute())} if name in found else {}
    if "models" in found:
        found["models"] = os.pathsep.join(str(Path(part).expanduser().absolute()) for part in found["models"].split(os.pathsep) if part)
    _check_written(found)
    return found


def _check_written(found: dict[str, str]) -> None:
    """ValueError where the file that is to be written is a folder, or one that is read, or cannot be written there."""
    text = found.get("mount_calibration", "")
    if not text:
        return
    read = [Path(found[name]) for name in (*_READ, "world", "movers") if name in found]
    check_folder("mount_calibration:=", Path(text).parent)
    check_not_read("mount_calibration:=", Path(text), filter(Path.is_file, read))
