"""./calibrate_mount --from: the tilting mount is calibrated from what its drivers sent, recorded where the robot stood. No ROS runs."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from explore_command.arguments import ArgumentProblem, OneLineParser
from mapping_tools.raw_sweeps import RawSweeps
from mapping_tools.recorded_sources import ROBOT_FILE, add_raw_arguments, raw_topics, robot_of
from mapping_tools.recording import Recording, bags_of, unread_of
from mapping_tools.sensor_chain import SensorConfig
from mapping_tools.sweep_sources import Unreadable
from mapping_tools.tool_errors import code_of, say
from mount_calibration import MountCalibrationConfig, Place, estimate_mount, estimate_table, joined_places, write_calibration
from robot_body import DESCRIPTION, RobotBody, urdf_file
from whole_files import check_folder, check_not_read

_DESCRIPTION = """Calibrates the tilting mount from a bag of what a robot's drivers sent, as ./map_bag maps it: the sweeps that were made
while the robot stood. Sweeps at one place count together; the more headings, the better."""
_EPILOG = (
    "Example: ./calibrate_mount --from run.bag --out mount.yaml. Exit code: 0 saved, 1 nothing was observable, 2 wrong file or argument."
)


def parser() -> argparse.ArgumentParser:
    usage = "./calibrate_mount --from BAG|FOLDER --out FILE.yaml [options]"
    p = OneLineParser(prog="./calibrate_mount", usage=usage, description=_DESCRIPTION, epilog=_EPILOG)
    p.add_argument("--from", dest="recording", type=Path, required=True, metavar="BAG|FOLDER", help="a bag, or a folder of bags")
    p.add_argument("--out", type=Path, required=True, metavar="FILE.yaml", help="the calibration to write")
    add_raw_arguments(p)
    return p


def places_of(sweeps: RawSweeps) -> list[Place]:
    """Where the robot stood during a whole sweep; the others are told of. ValueError when nothing becomes a sweep."""
    found: list[Place] = []
    for number, measured in enumerate(sweeps.measured(), start=1):
        if isinstance(measured, Unreadable):
            say(f"sweep {number}: {measured.reason}: left out")
        elif measured.sweep.place is None:
            say(f"sweep {number}: the robot moved, or a lidar spins there: left out")
        else:
            found.append(measured.sweep.place)
            say(f"sweep {number}: the robot stood")
    return found


def _read_files(recording: Path, bags: Sequence[Path], robot_file: Path | None, body: RobotBody) -> Iterator[Path]:
    """Everything that a calibration reads."""
    for bag in bags:
        yield bag
        yield from bag.iterdir() if bag.is_dir() else ()
    path = robot_file or (recording if recording.is_dir() else recording.parent) / ROBOT_FILE
    yield from (path, path.parent / DESCRIPTION, urdf_file(body))


def calibrate(a: argparse.Namespace) -> int:
    """The exit code of a run; ArgumentProblem for code 2."""
    if not a.recording.exists():
        raise ArgumentProblem(f"{a.recording}: no such bag or folder")
    bags = bags_of(a.recording)
    if not bags:
        raise ArgumentProblem(f"{a.recording}: no bag in this folder")
    robot = robot_of(a.recording, a.robot, "")
    check_folder("--out", a.out.parent)
    check_not_read("--out", a.out, _read_files(a.recording, bags, a.robot, robot.body))
    try:
        sweeps = RawSweeps(Recording(bags, unread_of(a.recording)), raw_topics(a), robot, SensorConfig())
        places = places_of(sweeps)
    except (ValueError, OSError) as error:
        raise ArgumentProblem(f"{a.recording}: {error}") from error
    for note in (*sweeps.notes, *([sweeps.problem] if sweeps.problem else [])):
        say(note)
    return _saved(places, sweeps, robot.body, a.out)


def _saved(places: Sequence[Place], sweeps: RawSweeps, robot: RobotBody, out: Path) -> int:
    if not places:
        say("nothing is observable: in every sweep the robot moved; let it stand while the mount turns")
        return 1
    found = estimate_mount(joined_places(places), sweeps.mount, MountCalibrationConfig(), robot)
    print(estimate_table(found), flush=True)
    if not found.calibration.measured.any():
        say("nothing is observable here: record it in a room, on level ground")
        return 1
    try:
        write_calibration(found.calibration, out)
    except OSError as error:
        raise ArgumentProblem(f"--out {out}: not written: {error.strerror}") from error
    print(f"saved to {out}", flush=True)
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """Exit code for arguments, sys.argv's by default."""
    words = list(sys.argv[1:] if argv is None else argv)
    return code_of("calibrate_mount", lambda: calibrate(parser().parse_args(["--help"] if {"-h", "--help"} & set(words) else words)))


if __name__ == "__main__":
    sys.exit(main())
