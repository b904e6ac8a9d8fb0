"""Arguments of ./evaluate: the campaign that is asked for, or that a folder holds, and what is wrong before anything is written."""

import argparse
import math
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from evaluation_campaign.plan import BY_PROFILE, Campaign, CampaignProblem, Limits, full_profiles, parse_seeds, shown, stored_campaign
from explore_command.arguments import MAPPINGS, NAMED_WORLDS, REALISMS, SENSORS, ArgumentProblem, OneLineParser, check_movers
from explore_command.launching import sensor_and_mapping
from explore_command.parameters import override_problems, profile_names, read_profile, robot_of
from robot_body import robot_file
from stage_config import ConfigError

_MOVERS_OF_A_SOAK = 3  # in every third seed (issue 42)
_RANGES = {"jobs": (1, 1000), "soak": (1, 10_000), "chaos": (0, 2**31), "max_sim_time": (1, 1_000_000), "max_wall_time": (1, 1_000_000)}


def parser() -> argparse.ArgumentParser:
    p = OneLineParser(
        prog="./evaluate",
        description="Makes many runs, scores them against the true world, and writes a report. The same command goes on where it ended, "
        "one with more worlds, seeds or profiles adds to it.",
        epilog="Example: ./evaluate --worlds rooms,ramp --seeds 1-5 --profile ours,thesis --out results. "
        "Exit code: 0 all runs were made (the report says how they went), 1 some crashed or are missing, 2 wrong argument, "
        "130 interrupted.",
    )
    p.add_argument(
        "--worlds",
        default="ramp,moon",
        metavar="W,W",
        help="rooms, doors, ramp, moon, or FILEs: mesh, SDF, or .yaml with start and area; default ramp,moon",
    )
    p.add_argument("--seeds", default="1-10", metavar="A-B", help="numbers and ranges, such as 1-10 or 1-5,8; default 1-10")
    p.add_argument(
        "--profile",
        default="ours",
        metavar="P,P",
        help=f"profiles of parameters: {', '.join(profile_names())}, or YAML FILEs; default ours",
    )
    p.add_argument("--robot", type=robot_file, metavar="R", help="the robot of all runs, by name or FILE as in ./explore; default husky")
    p.add_argument("--sensor", choices=SENSORS, help="the sensor of all runs; default tilting, where a lidar is fixed spinning")
    p.add_argument(
        "--realism", choices=REALISMS, default=REALISMS[0], help="hardware or ideal sensors, clocks and drive; default %(default)s"
    )
    p.add_argument(
        "--mapping",
        choices=MAPPINGS,
        help="whether the robot maps while driving or stands for each sweep; default: as its profile says, driving but for thesis",
    )
    p.add_argument("--movers", default="", metavar="N|FILE", help="so many movers in every run, drawn by its seed, or those of a FILE")
    p.add_argument(
        "--chaos",
        type=int,
        metavar="SEED",
        help="in every run kill, stop and starve nodes, and spoil what sensors tell, at moments that SEED draws; default: none of it",
    )
    p.add_argument(
        "--soak",
        type=int,
        metavar="N",
        help="at least N runs, of seeds from the first on, with --movers in every third seed; a table says what failed, and why",
    )
    p.add_argument(
        "--jobs", type=int, default=max(1, (os.cpu_count() or 2) // 2), metavar="N", help="runs at a time; default: half the cores"
    )
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the campaign")
    p.add_argument("--scheduler", metavar="ADDRESS", help="a Dask scheduler whose workers have this project and DIR at the same paths")
    p.add_argument("--max-sim-time", type=float, default=1800.0, metavar="S", help="simulated seconds a run may take; default 1800")
    p.add_argument("--max-wall-time", type=float, default=1800.0, metavar="S", help="seconds of wall time a run may take; default 1800")
    p.add_argument("--report-only", action="store_true", help="write the report of the runs that are there; only --out is needed")
    return p


def parse(arguments: Sequence[str] | None = None) -> tuple[Campaign, argparse.Namespace]:
    """The campaign that is asked for, with --report-only the one that the folder holds, and the options.

    CampaignProblem for what cannot be run, or is not there; SystemExit(0) after --help.
    """
    p = parser()
    try:
        a = p.parse_args(arguments)
        _check_numbers(a)
        if a.report_only:
            given = p.parse_args(arguments, argparse.Namespace(**dict.fromkeys(vars(a))))
            return _held(given), a
        return _asked(a), a
    except ArgumentProblem as error:
        raise CampaignProblem(str(error)) from error


def _check_numbers(a: argparse.Namespace) -> None:
    for name, (least, most) in _RANGES.items():
        value = getattr(a, name)
        if value is not None and not least <= value <= most:
            raise CampaignProblem(f"{_option(name)} {value}: expected {least} to {most}")
    if a.movers.isdecimal() and not int(a.movers):
        raise CampaignProblem(f"--movers {a.movers}: expected 1 or more, or a FILE; by default there are none")


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _asked(a: argparse.Namespace) -> Campaign:
    for world in _parts(a.worlds):
        _check_world(world)
    for profile in _parts(a.profile):
        _check_profile(profile, a.robot)
    worlds, profiles = _worlds(a.worlds), _profiles(a.profile)
    _check_names("--profile", profiles)
    _check_names("--worlds", worlds)
    check_movers(a.movers)
    sensor, _ = sensor_and_mapping(robot_of(a.robot, {}), a.sensor, a.mapping)
    seeds = parse_seeds(a.seeds)
    if a.soak:
        seeds = tuple(range(seeds[0], seeds[0] + math.ceil(a.soak / (len(worlds) * len(profiles)))))
    return Campaign(
        a.out.absolute(),
        worlds,
        seeds,
        profiles,
        sensor,
        Limits(a.max_sim_time, a.max_wall_time),
        _full_path(a.robot),
        a.realism,
        a.mapping or BY_PROFILE,
        _movers(a.movers),
        _MOVERS_OF_A_SOAK if a.soak else 1,
        a.chaos,
    )


def _held(given: argparse.Namespace) -> Campaign:
    """The campaign of a folder, of which nothing that was given (what was not is None) says otherwise."""
    held = stored_campaign(given.out.absolute())
    differing = []
    for name, (read, of_campaign) in _OF_CAMPAIGN.items():
        asked, was = getattr(given, name), of_campaign(held)
        if asked is not None and read(asked) != was and not (name == "seeds" and given.soak):
            differing.append(f"{_option(name)} {shown(was)}, not {shown(read(asked))}")
    if differing:
        raise CampaignProblem(f"--out {held.out}: holds a campaign of {'; '.join(differing)}; --report-only needs none of them")
    return held


def _parts(text: str) -> tuple[str, ...]:
    """The parts of a list, each once."""
    return tuple(dict.fromkeys(part.strip() for part in text.split(",")))


def _worlds(text: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(w if w in NAMED_WORLDS else str(Path(w).absolute()) for w in _parts(text)))


def _profiles(text: str) -> tuple[str, ...]:
    return full_profiles(_parts(text))


def _movers(text: str) -> str:
    return text if text.isdecimal() or not text else str(Path(text).absolute())


def _full_path(path: Path | None) -> str:
    return str(path.absolute()) if path else ""


_OF_CAMPAIGN: dict[str, tuple[Callable[[Any], object], Callable[[Campaign], object]]] = {
    "worlds": (_worlds, lambda c: c.worlds),
    "seeds": (parse_seeds, lambda c: c.seeds),
    "profile": (_profiles, lambda c: c.profiles),
    "robot": (_full_path, lambda c: c.robot),
    "sensor": (str, lambda c: c.sensor),
    "realism": (str, lambda c: c.realism),
    "mapping": (str, lambda c: c.mapping),
    "movers": (_movers, lambda c: c.movers),
    "chaos": (int, lambda c: c.chaos),
    "max_sim_time": (float, lambda c: c.limits.sim_s),
    "max_wall_time": (float, lambda c: c.limits.wall_s),
}
"""What an option says of a campaign: how it is read, and what a campaign has."""


def _check_world(world: str) -> None:
    if world not in NAMED_WORLDS and not Path(world).is_file():
        raise CampaignProblem(
            f"--worlds {world}: no such world or file; worlds are {', '.join(NAMED_WORLDS)}, or a mesh, .sdf, .world or .yaml file"
        )

    if Path(world).suffix.lower() == ".png":
        raise CampaignProblem(f"--worlds {world}: a height map has no size of its own; name it in a .yaml with its size")


def _check_names(option: str, values: tuple[str, ...]) -> None:
    """Whether the runs of each have folders of their own."""
    first: dict[str, str] = {}
    for value in values:
        if (other := first.setdefault(Path(value).stem, value)) != value:
            raise CampaignProblem(f"{option} {other} and {value} have the same name, after which the folders of their runs are called")


def _check_profile(profile: str, robot: Path | None) -> None:
    """Whether a profile, and the robot with what it changes of it, can be used."""
    try:
        overrides = read_profile(profile)
        problems = override_problems(overrides)
    except ValueError as error:
        raise CampaignProblem(f"--profile {profile}: {error}") from error
    if problems:
        raise CampaignProblem(f"--profile {profile}: {'; '.join(problems)}")
    try:
        robot_of(robot, overrides)
    except ConfigError as error:
        raise CampaignProblem("\n".join(f"--robot {line}" for line in str(error).splitlines())) from error
