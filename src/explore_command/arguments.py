"""Arguments of ./explore, and what is wrong with them before anything is started."""

import argparse
import os
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from explore_command.argument_checks import NAMED_WORLDS as NAMED_WORLDS
from explore_command.argument_checks import check_movers as check_movers
from explore_command.argument_checks import check_numbers, check_world, check_zones
from explore_command.results_folder import ArgumentProblem as ArgumentProblem
from explore_command.sessions import NO_RUN, earlier_run

SENSORS = ("tilting", "spinning")
UPS = ("x", "y", "z")
REALISMS = ("hardware", "ideal")
MAPPINGS = ("driving", "stop_and_go")
AT_ENDS = ("stay", "home")
_FOREVER_S = 1e9


class OneLineParser(argparse.ArgumentParser):
    """Raises ArgumentProblem where argparse would print its usage and exit."""

    def error(self, message: str) -> NoReturn:
        raise ArgumentProblem(message)


@dataclass(frozen=True)
class ExploreArguments:
    """What a run was asked to do; lengths in metres, angles in radians.

    `sensor`, `mapping`: None is as robot and profile say. `may_be_elsewhere`: nobody named `out`, and its name may be changed.
    """

    world: str
    sensor: str | None
    realism: str
    mapping: str | None
    movers: str
    seed: int
    start: tuple[float, ...] | None
    scale: float | None
    up: str | None
    models: tuple[Path, ...]
    ground: float | None
    size: tuple[float, float, float] | None
    area: tuple[float, float] | None
    out: Path
    may_be_elsewhere: bool
    resume: bool
    map: Path | None
    goals: bool
    force: bool
    headless: bool
    rate: float
    lockstep: bool
    record: bool
    port: int | None
    max_sim_time_s: float
    at_end: str
    budget_s: float
    budget_m: float
    zones: Path | None
    robot: Path | None
    profile: str
    set_parameters: tuple[str, ...]
    clairvoyant: bool
    check_only: bool


def parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(
        prog="./explore",
        description="Explores a simulated world with a robot and leaves a map, pictures and a score.",
        epilog="Example: ./explore --world rooms --robot small --out runs/mine. "
        "Exit code: 0 explored, 1 the run failed (summary.json says why), 2 wrong argument or missing package. "
        "A shell for roslaunch, rosrun and rostest: ./explore --setup, then source .ws/devel/setup.bash",
    )
    p.add_argument(
        "--world",
        metavar="W",
        help="rooms, doors, ramp, moon, or a FILE: mesh (.dae .obj .stl .ply .glb .gltf), SDF (.sdf .world), height map (.png), "
        "or a .yaml with one of these and its start, area, models and ground; default ramp",
    )
    p.add_argument("--size", nargs=3, type=float, metavar=("X", "Y", "Z"), help="metres that a height map covers; needed for .png")
    p.add_argument(
        "--area", nargs=2, type=float, metavar=("X", "Y"), help="explore only X by Y metres of a FILE, around the start, behind walls"
    )
    p.add_argument(
        "--start",
        nargs="+",
        type=float,
        metavar="X Y [Z] YAW",
        help="where the robot starts, in the world's coordinates; Z tells storeys apart; default: chosen by the seed",
    )
    p.add_argument(
        "--scale", type=float, metavar="M", help="metres a unit of a mesh FILE: 0.001 for millimetres; default 1, or as a .dae says"
    )
    p.add_argument(
        "--models",
        action="append",
        default=[],
        metavar="PATH",
        help="folder with the models that an SDF FILE includes, searched before those of Gazebo's own variables; may be repeated",
    )
    p.add_argument("--ground", type=float, metavar="Z", help="add a floor at height Z to a mesh or SDF FILE that has none")
    p.add_argument("--up", choices=UPS, help="the axis of a mesh FILE that points up; default z, or as a .dae says")
    p.add_argument(
        "--sensor",
        choices=SENSORS,
        help="tilting: a 2-D laser on a tilting mount; spinning: a lidar of 16 beams; default tilting, where it is fixed spinning",
    )
    p.add_argument(
        "--realism",
        choices=REALISMS,
        help="hardware: sensors, clocks and drive as one buys them; ideal: without most of their faults; default hardware",
    )
    p.add_argument(
        "--mapping",
        choices=MAPPINGS,
        help="driving: the mount nods, and the robot stops only where it must; stop_and_go: it stands for each sweep; "
        "default driving, with --profile thesis stop_and_go",
    )
    p.add_argument(
        "--movers", metavar="N|FILE", help="so many people, carts and robots that go about, or those of a YAML FILE; default none"
    )
    p.add_argument("--seed", type=int, help="sets start, noise, slip and clutter; default 1")
    p.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder for the results; default runs/WORLD-SEED, with --map WORLD-SEED-more, with --goals WORLD-SEED-goals; "
        "an earlier run there is overwritten; where one is under way, it is WORLD-SEED-2",
    )
    go_on = p.add_mutually_exclusive_group()
    go_on.add_argument(
        "--resume", type=Path, metavar="DIR", help="go on as it was started with the run in DIR, however it ended; the robot may have moved"
    )
    go_on.add_argument("--map", type=Path, metavar="DIR", help="start somewhere in the finished map of DIR, and explore what it lacks")
    p.add_argument("--goals", action="store_true", help="with --map: only drive to goals in it, until Ctrl-C; the map stays as it is")
    p.add_argument("--force", action="store_true", help="overwrite an earlier run in a folder that --out names")
    view = p.add_mutually_exclusive_group()
    view.add_argument("--headless", action="store_true", help="no rviz, also where there is a display")
    view.add_argument("--rviz", action="store_true", help="rviz, also where DISPLAY is not set")
    p.add_argument(
        "--rate",
        type=float,
        metavar="R",
        help="at most R times real time, 0: as fast as the machine can; default 0, with --free, --goals 1",
    )
    p.add_argument("--free", action="store_true", help="no lock-step: for a teleop or node of your own beside it")
    p.add_argument("--record", action="store_true", help="write run.bag: what the robot's drivers sent, and what mapping and terrain heard")
    p.add_argument("--port", type=int, metavar="N", help="port of the ROS master; default 11311, or one near it when that is taken")
    p.add_argument("--max-sim-time", type=float, metavar="S", help="stop after S simulated seconds; default 3600, with --goals never")
    p.add_argument(
        "--at-end", choices=AT_ENDS, default=AT_ENDS[0], help="stay where nothing is left to explore, or drive home; default stay"
    )
    p.add_argument("--zones", type=Path, metavar="FILE", help="YAML with bounds and no_go: polygons in map, whose origin is the start")
    p.add_argument(
        "--budget", type=float, default=0.0, metavar="MIN", help="be home again after so many simulated minutes; default 0: none"
    )
    p.add_argument("--budget-m", type=float, default=0.0, metavar="M", help="be home again after so many metres driven; default 0: none")
    p.add_argument(
        "--robot",
        metavar="R",
        help="the robot: husky, the name of a file in config/robots/, or a FILE like config/robot.yaml, with its URDF; default husky",
    )
    p.add_argument(
        "--profile",
        metavar="P",
        help="parameters to explore with: the name of a file in config/profiles/, or a YAML FILE; default ours",
    )
    p.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NODE/PARAMETER=VALUE",
        help="overrides one parameter, also of the robot, as robot/max_step_m=0.08; may be repeated",
    )
    p.add_argument(
        "--clairvoyant", action="store_true", help="compare the time with that of a robot that knows the world: some seconds at the end"
    )
    p.add_argument("--setup", action="store_true", help="only set up: packages, .venv, workspace")
    return p


