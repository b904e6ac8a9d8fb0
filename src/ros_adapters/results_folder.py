"""The folder that a node writes its results into."""

import sys
from pathlib import Path

import rospy


def results_folder(node: str) -> Path | None:
    """The folder of ~out, made when it is not there; None when nothing is to be written.

    That of the finished map in which a robot is only localised ends the node with exit code 2.
    """
    out, finished = (str(rospy.get_param(name, "")) for name in ("~out", "/finished_map"))
    if not out:
        return None
    if finished and Path(finished).resolve() == Path(out).resolve():
        sys.stderr.write(f"{node}: wrong parameter: out {out} is the finished map, which stays as it is: name another folder\n")
        sys.exit(2)
    Path(out).mkdir(parents=True, exist_ok=True)
    return Path(out)
