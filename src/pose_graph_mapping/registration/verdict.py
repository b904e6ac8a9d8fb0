"""Is a match right? The judgement that both registrations share, on overlap, misfit, two-way free space and degeneracy.

Overlap alone does not tell right from wrong; points that lie where the other cloud looked through do. How far points may lie off the
surface follows from the noise that the clouds show themselves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.cloud import Array, PointCloud
from pose_graph_mapping.registration.explanation import SAME_PLANE_COS
from pose_graph_mapping.registration.match_quality import Degeneracy
from pose_graph_mapping.registration.matching import RegistrationResult, Verdict

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Fit:
    """How a placed reading lies on the reference.

    near (N,): its points near a reference point that faces the same way; on, off (N,): those of them on one plane with it that lie within
    `tolerance_m` of that plane, and farther from it.
    """

    near: Mask
    on: Mask
    off: Mask
    tolerance_m: float

    @property
    def overlap(self) -> float:
        """Share of the reading that is near."""
        return float(np.mean(self.near))

    @property
    def misfit(self) -> float:
        """Share of the points that can be compared which lie off the reference's surface; 0 where there are none."""
        off, compared = np.count_nonzero(self.off), np.count_nonzero(self.on) + np.count_nonzero(self.off)
        return off / compared if compared else 0.0


def tolerance(noise_m: float, config: RegistrationConfig) -> float:
    """How far (m) off a surface a point of it may lie, where the clouds show so much noise of their own."""
    return max(config.misfit_m, config.misfit_noise * noise_m)


def fit_of(
    placed: PointCloud, at: Array, normals: Array, squared: Array, is_sided: bool, noise_m: float, config: RegistrationConfig
) -> Fit:
    """Of a reading placed in the reference, `at` (N, 3) the reference point nearest to each of its points, with `normals` (N, 3).

    `squared` (N,) distances between them. `is_sided`: the normals of both point to the side that was seen. `noise_m` of both clouds.
    """
    assert placed.normals is not None
    most = tolerance(noise_m, config)
    cosine = np.einsum("ij,ij->i", normals, placed.normals)
    cosine = cosine if is_sided else np.abs(cosine)
    near = (squared <= config.overlap_distance_m**2) & (cosine >= 0.0)
    level = near & (cosine > SAME_PLANE_COS)
    is_off = np.abs(np.einsum("ij,ij->i", normals, placed.points - at)) > most
    return Fit(near, level & ~is_off, level & is_off, most)


def least_overlap(config: RegistrationConfig, covers_truth: bool) -> float:
    """Of a match that may be right; `covers_truth`: whether the truth lies where the match looked."""
    return config.min_overlap if covers_truth else max(config.min_overlap, config.min_overlap_unguided)


def judge(
    ratio: float, fit: Fit, contradiction: float, weak: Degeneracy, config: RegistrationConfig, covers_truth: bool
) -> tuple[Verdict, str]:
    """Verdict and its reason, which of a refusal names the limit; what could not be checked is refused. `covers_truth`: `least_overlap`."""
    if config.verdict == "match_ratio":
        accepted = ratio >= config.min_match_ratio
        return (Verdict.ACCEPTED if accepted else Verdict.REFUSED), f"match ratio {ratio:.2f}, wanted {config.min_match_ratio}"
    least = least_overlap(config, covers_truth)
    if fit.overlap < least:
        name = "min_overlap" if covers_truth else "min_overlap_unguided"
        beside = "" if covers_truth else ", and the truth may lie where no match looked"
        return Verdict.REFUSED, f"overlap {fit.overlap:.2f} is below {name} = {least} by {least - fit.overlap:.2f}{beside}"
    if fit.misfit > config.max_misfit:
        return Verdict.REFUSED, (
            f"{100 * fit.misfit:.1f} % of the overlapping points lie {100 * fit.tolerance_m:.1f} cm and more off the surface, "
            f"{_above(fit.misfit, 'max_misfit', config.max_misfit)}"
        )
    if math.isnan(contradiction):
        return Verdict.REFUSED, "free space cannot be checked: no beam origins, or no common field of view"
    if contradiction > config.max_contradiction:
        return Verdict.REFUSED, (
            f"{100 * contradiction:.2f} % of the points lie in space seen free, "
            f"{_above(contradiction, 'max_contradiction', config.max_contradiction)}"
        )
    if len(weak.directions):
        return Verdict.DEGENERATE, f"{len(weak.directions)} directions are not held by the points"
    return Verdict.ACCEPTED, f"overlap {fit.overlap:.2f}, misfit {100 * fit.misfit:.1f} %, contradiction {100 * contradiction:.2f} %"


def _above(share: float, name: str, most: float) -> str:
    return f"{share / most:.1f} times {name} = {most}"


@dataclass(frozen=True)
class Explained:
    """`least_explained` of the points that were compared, and of the whole reading: what it lays where nothing was seen counts there."""

    compared: float
    reading: float


def may_have_changed(result: RegistrationResult, covers_truth: bool, config: RegistrationConfig) -> bool:
    """Whether a refused placement may be right although things moved: enough overlaps, all directions are held, little is contradicted."""
    return (
        config.verdict == "checked"
        and not len(result.degenerate_directions)
        and result.overlap >= least_overlap(config, covers_truth)
        and result.free_space_contradiction <= config.max_changed
    )


def judged_despite_changes(
    result: RegistrationResult, explained: Explained, rival: float, config: RegistrationConfig
) -> RegistrationResult:
    """A refused result accepted where all directions are explained, and by no other placement nearly as well; else with that reason too.

    `rival`: the most of the reading that another placement explains.
    """
    agreeing, share = explained.compared, rival / max(explained.reading, 1e-9)
    if agreeing < config.min_explained:
        least = config.min_explained
        said = f"of what holds each motion {agreeing:.2f} agrees, {agreeing / least:.2f} times min_explained = {least}"
        return replace(result, reason=f"{result.reason}; {said}")
    if share > config.max_rival_share:
        said = f"another placement explains {share:.2f} of what this one does, {_above(share, 'max_rival_share', config.max_rival_share)}"
        return replace(result, reason=f"{result.reason}; {said}")
    changed = f"overlap {result.overlap:.2f}, {100 * result.free_space_contradiction:.1f} % of the points changed"
    agrees = f"of what holds each motion {agreeing:.2f} agrees; the next placement explains {share:.2f} of what this one does"
    return replace(result, verdict=Verdict.ACCEPTED, reason=f"{changed}, {agrees}")
