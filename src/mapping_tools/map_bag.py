"""./map_bag: a bag, or a folder of PCD and PLY sweeps, becomes a session folder with graph, trajectory and cloud. No ROS runs."""

from __future__ import annotations

import argparse
import dataclasses
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

import numpy as np

from explore_command.arguments import ArgumentProblem, OneLineParser
from mapping_tools.bag_sweeps import BagTopics
from mapping_tools.cloud_files import SUFFIXES
from mapping_tools.configuration import ToolConfig, configured
from mapping_tools.map_origin import ORIGIN, MapOrigin
from mapping_tools.mapping_run import MappingRun
from mapping_tools.number_options import check_finite, check_not_negative
from mapping_tools.pose_files import FORMS
from mapping_tools.recorded_sources import Wanted, add_raw_arguments, raw_topics, source_of
from mapping_tools.sensor_chain import SensorConfig
from mapping_tools.session_summary import SUMMARY, ended, recordings_of
from mapping_tools.sweep_sources import SweepSource
from mapping_tools.tool_errors import code_of, say
from mount_calibration import RECORDED_FILE
from pose_graph_mapping.graph.loop_closure import Match
from pose_graph_mapping.graph.mapper import PoseGraphMapper
from pose_graph_mapping.registration.methods import create_registration
from pose_graph_mapping.session.session_resume import resume
from pose_graph_mapping.session.session_store import SAVED, SessionStore
from rigid_geometry import transform_from_rpy
from stage_config import to_mapping
from whole_files import check_folder, is_same

_PASSED_OVER = "nothing of it was mapped: its stamps are not after those of the session's recordings; map it on its own, then ./merge_maps"
MADE_OF_SWEEPS = ("map.ot", "map.bt", "terrain.npz")
_POSE_FORMS = "; or ".join(FORMS.values())
_DESCRIPTION = f"""Maps a bag, or a folder of sweeps ({" ".join(SUFFIXES)}) in the order of their names, 9 before 10, or of their stamps.
A bag is a file of ROS 1, a file or folder of ROS 2 (.db3, .mcap), or a folder of bags, which are read as one in the order of time. It holds
PointCloud2 sweeps and Odometry; or what a robot's drivers sent: LaserScan, or PointCloud2 of a lidar on the tilting mount, with JointState,
Imu and Odometry of the wheels. Odometry of a robot that moves has to come at 4 Hz or more.
A folder of sweeps may hold poses.txt with the odometry pose of every sweep, z up: {_POSE_FORMS}.
Poses with stamps go with files whose names are these stamps, others by their order. Without poses.txt each sweep is looked for around
the last one. Every sweep should be taken while the sensor stands, or be de-skewed. Where odometry is far from 0 0 0, as in UTM, the map
gets an origin of its own ({ORIGIN}). Points at 0 0 0, or where their beam starts, are beams without an echo."""
_EPILOG = f"""DIR then holds sweeps/, graph.g2o, trajectory.txt (TUM), cloud.ply, cloud.pcd and {SUMMARY}. A run that was killed goes on
with --resume. Example: ./map_bag run.bag --out session. Exit code: 0 mapped, 1 some sweeps could not be placed, a part of the recording
could not be read, all of another one was passed over, or it was stopped, 2 wrong file or argument, 130 interrupted twice, or before or
after mapping."""


def parser() -> argparse.ArgumentParser:
    p = OneLineParser(prog="./map_bag", usage="./map_bag BAG|FOLDER --out DIR [options]", description=_DESCRIPTION, epilog=_EPILOG)
    p.add_argument("recording", type=Path, metavar="BAG|FOLDER")
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="the session's folder; made where it is not there")
    p.add_argument("--resume", action="store_true", help="go on with the session in DIR; sweeps up to its last stamp are passed over")
    p.add_argument("--moved", action="store_true", help="with --resume: find the first new sweep in the map, whatever odometry says")
    p.add_argument("--cloud-topic", metavar="T", help=f"PointCloud2, a sweep each; default {BagTopics.cloud}, where the bag has it")
    p.add_argument("--raw", action="store_true", help="map what the drivers sent, though the bag holds finished clouds, too")
    p.add_argument(
        "--mount-calibration",
        metavar="FILE",
        help=f"of calibrate_mount; auto: the one it writes by default; '' for none; default {RECORDED_FILE} beside robot.yaml, where it is",
    )
    add_raw_arguments(p)
    p.add_argument("--no-odometry", action="store_true", help="a bag without odometry: look for each sweep around the last one")
    p.add_argument(
        "--mount",
        nargs=6,
        type=float,
        metavar=("X", "Y", "Z", "ROLL", "PITCH", "YAW"),
        help="pose of the clouds' frame in base_link, m and rad; wanted where their frame is not odometry's child frame",
    )
    p.add_argument(
        "--sensor",
        nargs=3,
        type=float,
        metavar=("X", "Y", "Z"),
        help="where beams start, in the clouds' frame, m, for clouds without vp_x vp_y vp_z; default its origin, or a PCD's VIEWPOINT",
    )
    p.add_argument(
        "--min-travel", type=float, default=0.0, metavar="M", help="pass by sweeps nearer to the last one than this, by odometry"
    )
    p.add_argument("--no-gravity", action="store_true", help="odometry's roll and pitch do not come from gravity")
    p.add_argument("--set", action="append", default=[], metavar="PARAMETER=VALUE", help="of the nodes that the sweeps go through")
    p.add_argument("--quiet", action="store_true", help="no line a sweep")
    return p


