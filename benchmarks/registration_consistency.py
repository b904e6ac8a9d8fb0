"""Is the covariance that a match claims true? The mean NEES of matches in simulated worlds, which is 6 where it is, with each mount.

    python benchmarks/registration_consistency.py [--worlds rooms ramp moon] [--mounts nominal off] [--pairs 40] [--first 0] [--repeats 2]
        [--json FILE]

With PYTHONPATH as benchmarks/README.md sets it. The normalised error squared of a usable match is e' C^-1 e, with e the logarithm of
inverse(T_true) @ T (rotation, translation; body frame) and C its covariance. Guesses are drawn with sigmas of 5 deg and 0.3 m, which the
match is told. Off: the tilt by 0.5 % and the mount's roll by 0.2 deg, in the map as in the reading. Covariances were chosen on pairs 0 to
19 of each world: those from 20 on tell more. Exit code 1 when the mean over a mount's worlds is not between 2 and 8.
"""

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from registration_cases import DEFAULT_CACHE, MOUNTS, Case, case_of
from registration_scores import body_error, normal_guess, share, text_table, write_json
from registration_worlds import BUILT_IN, CORRIDORS

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.matching import Registration
from pose_graph_mapping.registration.methods import create_registration

Array = NDArray[np.float64]

LOW, HIGH = 2.0, 8.0
YAW_SIGMA_RAD, SHIFT_SIGMA_M = math.radians(5.0), 0.3
HEADER = ("mount", "world", "matches", "usable %", "mean NEES", "median", "95 %", "rotation of 3", "translation of 3", "cm", "deg")


@dataclass(frozen=True)
class Consistency:
    """A match: its NEES over all six, and over rotation and translation alone; its error. NaN where the match was of no use."""

    case: str
    world: str
    mount: str
    nees: float = math.nan
    rotation: float = math.nan
    translation: float = math.nan
    metres: float = math.nan
    degrees: float = math.nan

    @property
    def usable(self) -> bool:
        return not math.isnan(self.nees)


def normalised(error: Array, covariance: Array) -> float:
    """e' C^-1 e."""
    return float(error @ np.linalg.solve(covariance, error))


def consistency_of(matcher: Registration, case: Case, mount: str, repeat: int) -> Consistency:
    """One match of a case; its guess depends on the case and the repeat alone."""
    guess = normal_guess(np.random.default_rng([repeat, *case.name.encode()]), case.T_map_base, YAW_SIGMA_RAD, SHIFT_SIGMA_M)
    result = matcher.match(case.reference, case.reading, guess.T_map_base, guess.covariance)
    if not result.usable:
        return Consistency(case.name, case.world, mount)
    error, covariance = body_error(case.T_map_base, result.T_reference_reading), result.covariance
    nees, rotation, translation = (normalised(error[k], covariance[k, k]) for k in (slice(0, 6), slice(0, 3), slice(3, 6)))
    metres, degrees = float(np.linalg.norm(error[3:])), math.degrees(float(np.linalg.norm(error[:3])))
    return Consistency(case.name, case.world, mount, nees, rotation, translation, metres, degrees)


def row(mount: str, world: str, found: Sequence[Consistency]) -> list[object]:
    """A line of the table; errors are root mean squares."""
    used = [c for c in found if c.usable]
    if not used:
        return [mount, world, len(found), 0.0, *["-"] * 7]
    nees = [c.nees for c in used]
    numbers = [float(np.mean(nees)), float(np.median(nees)), float(np.percentile(nees, 95))]
    numbers += [float(np.mean([c.rotation for c in used])), float(np.mean([c.translation for c in used]))]
    rms = [
        f"{scale * math.sqrt(np.mean(np.square(e))):.2f}" for scale, e in ((100, [c.metres for c in used]), (1, [c.degrees for c in used]))
    ]
    return [mount, world, len(found), share([c.usable for c in found]), *numbers, *rms]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", nargs="+", default=[*BUILT_IN, *CORRIDORS])
    parser.add_argument("--mounts", nargs="+", choices=MOUNTS, default=list(MOUNTS))
    parser.add_argument("--pairs", type=int, default=40, metavar="N", help="of a world, half as many of a corridor; default 40")
    parser.add_argument("--first", type=int, default=0, metavar="K", help="number of the first pair; default 0")
    parser.add_argument("--repeats", type=int, default=2, metavar="N", help="guesses a pair; default 2")
    parser.add_argument("--method", default=RegistrationConfig().method)
    parser.add_argument("--cache", type=Path, default=DEFAULT_CACHE, help="folder for sweeps, about 35 MB a drive of ten pairs")
    parser.add_argument("--json", type=Path, metavar="FILE", help="every match, for other programs")
    options = parser.parse_args()
    matcher = create_registration(RegistrationConfig(method=options.method))
    rows, everything, consistent = [], [], True
    for mount in options.mounts:
        found: list[Consistency] = []
        for world in options.worlds:
            for k in range(math.ceil(options.pairs / 2) if world in CORRIDORS else options.pairs):
                case = case_of(world, options.first + k, mount, options.cache)
                found += [consistency_of(matcher, case, mount, repeat) for repeat in range(options.repeats)]
            rows.append(row(mount, world, [c for c in found if c.world == world]))
            print(*map(str, rows[-1][:5]), file=sys.stderr, flush=True)
        rows.append(row(mount, "all", found))
        consistent &= LOW <= float(np.nanmean([c.nees for c in found])) <= HIGH
        everything += found
    print(text_table(HEADER, rows))
    write_json(options.json, {"rows": [dict(zip(HEADER, r, strict=True)) for r in rows], "matches": [asdict(c) for c in everything]})
    return int(not consistent)


if __name__ == "__main__":
    sys.exit(main())
