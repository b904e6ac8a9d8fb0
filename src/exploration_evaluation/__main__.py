"""`python -m exploration_evaluation DIR`: judges a finished run folder again and draws its pictures."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from exploration_evaluation.clairvoyant_score import add_clairvoyant
from exploration_evaluation.mesh import read_mesh
from exploration_evaluation.report import format_summary
from exploration_evaluation.run_folder import evaluate_run

_DESCRIPTION = """\
Scores a finished exploration against the true world and writes DIR/summary.json, map_top.png and map_angle.png.
What the folder lacks is reported as unknown, in the summary's list "missing"; it never makes up a number."""
_EPILOG = """\
Example: python -m exploration_evaluation runs/ramp-1
Exit code: 0 the run was judged (also when it failed), 2 wrong arguments, or a folder or mesh that cannot be read"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Judges as the command line says; returns the exit code."""
    options = _parser().parse_args(arguments)
    mesh_file = options.world_mesh or options.directory / "world.ply"
    try:
        if not options.directory.is_dir():
            raise ValueError(f"no run folder at {options.directory}")
        summary = evaluate_run(options.directory, *read_mesh(mesh_file))
    except (ValueError, OSError) as error:
        print(f"exploration_evaluation: {error}", file=sys.stderr)
        return 2
    if options.clairvoyant:
        summary = add_clairvoyant(options.directory)
    print(format_summary(summary))
    if options.pictures:
        _draw(options.directory, summary)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="exploration_evaluation", description=_DESCRIPTION, epilog=_EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("directory", type=Path, metavar="DIR", help="folder of the run: run.json, trajectory.txt, occupied.npz, ...")
    parser.add_argument(
        "--world-mesh", type=Path, metavar="FILE", help="true mesh in the world frame, .ply .obj or .stl (default: DIR/world.ply)"
    )
    parser.add_argument(
        "--clairvoyant",
        action="store_true",
        help="compare the time with that of a robot that knows the world: some seconds the first time, then kept in ~/.cache/explore_3dnav",
    )
    parser.add_argument("--no-pictures", dest="pictures", action="store_false", help="write summary.json only")
    return parser


def _draw(directory: Path, summary: dict[str, object]) -> None:
    from exploration_evaluation.pictures import draw_pictures  # matplotlib takes a second to load, and --help needs none

    try:
        written = draw_pictures(directory, summary)
    except (ValueError, OSError) as error:
        print(f"exploration_evaluation: no pictures: {error}", file=sys.stderr)
        return
    print(f"\n  pictures       {', '.join(str(path) for path in written)}")


if __name__ == "__main__":
    sys.exit(main())
