"""How far the robot was from its start, by its true poses: at the farthest, and at the end.

For `run_folder` and its verdict: a robot that stayed explored nothing, and one that was to end at home has to.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from exploration_evaluation.run_files import Trajectory
from rigid_geometry import angle_difference, yaw_of


@dataclass(frozen=True)
class StartDistance:
    """Metres from the first pose, the most and those of the last; and by how many radians the last heading differs from the first."""

    farthest_m: float
    end_m: float
    end_rad: float

    @classmethod
    def of(cls, poses: NDArray[np.float64]) -> "StartDistance":
        """Of (K, 4, 4) poses of base_link in the world."""
        away_m = np.linalg.norm(poses[:, :3, 3] - poses[0, :3, 3], axis=1)
        return cls(float(away_m.max()), float(away_m[-1]), abs(angle_difference(yaw_of(poses[-1]), yaw_of(poses[0]))))


def start_scores(truth: Trajectory | None) -> dict[str, float | None]:
    """What the summary says of it; None where the true poses are not known."""
    start = None if truth is None else StartDistance.of(truth[1])
    return {"end_from_start_m": start.end_m if start else None, "end_from_start_rad": start.end_rad if start else None}
