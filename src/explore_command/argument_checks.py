"""What is wrong with single arguments of ./explore."""

import argparse
import math
from pathlib import Path

from explore_command.results_folder import ArgumentProblem

NAMED_WORLDS = ("rooms", "doors", "ramp", "moon")
MOST_BUDGET = 10_000  # minutes or metres


def check_world(world: str, size: list[float] | None) -> None:
    """ArgumentProblem for a world that is not there, and a height map whose size is not said."""
    if world in NAMED_WORLDS:
        return
    if not Path(world).is_file():
        raise ArgumentProblem(
            f"--world {world}: no such world or file; worlds are {', '.join(NAMED_WORLDS)}, or a mesh, .sdf, .world, .png or .yaml file"
        )
    if Path(world).suffix.lower() == ".png" and size is None:
        raise ArgumentProblem(f"--world {world}: a height map needs --size X Y Z, the metres that it covers")


def check_movers(movers: str, seed: int = 0) -> None:
    """ArgumentProblem for what is neither a number of movers nor a file of them."""
    from simulated_movers import asked_movers  # loads numpy: not for who only asks for help

    try:
        asked_movers(movers, seed)
    except ValueError as error:
        raise ArgumentProblem(f"--movers {error}") from error


def check_zones(path: Path) -> None:
    """ArgumentProblem for a file of zones that is none, or that closes out the start."""
    from map_zones import read_zones  # loads numpy: not for who only asks for help

    try:
        zones = read_zones(path)
    except ValueError as error:
        raise ArgumentProblem(f"--zones {error}") from error
    if why := zones.why_closed((0.0, 0.0, 0.0)):
        raise ArgumentProblem(f"--zones {path}: the robot starts at 0 0 of map, and {why}")


def check_numbers(a: argparse.Namespace) -> None:
    """ArgumentProblem for a number that is out of range, and a --set that is none."""
    if a.port is not None and not 1024 <= a.port <= 65535:
        raise ArgumentProblem(f"--port {a.port}: expected 1024 to 65535")
    if a.rate < 0 or a.max_sim_time <= 0 or a.seed < 0:
        raise ArgumentProblem("--rate must not be negative, --max-sim-time must be positive, --seed must not be negative")
    for name, budget in (("--budget", a.budget), ("--budget-m", a.budget_m)):
        if not 0.0 <= budget <= MOST_BUDGET:
            raise ArgumentProblem(f"{name} {budget:g}: expected 0, for none, to {MOST_BUDGET}")
    if a.start is not None and len(a.start) not in (3, 4):
        raise ArgumentProblem(f"--start: {len(a.start)} numbers where X Y YAW or X Y Z YAW are wanted")
    if a.scale is not None and not 0.0 < a.scale < math.inf:
        raise ArgumentProblem(f"--scale {a.scale:g}: expected a positive number of metres a unit")
    if (a.scale is not None or a.up) and (a.world in NAMED_WORLDS or Path(a.world).suffix.lower() == ".png"):
        raise ArgumentProblem(f"--scale and --up are for meshes: {a.world} is in metres with z up")
    if a.world in NAMED_WORLDS and (a.size or a.area or a.models or a.ground is not None):
        raise ArgumentProblem(f"--size, --area, --models and --ground are for files: {a.world} has its own")
    for name in ("size", "area"):
        if not all(0.0 < v < math.inf for v in getattr(a, name) or ()):
            raise ArgumentProblem(f"--{name}: lengths must be positive and finite")
    if a.ground is not None and not math.isfinite(a.ground):
        raise ArgumentProblem(f"--ground {a.ground:g}: expected a height in metres")
    for text in a.set:
        if "/" not in text.partition("=")[0] or "=" not in text:
            raise ArgumentProblem(f"--set {text}: expected NODE/PARAMETER=VALUE, for example octomap_server_3dnav_node/resolution=0.05")
