"""Kills a mapping run with SIGKILL at random moments and resumes it: sweeps lost, and how far the final graph is from the undisturbed one.

Usage: PYTHONPATH=src python benchmarks/session_kill.py [--kills 50] [--seed 1] [--sweeps 12] [--odometry-continues]

Every second run is killed while a sweep is being written, the others anywhere. The robot that resumes is placed by matching its next
sweep, as after a restart; with --odometry-continues its odometry has lived on. Needs no ROS. Exit code 1 when anything was lost.
"""

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "src"), str(ROOT / "test" / "unit" / "pose_graph_mapping")]

from pose_graph_mapping.config import MappingConfig, RegistrationConfig  # noqa: E402
from pose_graph_mapping.graph.localisation import localise  # noqa: E402
from pose_graph_mapping.graph.mapper import PoseGraphMapper  # noqa: E402
from pose_graph_mapping.graph.pose_graph import PoseGraph  # noqa: E402
from pose_graph_mapping.registration.cloud import PointCloud  # noqa: E402
from pose_graph_mapping.registration.methods import create_registration  # noqa: E402
from pose_graph_mapping.session.session_record import Measured  # noqa: E402
from pose_graph_mapping.session.session_resume import resume  # noqa: E402
from pose_graph_mapping.session.session_store import SessionStore  # noqa: E402
from rigid_geometry import inverse, rotation_angle, transform_from_rpy, translation_distance  # noqa: E402

INTERVAL_S = 10.0


def write_sweeps(path: Path, count: int, seed: int) -> None:
    """Simulated sweeps once around a room, with odometry that drifts, in one file."""
    from synthetic_sweeps import furnished_room, pose, sweep, world_of

    rng, scene = np.random.default_rng(seed), world_of(furnished_room())
    arrays: dict[str, NDArray[np.floating]] = {}
    angles = np.linspace(0.0, 2.0 * np.pi, count)
    truth = [pose(2.4 * np.cos(a), 1.7 * np.sin(a), a + np.pi / 2) for a in angles]
    T_odom = truth[0]
    for k, T in enumerate(truth):
        if k:
            T_odom = T_odom @ inverse(truth[k - 1]) @ T @ transform_from_rpy((0.03, -0.02, 0.0), (0, 0, 0.03))
        points, origins = sweep(scene, T, rng)
        arrays |= {f"points{k}": points.astype(np.float32), f"origins{k}": origins.astype(np.float32), f"T{k}": T_odom, f"up{k}": T[2, :3]}
    np.savez(path, allow_pickle=False, **arrays)


def say(*words: object) -> None:
    print(*words, flush=True)


def map_sweeps(data: Path, folder: Path, odometry_continues: bool) -> None:
    """The child: maps what is not mapped yet, and says of every sweep when it begins to write it and when it is accepted."""
    match, config = create_registration(RegistrationConfig()).match, MappingConfig()
    sweeps, count = np.load(data), len(np.load(data).files) // 4
    store, placement = SessionStore(folder), None
    known = len(store.sweeps)
    mapper = resume(store, config, match).mapper if known else PoseGraphMapper(config, match)
    say("ready", known)
    begun = time.process_time()
    for k in range(known, count):
        cloud, T_odom, up = (sweeps[f"points{k}"], sweeps[f"origins{k}"]), sweeps[f"T{k}"], sweeps[f"up{k}"]
        if known and k == known and not odometry_continues:
            placement = localise(mapper.graph, mapper.vertex_clouds(), PointCloud(*cloud), match, gravity_base=up)
        mapper.add_sweep(INTERVAL_S * k, *cloud, T_odom, gravity_base=up, placement=placement)
        placement = None
        say("writing", k)
        store.add_sweep(k, INTERVAL_S * k, *cloud, mapper.graph, Measured(T_odom, up))
        say("accepted", k)
    mapper.graph.solve()
    store.save(mapper.graph)
    say("saved", time.process_time() - begun)


