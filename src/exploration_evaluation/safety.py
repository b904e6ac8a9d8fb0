"""Four areas that sum up a classified terrain against the true ground: what a bench compares.

After `classification` in the judge, whose definitions of wrongly safe and wrongly unsafe it shares; the table of classes is left out.
"""

from dataclasses import dataclass

from numpy.typing import ArrayLike

from exploration_evaluation.classification import EDGE, ClassificationConfig, judged_safety
from exploration_evaluation.true_classes import TrueClasses


@dataclass(frozen=True)
class TerrainSafety:
    """Areas in m2, seen from above, of a terrain that is taken at its word.

    wrongly_safe_beyond_m2: traversable voxels where the robot's centre may not be, farther than one voxel from the border of its places.
    wrongly_safe_within_m2: those within one voxel of that border. wrongly_unsafe_m2: mapped places of the centre, labelled obstacle,
    cliff or inflation. turning_m2: all places of the centre, mapped or not.
    """

    wrongly_safe_beyond_m2: float
    wrongly_safe_within_m2: float
    wrongly_unsafe_m2: float
    turning_m2: float

    @property
    def wrongly_unsafe_share(self) -> float:
        """Of all places of the centre, 0 to 1."""
        return self.wrongly_unsafe_m2 / self.turning_m2


def terrain_safety(
    true: TrueClasses, voxels_world: ArrayLike, labels: ArrayLike, config: ClassificationConfig | None = None
) -> TerrainSafety:
    """Judges (N, 3) centres of classified voxels, world frame, with (N,) labels; ValueError as `classification`."""
    safe, unsafe = judged_safety(true, voxels_world, labels, config)
    within = safe[EDGE]
    return TerrainSafety(
        wrongly_safe_beyond_m2=sum(area for cause, area in safe.items() if cause != EDGE),
        wrongly_safe_within_m2=within,
        wrongly_unsafe_m2=sum(unsafe.values()),
        turning_m2=len(true.places) * true.cell_area_m2,
    )
