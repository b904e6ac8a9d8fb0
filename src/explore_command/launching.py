"""Starts roslaunch with a master on a free port, and hands Ctrl-C on."""

import os
from dataclasses import replace
from pathlib import Path

import yaml

from explore_command.arguments import MAPPINGS, NAMED_WORLDS, SENSORS, ArgumentProblem, ExploreArguments
from explore_command.ending import ended
from explore_command.parameters import COMMAND, ROBOT, all_overrides, chosen_mapping, override_problems, robot_of
from rigid_geometry import origin_text
from robot_body import PACKAGE_FOLDER, RobotBody, description_remarks, fixed_laser_problem, is_fixed, robot_mapping, urdf_file
from roslaunch_process import free_port, hand_on_signals, shown_lines, start_launch
from simulated_movers import MoverError, asked_movers
from stage_config import ConfigError
from whole_files import WaitingLines, write_whole

_SHUTDOWN_S = 60
_SHELL = PACKAGE_FOLDER / ".ws/devel/setup.bash"
_MONITOR_MARK = "[explore]"


def world_problem(arguments: ExploreArguments, robot: RobotBody) -> str | None:
    """Why the world, the start or the movers cannot be used, or None; it says where a far one lies.

    Named ones with their own start, and without movers, need no look.
    """
    if arguments.world in NAMED_WORLDS and arguments.start is None and not arguments.movers:
        return None
    from exploration_evaluation import size_problem
    from pybullet_simulation import crowd_in, load_world
    from world_files import WorldDescription

    a = arguments
    about = WorldDescription(a.world, a.start, a.area, a.size, a.scale, a.up, a.models, a.ground)
    try:
        world = load_world(about, arguments.seed, robot=robot)
        problem = size_problem(world.vertices)
    except ValueError as error:
        problem = str(error)
    if problem:
        return f"--world {arguments.world}: {problem}"
    for note in world.notes:
        print(note, flush=True)
    if arguments.world not in NAMED_WORLDS:
        print(f"{world.name}: {world.about()}", flush=True)
    try:
        crowd_in(replace(world, movers=world.movers + asked_movers(arguments.movers, arguments.seed)), robot, arguments.seed)
    except MoverError as error:
        return _mover_problem(error, len(world.movers), arguments)
    if any(world.origin):
        print(f"{arguments.world}: {origin_text(world.origin, 'world.ply and true poses')}, which world_origin.json keeps", flush=True)
    return None


def _mover_problem(error: MoverError, of_world: int, arguments: ExploreArguments) -> str:
    """Which mover cannot be, and why: the first `of_world` stand in the world's file, the rest were asked for."""
    if error.index < of_world:
        return f"--world {arguments.world}: mover {error.index + 1}: {error.sentence}"
    return f"--movers {arguments.movers}: mover {error.index - of_world + 1}: {error.sentence}"


def parameter_problem(arguments: ExploreArguments) -> str | None:
    """What is wrong with the names and values of --profile and --set, in one line, or None."""
    try:
        problems = override_problems(all_overrides(arguments.profile, arguments.set_parameters))
    except ValueError as error:
        problems = [str(error)]
    return f"--profile, --set: wrong parameter: {'; '.join(problems)}" if problems else None


def effective_robot(arguments: ExploreArguments) -> RobotBody:
    """The robot of --robot with what --profile and --set change. ArgumentProblem lists all that is wrong with it, one a line."""
    try:
        robot = robot_of(arguments.robot, all_overrides(arguments.profile, arguments.set_parameters))
    except ConfigError as error:
        raise ArgumentProblem("\n".join(f"--robot {line}" for line in str(error).splitlines())) from error
    urdf = urdf_file(robot)
    for remark in description_remarks(robot, urdf.read_text(encoding="utf-8"), urdf.parent):
        print(f"./explore: {urdf}: {remark}", flush=True)
    return robot


def as_robot_is_built(arguments: ExploreArguments, robot: RobotBody) -> ExploreArguments:
    """The arguments with sensor and mapping where they were not said. ArgumentProblem when what was said does not go with a fixed lidar."""
    profile = chosen_mapping(all_overrides(arguments.profile, arguments.set_parameters))
    sensor, mapping = sensor_and_mapping(robot, arguments.sensor, arguments.mapping, profile)
    return replace(arguments, sensor=sensor, mapping=mapping)


def sensor_and_mapping(robot: RobotBody, sensor: str | None, mapping: str | None, profile: str | None = None) -> tuple[str, str]:
    """Both, as the robot is built where they are None, and then as its profile chooses. ArgumentProblem when they do not go with a lidar
    that is fixed."""
    fixed = is_fixed(urdf_file(robot).read_text(encoding="utf-8"), robot.mount("laser"))
    sensor, mapping = sensor or SENSORS[fixed], mapping or (profile if profile and not fixed else MAPPINGS[0])
    if fixed and (problem := fixed_laser_problem(robot, sensor, mapping)):
        raise ArgumentProblem(problem)
    return sensor, mapping


def _joined(values: tuple[float, ...] | None) -> str:
    return " ".join(f"{v:.12g}" for v in values) if values else ""


