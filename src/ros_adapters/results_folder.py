"""The folder that a node writes its results into."""

import sys
import time
from pathlib import Path

import rospy

from whole_files import refusal

_BEGUN_S = time.time()


def holds_earlier_session(folder: Path) -> bool:
    """Whether sweeps are there that were on disk before this process began."""
    index = folder / "sweeps/index.json"
    return index.is_file() and index.stat().st_mtime < _BEGUN_S


def results_folder(node: str) -> Path | None:
    """The folder of ~out, made when it is not there; None when nothing is to be written.

    One that cannot be made ends the node with exit code 2, as does that of the finished map in which a robot is only localised.
    """
    out, finished = (str(rospy.get_param(name, "")) for name in ("~out", "finished_map"))
    if not out:
        return None
    if finished and Path(finished).resolve() == Path(out).resolve():
        sys.stderr.write(f"{node}: wrong parameter: out {out} is the finished map, which stays as it is: name another folder\n")
        sys.exit(2)
    try:
        Path(out).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        sys.stderr.write(f"{node}: wrong parameter: out {refusal(error, Path(out))}\n")
        sys.exit(2)
    return Path(out)