def recorded(a: argparse.Namespace, config: SensorConfig) -> SweepSource:
    """The recording that the arguments name; ArgumentProblem when it is none."""
    if not a.recording.exists():
        raise ArgumentProblem(f"{a.recording}: no such bag or folder")
    _check_out(a)
    raw = raw_topics(a)
    T_base_cloud = None if a.mount is None else np.asarray(transform_from_rpy(a.mount[:3], tuple(a.mount[3:])))
    sensor = None if a.sensor is None else np.array(a.sensor)
    try:
        return source_of(
            Wanted(
                recording=a.recording,
                cloud=a.cloud_topic,
                odometry=a.odom_topic,
                without_odometry=a.no_odometry,
                raw=raw,
                from_raw=a.raw,
                robot=a.robot,
                calibration=a.mount_calibration,
                T_base_cloud=T_base_cloud,
                sensor=sensor,
            ),
            config,
        )
    except (ValueError, OSError) as error:
        raise ArgumentProblem(f"{a.recording}: {'; '.join(str(error).splitlines())}") from error


def _check_numbers(a: argparse.Namespace) -> None:
    check_finite("--mount", a.mount)
    check_finite("--sensor", a.sensor)
    check_not_negative("--min-travel", a.min_travel)


def _check_effects(a: argparse.Namespace) -> None:
    if a.moved and not a.resume:
        raise ArgumentProblem("--moved: has no effect without --resume")
    if a.no_odometry and a.odom_topic is not None:
        raise ArgumentProblem("--odom-topic: has no effect with --no-odometry")
    if a.no_odometry and a.min_travel:
        raise ArgumentProblem("--min-travel: has no effect with --no-odometry, which tells of no travel")


def _check_out(a: argparse.Namespace) -> None:
    """ArgumentProblem where the session would replace the recording, or what lies beside it."""
    if is_same(a.out, a.recording):
        raise ArgumentProblem(f"--out {a.out}: is the recording, which is only read; name another folder")
    if a.recording.is_file() and is_same(a.out, a.recording.absolute().parent):
        raise ArgumentProblem(f"--out {a.out}: {a.recording.name} itself lies there; name another folder")
    check_folder("--out", a.out)


def _holds_session(folder: Path) -> bool:
    return (folder / "sweeps").is_dir() and any((folder / "sweeps").iterdir())


def open_session(a: argparse.Namespace, config: ToolConfig, match: Match) -> tuple[SessionStore, PoseGraphMapper, tuple[str, ...]]:
    """The session's store and mapper, and what is damaged in it; ArgumentProblem when there is none to open, or one to be kept."""
    existing = _holds_session(a.out)
    if existing != a.resume:
        wrong = "holds a session; --resume goes on with it" if existing else "holds no session to go on with"
        raise ArgumentProblem(f"{a.out}: {wrong}")
    is_own = (a.out / "sweeps").is_dir()  # of a run that placed no sweep
    if not is_own and (found := [name for name in (*SAVED, SUMMARY, ORIGIN) if (a.out / name).exists()]):
        raise ArgumentProblem(f"--out {a.out}: the session would replace its {found[0]}; name another folder")
    try:
        store = SessionStore(a.out)
        if not a.resume:
            return store, PoseGraphMapper(config.mapping, match), ()
        resumed = resume(store, config.mapping, match)
    except (ValueError, OSError) as error:
        raise ArgumentProblem(f"{a.out}: {error}") from error
    return store, resumed.mapper, resumed.notes


