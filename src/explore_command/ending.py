"""How a run ended: what died, a judgement where the monitor made none, and the exit code."""

import json
import re
import sys
from pathlib import Path

_DEATH = re.compile(r"\[(\w+?)(?:-\d+)?\](?: has died!\n| )process has died")
_BROKEN_OFF = re.compile(r"^interrupted|^node died|(died|was killed)$")
_KILLED = 128  # and the signal: the exit code of a launch that was killed


def cause_of_death(launch_code: int, log: str) -> str | None:
    """What died first, by roslaunch's exit code and all that it said, or None: "roslaunch was killed", "rosmaster died"."""
    if launch_code < 0:
        return "the keeper of roslaunch was killed"
    if launch_code > _KILLED:
        return "roslaunch was killed"
    found = _DEATH.search(log)
    return f"{found[1].replace('master', 'rosmaster')} died" if found else None


def is_broken_off(stop_reason: str) -> bool:
    """Whether a run ended because it was interrupted or something of it died, as the monitor or `cause_of_death` tells."""
    return bool(_BROKEN_OFF.search(stop_reason))


def ended(out: Path, launch_code: int, interrupted: bool, log: str) -> int:
    """Says what there is to say about a run whose processes have all ended; 0 when it succeeded, 2 for a wrong parameter, else 1.

    log: all that roslaunch said.
    """
    summary, has_begun = out / "summary.json", (out / "run.json").exists()
    cause = None if interrupted else cause_of_death(launch_code, log)
    if not summary.exists() and has_begun:
        from exploration_evaluation.ending import INTERRUPTED, judged_for_monitor  # loads numba: only when it is needed

        print(judged_for_monitor(out, cause or INTERRUPTED), flush=True)
    if summary.exists():
        if json.loads(summary.read_text()).get("success") is True:
            return 0
    elif not has_begun:
        wrong = [line for line in log.splitlines() if "wrong parameter" in line]
        print("\n".join(wrong or log.strip().splitlines()[-15:]), file=sys.stderr)
        if wrong:
            return 2
    if not summary.exists():
        cause = cause or "the run has no summary"
    if cause:
        print(f"./explore: {cause}; {_what_to_do(out)}", file=sys.stderr)
    return 1


def _what_to_do(out: Path) -> str:
    if (out / "sweeps").is_dir() and any((out / "sweeps").iterdir()):
        return f"what was mapped is in {out}, and ./explore --resume {out} goes on with it"
    return "nothing was mapped yet: start it again"
