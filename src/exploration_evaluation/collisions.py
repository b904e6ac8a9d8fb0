"""What the robot touched, and whether somebody watched all the time; for `run_folder`."""

from pathlib import Path

import numpy as np

from exploration_evaluation.run_files import Trajectory, read_contacts

NO_COLLISION_SCORES: dict[str, object] = dict.fromkeys(("collisions", "collision_top_speed_mps", "collision_top_force_n"))
_UNWATCHED_S = 0.5  # longest step between true poses that were watched: a monitor that starts again in lock-step loses 0.3 s
_ROUNDING_S = 1e-3  # of a stamp in the file


def collision_scores(folder: Path, truth: Trajectory | None) -> dict[str, object]:
    """How many collisions, and the top speed and force of all; where some may be missed, those that were seen.

    ValueError when contacts.csv cannot be read, or tells of none while nobody watched: the true poses, which are written beside the
    contacts, come at every tick of the clock.
    """
    episodes = read_contacts(folder / "contacts.csv")
    away_s = 0.0 if truth is None else float(np.diff(truth[0]).max(initial=0.0))
    if not episodes and away_s > _UNWATCHED_S + _ROUNDING_S:
        raise ValueError(f"nobody watched for {away_s:.2f} s of the run")
    return {
        "collisions": len(episodes),
        "collision_top_speed_mps": max((e.top_speed_mps for e in episodes), default=None),
        "collision_top_force_n": max((e.top_force_n for e in episodes), default=None),
    }
