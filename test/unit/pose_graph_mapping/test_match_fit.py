"""How a placed reading lies on the reference, and what the verdict makes of it, on flat grids of points."""

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.cloud import PointCloud
from pose_graph_mapping.registration.explanation import Noise
from pose_graph_mapping.registration.match_quality import Degeneracy
from pose_graph_mapping.registration.matching import RegistrationResult, Verdict, refused
from pose_graph_mapping.registration.verdict import Explained, Fit, fit_of, judge, judged_despite_changes, may_have_changed, tolerance

CONFIG = RegistrationConfig()
UP = np.array([0.0, 0.0, 1.0])
HELD = Degeneracy(np.ones(6), np.zeros((0, 6)))


def fit(heights: NDArray[np.float64], normal: NDArray[np.float64] = UP, is_sided: bool = True, noise_m: float = 0.0) -> Fit:
    """Of points in a row at these heights over a reference at height 0 that was seen from above."""
    at = np.stack([0.1 * np.arange(len(heights)), np.zeros(len(heights)), np.zeros(len(heights))], axis=1)
    placed = PointCloud(at + heights[:, None] * UP, None, np.tile(normal, (len(heights), 1)))
    return fit_of(placed, at, np.tile(UP, (len(heights), 1)), heights**2, is_sided, Noise(noise_m, 0.0))


def shares(overlap: float, misfit: float, own_misfit: float = 0.0) -> Fit:
    """Of 10,000 points of which so many overlap, and so many of those are off."""
    count = np.arange(10_000) / 10_000
    near, off = count < overlap, count < overlap * misfit
    return Fit(near, near, np.where(off, 2.0, 0.5) * CONFIG.misfit_m, Noise(0.0, own_misfit))


def test_share_that_is_off_counts_what_overlaps_only() -> None:
    found = fit(np.array([0.0, 0.01, -0.04, 0.06, 0.5]))
    assert found.overlap == pytest.approx(0.8) and found.misfit(CONFIG.misfit_m) == pytest.approx(0.25)


def test_other_side_of_a_thin_wall_is_no_overlap() -> None:
    hidden, seen = fit(np.full(4, 0.1), -UP), fit(np.full(4, 0.1), -UP, is_sided=False)
    assert (hidden.overlap, hidden.misfit(0.05)) == (0.0, 0.0)
    assert (seen.overlap, seen.misfit(0.05)) == (1.0, 1.0)


def test_surfaces_across_each_other_overlap_and_are_not_compared() -> None:
    found = fit(np.full(4, 0.1), np.array([1.0, 0.0, 0.0]))
    assert (found.overlap, found.misfit(0.05)) == (1.0, 0.0)


def test_points_may_lie_off_by_what_their_own_clouds_show_and_never_have_to_lie_nearer_than_the_floor() -> None:
    heights = np.array([0.0, 0.06, 0.08, 0.1])
    assert tolerance(Noise(0.0, 0.0), CONFIG) == tolerance(Noise(CONFIG.misfit_m / CONFIG.misfit_noise, 0.0), CONFIG) == CONFIG.misfit_m
    assert fit(heights).on_surface(CONFIG).tolist() == [True, False, False, False]
    assert fit(heights, noise_m=0.09 / CONFIG.misfit_noise).on_surface(CONFIG).tolist() == [True, True, True, False]


@pytest.mark.parametrize(
    ("found", "covers_truth", "verdict"),
    [
        (shares(0.3, 0.02), True, Verdict.ACCEPTED),
        (shares(0.3, 0.02), False, Verdict.REFUSED),
        (shares(0.6, 0.02), False, Verdict.ACCEPTED),
        (shares(0.9, 0.14), True, Verdict.ACCEPTED),
        (shares(0.9, 0.16), True, Verdict.REFUSED),
        (shares(0.9, 0.19, own_misfit=0.1), True, Verdict.ACCEPTED),
        (shares(0.9, 0.21, own_misfit=0.1), True, Verdict.REFUSED),
        (shares(0.1, 0.0), True, Verdict.REFUSED),
    ],
)
def test_verdict(found: Fit, covers_truth: bool, verdict: Verdict) -> None:
    assert judge(0.9, found, 0.001, HELD, CONFIG, covers_truth)[0] is verdict


def test_least_overlap_of_an_unknown_guess_is_never_the_lower_one() -> None:
    config = RegistrationConfig(min_overlap=0.7, min_overlap_unguided=0.5)
    assert judge(0.9, shares(0.6, 0.0), 0.001, HELD, config, False)[0] is Verdict.REFUSED


@pytest.mark.parametrize(
    ("found", "contradiction", "said"),
    [
        (shares(0.15, 0.0), 0.0, "overlap 0.15 is below min_overlap = 0.2 by 0.05"),
        (shares(0.9, 0.3), 0.0, "30.0 % of the overlapping points lie 5.0 cm and more off the surface, 2.0 times max_misfit = 0.15"),
        (shares(0.9, 0.0), 0.03, "3.00 % of the points lie in space seen free, 2.5 times max_contradiction = 0.012"),
    ],
)
def test_refusal_names_the_limit_and_by_how_much_it_is_broken(found: Fit, contradiction: float, said: str) -> None:
    assert judge(0.9, found, contradiction, HELD, CONFIG, True) == (Verdict.REFUSED, said)


def refusal(overlap: float = 0.8, contradiction: float = 0.07, directions: int = 0) -> RegistrationResult:
    numbers = {"overlap": overlap, "free_space_contradiction": contradiction, "degenerate_directions": np.zeros((directions, 6))}
    return dataclasses.replace(refused(np.eye(4), "too much moved"), **numbers)


def test_only_what_overlaps_is_held_and_mostly_uncontradicted_may_be_right_after_things_moved() -> None:
    assert may_have_changed(refusal(), False, CONFIG)
    assert not may_have_changed(refusal(contradiction=1.05 * CONFIG.max_changed), False, CONFIG)
    assert not may_have_changed(refusal(contradiction=float("nan")), False, CONFIG)
    assert not may_have_changed(refusal(directions=1), False, CONFIG)
    assert may_have_changed(refusal(overlap=0.3), True, CONFIG) and not may_have_changed(refusal(overlap=0.3), False, CONFIG)


@pytest.mark.parametrize(
    ("explained", "rival", "verdict", "said"),
    [
        (Explained(0.6, 0.4, 40.0), 0.19, Verdict.ACCEPTED, "overlap 0.80, 7.0 % of the points changed; 40 surfaces"),
        (
            Explained(0.6, 0.4, 40.0),
            0.24,
            Verdict.REFUSED,
            "too much moved; another placement explains 0.60 of what this one does, 1.2 times",
        ),
        (
            Explained(0.4, 0.4, 40.0),
            0.0,
            Verdict.REFUSED,
            "too much moved; of what holds each motion 0.40 agrees, 0.80 times min_explained",
        ),
        (Explained(0.6, 0.4, 28.0), 0.0, Verdict.REFUSED, "too much moved; 28 different surfaces agree, 0.80 times min_surfaces = 35"),
        (Explained(0.6, 0.0, 40.0), 0.1, Verdict.REFUSED, "too much moved; another placement"),
    ],
)
def test_changes_are_forgiven_where_enough_agrees_in_every_motion_and_no_other_placement_explains_as_much(
    explained: Explained, rival: float, verdict: Verdict, said: str
) -> None:
    found = judged_despite_changes(refusal(), explained, rival, False, CONFIG)
    assert found.verdict is verdict and found.reason.startswith(said), found.reason
