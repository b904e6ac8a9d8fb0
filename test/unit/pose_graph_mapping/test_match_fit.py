"""How a placed reading lies on the reference, and what the verdict makes of it, on flat grids of points."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.cloud import PointCloud
from pose_graph_mapping.registration.match_quality import Degeneracy, Fit, fit_of, judge
from pose_graph_mapping.registration.matching import Verdict

CONFIG = RegistrationConfig()
UP = np.array([0.0, 0.0, 1.0])
HELD = Degeneracy(np.ones(6), np.zeros((0, 6)))


def fit(heights: NDArray[np.float64], normal: NDArray[np.float64] = UP, is_sided: bool = True) -> Fit:
    """Of points in a row at these heights over a reference at height 0 that was seen from above."""
    at = np.stack([0.1 * np.arange(len(heights)), np.zeros(len(heights)), np.zeros(len(heights))], axis=1)
    placed = PointCloud(at + heights[:, None] * UP, None, np.tile(normal, (len(heights), 1)))
    return fit_of(placed, at, np.tile(UP, (len(heights), 1)), heights**2, is_sided, CONFIG)


def test_share_that_is_off_counts_what_overlaps_only() -> None:
    found = fit(np.array([0.0, 0.01, -0.04, 0.06, 0.5]))
    assert found.overlap == pytest.approx(0.8) and found.misfit == pytest.approx(0.25)


def test_other_side_of_a_thin_wall_is_no_overlap() -> None:
    assert fit(np.full(4, 0.1), -UP) == Fit(0.0, 0.0)
    assert fit(np.full(4, 0.1), -UP, is_sided=False) == Fit(1.0, 1.0)


def test_surfaces_across_each_other_overlap_and_are_not_compared() -> None:
    assert fit(np.full(4, 0.1), np.array([1.0, 0.0, 0.0])) == Fit(1.0, 0.0)


@pytest.mark.parametrize(
    ("found", "covers_truth", "verdict"),
    [
        (Fit(0.3, 0.02), True, Verdict.ACCEPTED),
        (Fit(0.3, 0.02), False, Verdict.REFUSED),
        (Fit(0.6, 0.02), False, Verdict.ACCEPTED),
        (Fit(0.9, 0.20), True, Verdict.REFUSED),
        (Fit(0.1, 0.0), True, Verdict.REFUSED),
    ],
)
def test_verdict(found: Fit, covers_truth: bool, verdict: Verdict) -> None:
    assert judge(0.9, found, 0.001, HELD, CONFIG, covers_truth)[0] is verdict


def test_least_overlap_of_an_unknown_guess_is_never_the_lower_one() -> None:
    config = RegistrationConfig(min_overlap=0.7, min_overlap_unguided=0.5)
    assert judge(0.9, Fit(0.6, 0.0), 0.001, HELD, config, False)[0] is Verdict.REFUSED
