"""./merge_maps: two sessions of the same place become one. The second one's sweeps are mapped again, onto the first one's map."""

from __future__ import annotations

import argparse
import dataclasses
import json
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from explore_command.arguments import ArgumentProblem, OneLineParser
from mapping_tools.configuration import ToolConfig, configured
from mapping_tools.map_origin import MapOrigin
from mapping_tools.mapping_run import MappingRun, NotPlaced
from mapping_tools.session_sweeps import SessionSweeps
from mapping_tools.tool_errors import code_of, say
from pose_graph_mapping.graph.loop_closure import Match
from pose_graph_mapping.graph.mapper import PoseGraphMapper
from pose_graph_mapping.registration.methods import create_registration
from pose_graph_mapping.session.session_resume import resume
from pose_graph_mapping.session.session_store import SessionStore, copy_session
from whole_files import check_folder, is_same, lies_in, write_whole

SUMMARY = "merge_summary.json"
_TOLD = ("run.json", "robot.yaml", "robot.urdf", "mount_calibration.yaml", "world_origin.json", "map_origin.json")
"""What a session says of itself beside its sweeps: the merged one says it of the first."""
_PAUSE_S = 10.0
_DESCRIPTION = """Merges two sessions of the same place, as ./explore and ./map_bag leave them. A stays as it is, with its frame and origin;
each sweep of B is mapped onto it, the first of them found in A without a guess. What lies before it is mapped backwards from there."""
_EPILOG = f"""DIR then holds sweeps/, graph.g2o, trajectory.txt, cloud.ply, cloud.pcd and {SUMMARY}: ./explore --map DIR starts in it.
Example: ./merge_maps runs/monday runs/tuesday --out runs/both. Exit code: 0 merged, 1 some sweeps of B, or all, were not found in A (with
all there is no DIR), 2 wrong folder or argument, 130 interrupted, and then nothing is written."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = OneLineParser(prog="./merge_maps", usage="./merge_maps A B --out DIR [options]", description=_DESCRIPTION, epilog=_EPILOG)
    p.add_argument("first", type=Path, metavar="A", help="a session's folder; it is only read")
    p.add_argument("second", type=Path, metavar="B", help="another; it is only read")
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="the merged session's folder, new or empty")
    p.add_argument("--set", action="append", default=[], metavar="PARAMETER=VALUE", help="of registration and mapping")
    p.add_argument("--quiet", action="store_true", help="no line a sweep")
    return p


def opened(folder: Path) -> SessionStore:
    """The session of a folder; ArgumentProblem when there is none that could be gone on with."""
    if not (folder / "sweeps").is_dir():
        raise ArgumentProblem(f"{folder}: no session there, sweeps/ is missing")
    try:
        store = SessionStore(folder)
    except (ValueError, OSError) as error:
        raise ArgumentProblem(f"{folder}: {error}") from error
    if not store.sweeps:
        raise ArgumentProblem(f"{folder}: the session there holds no sweep")
    return store


def merge(a: argparse.Namespace) -> int:
    """The exit code; ArgumentProblem for code 2."""
    config = configured(a.set, of_sensors=False)
    if is_same(a.first, a.second):
        raise ArgumentProblem(f"{a.second}: is the same session as {a.first}; name two")
    opened(a.first)
    second = opened(a.second)
    check_folder("--out", a.out)
    for folder in (a.first, a.second):
        if lies_in(a.out, folder):
            raise ArgumentProblem(f"--out {a.out}: lies in {folder}, which is only read; name another folder")
    if a.out.exists() and any(a.out.iterdir()):
        raise ArgumentProblem(f"{a.out}: is not empty; name another folder")
    is_new = not a.out.exists()
    try:
        return _merged(a, config, second)
    except (Exception, KeyboardInterrupt) as error:
        _take_back(a.out, is_new)
        if not isinstance(error, NothingFound):
            raise
        say(f"./merge_maps: {error}")
        return 1


class NothingFound(Exception):
    """No sweep of the second session was found in the first."""


def _take_back(folder: Path, is_new: bool) -> None:
    """Removes what was written, so that the same command can be given again."""
    for path in folder.iterdir() if folder.is_dir() else ():
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    if is_new and folder.is_dir():
        folder.rmdir()


def _merged(a: argparse.Namespace, config: ToolConfig, second: SessionStore) -> int:
    match = create_registration(config.registration).match
    store = _copied(a.first, a.out)
    try:
        resumed = resume(store, config.mapping, match)
    except ValueError as error:
        raise ArgumentProblem(f"{a.first}: {error}") from error
    before = len(store.sweeps)
    not_placed = _mapped_onto(resumed.mapper, match, store, second, a)
    if len(not_placed) == len(second.sweeps):
        raise NothingFound(f"no sweep of {a.second} was found in {a.first}: {not_placed[0].reason}")
    resumed.mapper.graph.solve()
    damaged = store.save(resumed.mapper.graph, config.mapping.map_voxel_m, resumed.mapper.gone())
    summary = {
        "first": str(a.first),
        "second": str(a.second),
        "sweeps_of_first": before,
        "sweeps_of_second": len(store.sweeps) - before,
        "not_placed": [dataclasses.asdict(sweep) for sweep in not_placed],
        "damaged": list(damaged),
        "edges_left_out": [[e.i, e.j, e.kind.value] for e in resumed.mapper.graph.rejected()],
    }
    write_whole(a.out / SUMMARY, (json.dumps(summary, indent=1, allow_nan=False) + "\n").encode("utf-8"))
    say(f"{a.out}: {before} sweeps of {a.first} and {len(store.sweeps) - before} of {a.second}, {len(not_placed)} not placed")
    return 1 if not_placed else 0


def _mapped_onto(
    mapper: PoseGraphMapper, match: Match, store: SessionStore, second: SessionStore, a: argparse.Namespace
) -> list[NotPlaced]:
    """Maps the second session's sweeps forwards; and then backwards those that came before the first that was found."""
    number = {stored.file: stored.vertex_id for stored in second.sweeps}
    order, not_placed = list(range(len(second.sweeps))), list[NotPlaced]()
    for _ in ("forwards", "backwards"):
        run = MappingRun(mapper, match, store, MapOrigin(a.out, goes_on=True), (lambda _: None) if a.quiet else say)
        run.map(SessionSweeps(second, order, mapper.stamps_s[-1] + _PAUSE_S), moved=True)
        not_placed = run.account.not_placed
        order = [number[sweep.sweep] for sweep in reversed(not_placed)]
        if not order or len(order) == len(second.sweeps):
            break
    return not_placed


def _copied(source: Path, target: Path) -> SessionStore:
    store = copy_session(source, target)
    for name in _TOLD:
        if (source / name).is_file():
            write_whole(target / name, (source / name).read_bytes())
    return store


def main(argv: Sequence[str] | None = None) -> int:
    """Exit code for arguments, sys.argv's by default."""
    return code_of("merge_maps", lambda: merge(parser().parse_args(argv)))


if __name__ == "__main__":
    sys.exit(main())