def parse(argv: list[str] | None = None) -> ExploreArguments:
    """Checked arguments; ArgumentProblem for what argparse cannot know, SystemExit(2) for what it can.

    A run that goes on is by default started as the earlier one was; zones are those of its map, and hold in --resume.
    """
    a = parser().parse_args(argv)
    earlier = earlier_run(a.resume or a.map) if a.resume or a.map else NO_RUN
    if a.world in (None, earlier.world):
        for name, value in earlier.of_world.items():
            if getattr(a, name) in (None, []) and value is not None:
                setattr(a, name, value)
    a.world = a.world or earlier.world or "ramp"
    a.profile = a.profile or earlier.profile or "ours"
    a.seed = next(seed for seed in (a.seed, earlier.seed, 1) if seed is not None)
    a.sensor = a.sensor or (earlier.sensor if earlier.sensor in SENSORS else None)
    a.realism = a.realism or (earlier.realism if earlier.realism in REALISMS else REALISMS[0])
    a.mapping = a.mapping or (earlier.mapping if earlier.mapping in MAPPINGS else None)
    a.movers = a.movers if a.movers is not None else earlier.movers or ""
    a.rate = float(a.free or a.goals) if a.rate is None else a.rate
    a.max_sim_time = (_FOREVER_S if a.goals else 3600.0) if a.max_sim_time is None else a.max_sim_time
    if a.goals and not a.map:
        raise ArgumentProblem("--goals drives in a finished map: --map DIR names it")
    if a.resume and a.out:
        raise ArgumentProblem("--resume goes on in the folder of the earlier run: --out cannot be another")
    check_world(a.world, a.size)
    check_numbers(a)
    check_movers(a.movers, a.seed)
    if a.zones:
        check_zones(a.zones)
    zones = a.zones or (earlier.zones if a.resume else None)
    of_map = "-goals" if a.goals else "-more" if a.map else ""
    out = (a.resume or a.out or Path("runs") / f"{Path(a.world).stem}-{a.seed}{of_map}").absolute()
    if a.map and a.map.resolve() == out.resolve():
        raise ArgumentProblem(
            f"--map {a.map}: the new run would overwrite it; --out DIR names another folder, --resume goes on in this one"
        )
    return ExploreArguments(
        world=a.world if a.world in NAMED_WORLDS else str(Path(a.world).absolute()),
        sensor=a.sensor,
        realism=a.realism,
        mapping=a.mapping,
        movers=a.movers if a.movers.isdecimal() or not a.movers else str(Path(a.movers).absolute()),
        seed=a.seed,
        start=tuple(a.start) if a.start else None,
        scale=a.scale,
        up=a.up,
        models=tuple(Path(path).absolute() for text in a.models for path in text.split(os.pathsep) if path),
        ground=a.ground,
        size=tuple(a.size) if a.size else None,
        area=tuple(a.area) if a.area else None,
        out=out,
        may_be_elsewhere=not (a.out or a.resume),
        resume=a.resume is not None,
        map=a.map.absolute() if a.map else None,
        goals=a.goals,
        force=a.force or a.out is None,
        headless=a.headless or not (a.rviz or os.environ.get("DISPLAY")),
        rate=a.rate,
        lockstep=not a.free,
        record=a.record,
        port=a.port,
        max_sim_time_s=a.max_sim_time,
        at_end=a.at_end,
        budget_s=60.0 * a.budget,
        budget_m=a.budget_m,
        zones=zones.absolute() if zones else None,
        robot=_robot_file(a.robot) if a.robot else earlier.robot,
        profile=a.profile,
        set_parameters=tuple(a.set),
        clairvoyant=a.clairvoyant,
        check_only=a.setup,
    )


def input_files(a: ExploreArguments) -> list[Path]:
    """What a run reads that somebody named: world, models, movers, zones, robot and profile, where they are files or folders."""
    named = [*(Path(text) for text in (a.world, a.movers, a.profile) if text), *a.models, a.zones, a.robot]
    return [path for path in named if path is not None and path.exists()]


def _robot_file(name_or_file: str) -> Path:
    from robot_body import robot_file  # loads numpy: not for who only asks for help

    return robot_file(name_or_file).absolute()
