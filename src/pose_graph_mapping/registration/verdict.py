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
from pose_graph_mapping.registration.explanation import OVERLAP_DISTANCE_M, SAME_PLANE_COS, Noise
from pose_graph_mapping.registration.match_quality import Degeneracy
from pose_graph_mapping.registration.matching import RegistrationResult, Verdict

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Fit:
    """How a placed reading lies on the reference.

    near (N,): its points near a reference point that faces the same way; level (N,): those of them on one plane with it; off_m (N,): how
    far points lie off that plane; noise: what the worse of both clouds shows of its own.
    """

    near: Mask
    level: Mask
    off_m: Array
    noise: Noise

    @property
    def overlap(self) -> float:
        """Share of the reading that is near."""
        return float(np.mean(self.near))

    def misfit(self, most_m: float) -> float:
        """Share of the level points that lie farther off the reference's surface; 0 where there are none."""
        return float(np.mean(self.off_m[self.level] > most_m)) if self.level.any() else 0.0

    def on_surface(self, config: RegistrationConfig) -> Mask:
        """(N,) which level points lie on the reference's surface, as far as the clouds' own noise tells."""
        return np.asarray(self.level & (self.off_m <= tolerance(self.noise, config)))


def tolerance(noise: Noise, config: RegistrationConfig) -> float:
    """How far (m) off a surface a point of it may lie, where the clouds show so much noise of their own."""
    return max(config.misfit_m, config.misfit_noise * noise.within_m)


def fit_of(placed: PointCloud, at: Array, normals: Array, squared: Array, is_sided: bool, noise: Noise) -> Fit:
    """Of a reading placed in the reference, `at` (N, 3) the reference point nearest to each of its points, with `normals` (N, 3).

    `squared` (N,) distances between them. `is_sided`: the normals of both point to the side that was seen. `noise`: see `Fit`.
    """
    assert placed.normals is not None
    cosine = np.einsum("ij,ij->i", normals, placed.normals)
    cosine = cosine if is_sided else np.abs(cosine)
    near = (squared <= OVERLAP_DISTANCE_M**2) & (cosine >= 0.0)
    off_m = np.abs(np.einsum("ij,ij->i", normals, placed.points - at))
    return Fit(near, near & (cosine > SAME_PLANE_COS), off_m, noise)


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
    misfit = fit.misfit(config.misfit_m)
    most = max(config.max_misfit, config.max_misfit_ratio * fit.noise.misfit)
    if misfit > most:
        return Verdict.REFUSED, (
            f"{100 * misfit:.1f} % of the overlapping points lie {100 * config.misfit_m:.1f} cm and more off the surface, "
            f"{_above(misfit, 'max_misfit' if most == config.max_misfit else 'max_misfit_ratio of its own', most)}"
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
    return Verdict.ACCEPTED, f"overlap {fit.overlap:.2f}, misfit {100 * misfit:.1f} %, contradiction {100 * contradiction:.2f} %"


@dataclass(frozen=True)
class Explained:
    """`least_explained` of the points that were compared, and of the whole reading, with what lies where nothing was seen; how many
    different surfaces agree.
    """

    compared: float
    reading: float
    surfaces: float


def least_surfaces(config: RegistrationConfig, is_guess_known: bool) -> float:
    """That have to agree: twin rooms share few. A guess that is known says that the truth is near it, and so no twin is asked about."""
    return 0.0 if is_guess_known else config.min_surfaces


def may_have_changed(result: RegistrationResult, is_guess_known: bool, config: RegistrationConfig) -> bool:
    """Whether a refused placement may be right although things moved: enough overlaps, all directions are held, little is contradicted."""
    return (
        config.verdict == "checked"
        and not len(result.degenerate_directions)
        and result.overlap >= least_overlap(config, is_guess_known)
        and result.free_space_contradiction <= config.max_changed
    )


def judged_despite_changes(
    result: RegistrationResult, explained: Explained, rival: float, is_guess_known: bool, config: RegistrationConfig
) -> RegistrationResult:
    """A refused result accepted where all directions are explained, and by no other placement nearly as well; else with that reason too.

    `rival`: the most of the reading that another placement explains.
    """
    least = least_surfaces(config, is_guess_known)
    agreeing, surfaces, share = explained.compared, explained.surfaces, rival / max(explained.reading, 1e-9)
    if agreeing < config.min_explained:
        said = f"of what holds each motion {agreeing:.2f} agrees, {_below(agreeing, 'min_explained', config.min_explained)}"
        return replace(result, reason=f"{result.reason}; {said}")
    if surfaces < least:
        said = f"{surfaces:.0f} different surfaces agree, {_below(surfaces, 'min_surfaces', least)}"
        return replace(result, reason=f"{result.reason}; {said}")
    if share > config.max_rival_share:
        said = f"another placement explains {share:.2f} of what this one does, {_above(share, 'max_rival_share', config.max_rival_share)}"
        return replace(result, reason=f"{result.reason}; {said}")
    changed = f"overlap {result.overlap:.2f}, {100 * result.free_space_contradiction:.1f} % of the points changed"
    agree = f"{surfaces:.0f} surfaces and {agreeing:.2f} of what holds each motion agree"
    rest = f"the next placement explains {share:.2f} of what this one does"
    return replace(result, verdict=Verdict.ACCEPTED, reason=f"{changed}; {agree}, {rest}")


def _above(value: float, name: str, most: float) -> str:
    times = f"{value / most:.1f} times" if most > 0.0 else "above"
    return f"{times} {name} = {most:g}"


def _below(value: float, name: str, least: float) -> str:
    return f"{value / least:.2f} times {name} = {least:g}"  # least is not 0, for nothing is below that