def child(data: Path, folder: Path, odometry_continues: bool) -> subprocess.Popen[str]:
    """A process that maps `data` into `folder`."""
    command = [sys.executable, __file__, "--child", str(folder), "--data", str(data)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT / "src"), os.environ.get("PYTHONPATH", "")])}
    more = ["--odometry-continues"] if odometry_continues else []
    return subprocess.Popen(command + more, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


def wait_for(process: subprocess.Popen[str], wanted: str) -> list[str]:
    """Lines of a child up to the one that begins with `wanted`; all of them when it never comes."""
    lines: list[str] = []
    assert process.stdout is not None
    for line in process.stdout:
        lines.append(line.strip())
        if line.startswith(wanted):
            break
    return lines


def killed_run(data: Path, folder: Path, after: str, seconds: float, odometry_continues: bool) -> int:
    """Sweeps that a child said were accepted before it was killed, `seconds` after its line that begins with `after`."""
    process = child(data, folder, odometry_continues)
    lines = wait_for(process, after)
    time.sleep(seconds)
    process.send_signal(signal.SIGKILL)
    rest, _ = process.communicate()
    return sum(line.startswith("accepted") for line in lines + rest.splitlines())


def whole_run(data: Path, folder: Path, odometry_continues: bool = False) -> tuple[int, PoseGraph | None, float, list[str]]:
    """Runs a child to its end: the sweeps it found there, its final graph or None, its seconds of work, and its last words."""
    process = child(data, folder, odometry_continues)
    lines = wait_for(process, "saved")
    _, errors = process.communicate()
    if process.returncode != 0:
        return 0, None, float("nan"), errors.strip().splitlines()[-1:]
    found = next(int(line.split()[1]) for line in lines if line.startswith("ready"))
    return found, PoseGraph.load_g2o(folder / "graph.g2o"), float(lines[-1].split()[1]), []


def difference(graph: PoseGraph, other: PoseGraph) -> tuple[float, float]:
    """Greatest distance (m) and angle (rad) between the poses of two graphs."""
    pairs = list(zip(graph.poses(), other.poses(), strict=True))
    return max(translation_distance(a, b) for a, b in pairs), max(rotation_angle(inverse(a) @ b) for a, b in pairs)


def kill_and_resume(
    arguments: argparse.Namespace, folder: Path, data: Path, undisturbed: PoseGraph, seconds: float
) -> Iterator[tuple[int, float, float] | None]:
    """A line and (sweeps lost, metres, radians) or None a kill."""
    rng = np.random.default_rng(arguments.seed)
    for number in range(arguments.kills):
        writing = number % 2 == 1
        after = f"writing {rng.integers(arguments.sweeps)}" if writing else "ready"
        wait_s = rng.uniform(0.0, 0.04 if writing else seconds)
        run = folder / f"run{number}"
        accepted = killed_run(data, run, after, wait_s, arguments.odometry_continues)
        found, graph, _, words = whole_run(data, run, arguments.odometry_continues)
        if graph is None:
            say(f"kill {number + 1}: {wait_s:.3f} s after '{after}', NOT RESUMED: {words}")
            yield None
            continue
        metres, radians = difference(graph, undisturbed)
        say(
            f"kill {number + 1}: {wait_s:.3f} s after '{after}', {accepted} accepted, {found} on disk; "
            f"end differs by {1e3 * metres:.3f} mm, {np.degrees(radians):.4f} deg"
        )
        yield max(0, accepted - found), metres, radians


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--sweeps", type=int, default=12)
    parser.add_argument("--odometry-continues", action="store_true", help="place the robot by odometry after it resumed")
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--data", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        map_sweeps(arguments.data, arguments.child, arguments.odometry_continues)
        return 0
    with tempfile.TemporaryDirectory() as name:
        folder, data = Path(name), Path(name) / "sweeps.npz"
        write_sweeps(data, arguments.sweeps, arguments.seed)
        _, undisturbed, seconds, words = whole_run(data, folder / "whole")
        if undisturbed is None:
            sys.exit(f"the undisturbed run failed: {words}")
        say(f"undisturbed: {len(undisturbed)} vertices, {len(undisturbed.edges())} edges in {seconds:.1f} s")
        ends = list(kill_and_resume(arguments, folder, data, undisturbed, seconds))
    resumed = [end for end in ends if end is not None]
    lost = sum(end[0] for end in resumed)
    metres, degrees = max((end[1] for end in resumed), default=np.nan), np.degrees(max((end[2] for end in resumed), default=np.nan))
    say(f"{len(resumed)} of {len(ends)} resumed, {lost} accepted sweeps lost, greatest difference {1e3 * metres:.2f} mm, {degrees:.3f} deg")
    return 0 if lost == 0 and len(resumed) == len(ends) else 1


if __name__ == "__main__":
    sys.exit(main())