def launch_arguments(arguments: ExploreArguments, robot: RobotBody, overrides: Path, clock_start_s: float = 0.0) -> dict[str, object]:
    """The launch file's arguments by name; the robot's file lies beside the overrides."""
    return {
        "robot_file": overrides.with_name("robot.yaml"),
        "urdf": urdf_file(robot),
        "world": arguments.world,
        "sensor": arguments.sensor,
        "realism": arguments.realism,
        "mapping": "off" if arguments.goals else arguments.mapping,
        "map": arguments.map if arguments.goals else "",
        "movers": arguments.movers,
        "seed": arguments.seed,
        "start": _joined(arguments.start),
        "scale": _joined((arguments.scale,)) if arguments.scale else "",
        "up": arguments.up or "",
        "models": os.pathsep.join(map(str, arguments.models)),
        "ground": "" if arguments.ground is None else f"{arguments.ground:.12g}",
        "size": _joined(arguments.size),
        "area": _joined(arguments.area),
        "out": arguments.out,
        "resume": str(arguments.resume or (arguments.map is not None and not arguments.goals)).lower(),
        "clock_start": clock_start_s,
        "rate": arguments.rate,
        "lockstep": str(arguments.lockstep).lower(),
        "record": str(arguments.record).lower(),
        "rviz": str(not arguments.headless).lower(),
        "max_sim_time": arguments.max_sim_time_s,
        "at_end": arguments.at_end,
        "budget_s": arguments.budget_s,
        "budget_m": arguments.budget_m,
        "zones": arguments.zones or "",
        "required": "true",
        "overrides": overrides,
    }


def _write_parameters(arguments: ExploreArguments, robot: RobotBody) -> Path:
    """robot.yaml, and the file with the parameters of --profile and --set, for the launch file."""
    write_whole(arguments.out / "robot.yaml", yaml.safe_dump(robot_mapping(robot), sort_keys=False))
    overrides = all_overrides(arguments.profile, arguments.set_parameters)
    for elsewhere in (ROBOT, COMMAND):  # in robot.yaml, and among the launch file's arguments
        overrides.pop(elsewhere, None)
    overrides.setdefault("exploration_monitor_node", {})["profile"] = arguments.profile
    path = arguments.out / "overrides.yaml"
    write_whole(path, yaml.safe_dump(overrides))
    return path


def run_launch(arguments: ExploreArguments, robot: RobotBody, clock_start_s: float, lock: int) -> int:
    """Runs the launch file to its end; 0 when the run succeeded, 2 for a wrong parameter, else 1.

    The lock of the folder is the launch's, too: nobody writes there before the last node has ended, also when this process is killed.
    """
    port = arguments.port or free_port()
    laser = "a tilting laser" if arguments.sensor == SENSORS[0] else "a lidar of 16 beams"
    what = f"exploring {arguments.world}, seed {arguments.seed}, with {laser} on {robot.name}"
    print(f"{what}; results in {arguments.out}; ROS_MASTER_URI=http://localhost:{port}", flush=True)
    print(_where_to_look_now(arguments, port), flush=True)
    values = launch_arguments(arguments, robot, _write_parameters(arguments, robot), clock_start_s)
    log, said = WaitingLines(arguments.out / "roslaunch.log"), []
    launch = start_launch("explore.launch", values, port, arguments.out / "log", _SHUTDOWN_S, kept_open=(lock,))
    caught = hand_on_signals(launch)
    for line in shown_lines(launch, _MONITOR_MARK):
        log.add(f"{line}\n")
        said.append(line)
    launch_code = launch.wait()
    log.close()
    code = ended(arguments.out, launch_code, bool(caught), "\n".join(said))
    if arguments.clairvoyant:
        _compare_with_clairvoyant(arguments.out)
    print(_where_to_look_afterwards(arguments.out), flush=True)
    return code


def _where_to_look_now(arguments: ExploreArguments, port: int) -> str:
    """How a running exploration is seen, in one line."""
    if not arguments.headless:
        return "to look: rviz opens"
    return f"to look: source {_SHELL}; ROS_MASTER_URI=http://localhost:{port} rviz -d {PACKAGE_FOLDER / 'config/explore.rviz'}"


def _where_to_look_afterwards(out: Path) -> str:
    """What shows a finished run, in one line; where nothing was drawn, what tells why."""
    picture = out / "map_angle.png"
    if not picture.exists():
        return f"to look: {out / 'roslaunch.log'}, and docs/failures.md"
    return f"to look: {picture}, or ./replay {out} in rviz; README.md says what the files are"


def _compare_with_clairvoyant(out: Path) -> None:
    from exploration_evaluation import add_clairvoyant  # loads numba: only when it is asked for

    try:
        summary = add_clairvoyant(out)
    except ValueError as error:
        print(f"{_MONITOR_MARK} no clairvoyant: {error}", flush=True)
        return
    why = next((text for text in summary["missing"] if text.startswith("clairvoyant")), "")
    ratio, time_s = summary["clairvoyant_ratio"], summary["clairvoyant_time_s"]
    told = why if ratio is None else f"{ratio:.2f} of the {time_s:.0f} s of a robot that knows the world"
    print(f"{_MONITOR_MARK} {told}", flush=True)
