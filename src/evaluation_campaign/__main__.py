"""./evaluate: from arguments to a report and an exit code."""

import argparse
import math
import os
import platform
import signal
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

from evaluation_campaign.plan import BY_PROFILE, Campaign, CampaignProblem, Limits, RunSpec, open_campaign, parse_seeds
from explore_command.arguments import MAPPINGS, NAMED_WORLDS, REALISMS, SENSORS, ArgumentProblem, check_movers
from explore_command.launching import sensor_and_mapping
from explore_command.parameters import override_problems, read_profile, robot_of
from robot_body import robot_file
from stage_config import ConfigError

PROJECT = Path(__file__).resolve().parents[2]
_REPORTED_PACKAGES = ("numpy", "scipy", "numba", "gtsam", "open3d", "small_gicp", "pybullet", "distributed")
_MOVERS_OF_A_SOAK = 3  # in every third seed (issue 42)


def parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(
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
        "--profile", default="ours", metavar="P,P", help="profiles of parameters: ours, nearest, thesis, or YAML FILEs; default ours"
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
        default=0,
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
    p.add_argument("--report-only", action="store_true", help="write the report of the runs that are there")
    return p


def parse(arguments: list[str] | None = None) -> tuple[Campaign, argparse.Namespace]:
    """The campaign that is asked for, and the options. CampaignProblem for what cannot be run, SystemExit(2) for wrong usage."""
    a = parser().parse_args(arguments)
    if a.jobs < 1 or a.max_sim_time <= 0 or a.max_wall_time <= 0 or a.soak < 0:
        raise CampaignProblem("--jobs, --max-sim-time, --max-wall-time and --soak must be positive")
    worlds, profiles = (tuple(dict.fromkeys(part.strip() for part in text.split(","))) for text in (a.worlds, a.profile))
    for world in worlds:
        _check_world(world)
    for profile in profiles:
        _check_profile(profile, a.robot)
    worlds = tuple(dict.fromkeys(w if w in NAMED_WORLDS else str(Path(w).absolute()) for w in worlds))
    _check_names("--profile", profiles)
    _check_names("--worlds", worlds)
    try:
        check_movers(a.movers)
    except ArgumentProblem as error:
        raise CampaignProblem(str(error)) from error
    movers = a.movers if a.movers.isdecimal() or not a.movers else str(Path(a.movers).absolute())
    limits, robot = Limits(a.max_sim_time, a.max_wall_time), str(a.robot.absolute()) if a.robot else ""
    try:
        sensor, _ = sensor_and_mapping(robot_of(a.robot, {}), a.sensor, a.mapping)
    except ArgumentProblem as error:
        raise CampaignProblem(str(error)) from error
    mapping, seeds = a.mapping or BY_PROFILE, parse_seeds(a.seeds)
    if a.soak:
        seeds = tuple(range(seeds[0], seeds[0] + math.ceil(a.soak / (len(worlds) * len(profiles)))))
    movers_every = _MOVERS_OF_A_SOAK if a.soak else 1
    out = a.out.absolute()
    return Campaign(out, worlds, seeds, profiles, sensor, limits, robot, a.realism, mapping, movers, movers_every, a.chaos), a


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


def about(jobs: int) -> dict[str, object]:
    """What campaign.json says of code and machine."""
    described = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=PROJECT, capture_output=True, text=True, check=False)
    machine = {
        "cpu": _processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "packages": {name: version(name) for name in _REPORTED_PACKAGES},
    }
    return {"version": described.stdout.strip() or "unknown", "jobs": jobs, "machine": machine}


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or "unknown"
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown")


class _Progress:
    """A line for every run that has ended, with what is left to do."""

    def __init__(self, campaign: Campaign) -> None:
        self._total, self._left = len(campaign.specs), len(campaign.left())
        self._asked, self._begun = self._left, time.monotonic()

    def __call__(self, spec: RunSpec, outcome: dict[str, object]) -> None:
        self._left -= 1
        made = self._asked - self._left
        left_s = (time.monotonic() - self._begun) / made * self._left
        told = outcome["error"] or "finished"
        wall = "" if outcome["wall_s"] is None else f", {outcome['wall_s']:.0f} s"
        rest = f"; about {left_s / 60:.0f} min left" if self._left else ""
        print(f"[{self._total - self._left:3d}/{self._total}] {spec.world} {spec.seed} ({spec.profile}): {told}{wall}{rest}", flush=True)


def run_campaign(campaign: Campaign, options: argparse.Namespace) -> None:
    """Makes the runs that are left. CampaignProblem when the scheduler is not there, OSError when the disk is full."""
    from evaluation_campaign.cluster import cluster_client, run_all  # Dask takes a second to load, and --help needs none

    left = len(campaign.left())
    print(f"{len(campaign.specs)} runs, {left} of them to be made, {options.jobs} at a time; results in {campaign.out}", flush=True)
    if left:
        with cluster_client(options.scheduler, min(options.jobs, left)) as client:
            run_all(campaign, client, PROJECT, _Progress(campaign))


def _interrupt(_number: int, _frame: object) -> None:
    raise KeyboardInterrupt


def main(arguments: list[str] | None = None) -> int:
    try:
        campaign, options = parse(arguments)
        open_campaign(campaign, about(options.jobs))
        if not options.report_only:
            run_campaign(campaign, options)
    except CampaignProblem as error:
        for line in str(error).splitlines():
            print(f"./evaluate: {line}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"./evaluate: stopped: {error}; finished runs stay, the same command goes on", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\n./evaluate: interrupted; finished runs stay, the same command goes on", file=sys.stderr)
        return 130
    code = _report(campaign)
    if options.soak:
        from evaluation_report import write_soak

        print(write_soak(campaign.out), end="")
    return code


def _report(campaign: Campaign) -> int:
    from evaluation_report import write_report

    for path in write_report(campaign.out):
        print(f"wrote {path}")
    missing = [spec for spec in campaign.specs if not campaign.is_done(spec)]
    crashed = [spec for spec in campaign.specs if campaign.is_done(spec) and campaign.outcome(spec)["status"] == "crashed"]
    for text, specs in (("missing", missing), ("crashed", crashed)):
        if specs:
            print(f"{text}: {', '.join(f'{s.world} {s.seed} ({s.profile})' for s in specs)}")
    return 1 if missing or crashed else 0


if __name__ == "__main__":
    for signal_number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(signal_number, _interrupt)  # also where a shell's background ignores the first
    sys.exit(main())