def map_recording(a: argparse.Namespace) -> int:
    """The exit code of a run; ArgumentProblem for code 2."""
    begun = time.monotonic()
    _check_numbers(a)
    _check_effects(a)
    config = configured(a.set, use_gravity=not a.no_gravity)
    source, match = recorded(a, config.sensors), create_registration(config.registration).match
    store, mapper, notes = open_session(a, config, match)
    origin, before, earlier = _origin(a), len(mapper.stamps_s), recordings_of(a.out) if a.resume else []
    for note in notes:
        say(note)
    run = MappingRun(mapper, match, store, origin, (lambda _: None) if a.quiet else say, min_travel_m=a.min_travel)
    run.before_first = lambda: _remove_stale(a.out)
    stopped = _mapped(run, source, a)
    for note in source.notes:
        say(note)
    left_out, unsaved = _saved(store, mapper, config)
    this = str(a.recording.resolve())
    is_own = len(mapper.stamps_s) > before or earlier is None or this in earlier
    passed_over = None if is_own or run.account.known < run.account.read else _PASSED_OVER
    problems = [text for text in (stopped, source.problem, unsaved, passed_over) if text]
    summary = {
        "recording": str(a.recording),
        "recordings": sorted({*(earlier or ()), *([this] if is_own else ())}),
        "complete": not problems and not run.account.not_placed,
        "problems": problems,
        "notes": list(source.notes),
        "damaged": [*notes, *(text for text in left_out if not any(text in note for note in notes))],
        "vertices": len(mapper.stamps_s),
        "edges": len(mapper.graph.edges()),
        "edges_left_out": [[e.i, e.j, e.kind.value] for e in mapper.graph.rejected()],
        "origin_m": origin.xyz.tolist(),
        "not_on_disk": store.not_on_disk,
        **dataclasses.asdict(run.account),
        "wall_time_s": round(time.monotonic() - begun, 3),
        "config": {name: to_mapping(getattr(config, name)) for name in ("registration", "mapping")},
    }
    return ended(a.out, a.recording, summary)


def _remove_stale(folder: Path) -> None:
    """Of an explored run what its earlier sweeps were made into, which others would believe."""
    if found := [name for name in MADE_OF_SWEEPS if (folder / name).is_file()]:
        for name in found:
            (folder / name).unlink()
        say(f"{', '.join(found)}: are of the earlier sweeps, and were removed; ./export_map makes them anew")


def _origin(a: argparse.Namespace) -> MapOrigin:
    try:
        return MapOrigin(a.out, goes_on=a.resume)
    except ValueError as error:
        raise ArgumentProblem(f"{a.out}: {error}") from error


def _mapped(run: MappingRun, source: SweepSource, a: argparse.Namespace) -> str | None:
    """Maps the recording; why it ended before its end, or None. Ctrl-C and SIGTERM end it after what it is at, a second one at once.

    ArgumentProblem where there is no sweep in it, or it cannot be read up to the first one.
    """
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def stop(number: int, frame: FrameType | None) -> None:
        if not run.is_stopping:
            run.stop()
        elif callable(again := before[signal.Signals(number)]):
            again(number, frame)

    for number, handler in before.items():
        if handler is not signal.SIG_IGN:
            signal.signal(number, stop)
    try:
        whole = run.map(source, moved=a.moved)
    except (ValueError, OSError) as error:
        if not run.account.read:
            raise ArgumentProblem(f"{a.recording}: {error}") from error
        return f"it ended after {100 * source.progress:.0f} %: {error}"
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    return None if whole else f"stopped after {100 * source.progress:.0f} % of it"


def _saved(store: SessionStore, mapper: PoseGraphMapper, config: ToolConfig) -> tuple[tuple[str, ...], str | None]:
    """Solves the graph a last time and writes it; sweeps that are missing in the cloud, and why nothing was saved, or None."""
    mapper.graph.solve()
    try:
        return store.save(mapper.graph, config.mapping.map_voxel_m, mapper.gone()), None
    except (OSError, ValueError, MemoryError) as error:
        return (), f"graph, trajectory and cloud could not be saved: {error}"


def main(argv: Sequence[str] | None = None) -> int:
    """Exit code for arguments, sys.argv's by default."""
    return code_of("map_bag", lambda: _mapped_or_told(parser().parse_args(argv)))


def _mapped_or_told(a: argparse.Namespace) -> int:
    try:
        return map_recording(a)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"{a.out} holds a session; --resume goes on with it" if _holds_session(a.out) else "") from None


if __name__ == "__main__":
    sys.exit(main())
