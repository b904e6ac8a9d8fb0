"""From how far off a sweep is matched to its map: right, refused, ambiguous, wrong by world and error of the guess; and how long it takes.

    python benchmarks/registration_basin.py [--worlds rooms ramp moon] [--classes 20 45 90 180] [--pairs 40] [--seed 1] [--json FILE]

With PYTHONPATH as benchmarks/README.md sets it. A class is the largest yaw error in degrees; with it goes the largest shift: 0.5, 1.5, 1.5
and 3 m. Up to 45 deg the match is told the covariance of the guess, beyond it nothing. Right: usable, and under 5 cm and 0.5 deg off in the
directions that the match holds. Wrong is whatever was usable and not right; far off, of those, more than 20 cm or 3 deg.
--only ramp/2/5 --classes 45 runs one case again. Exit code 1 when anything was wrong.
"""

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict

import numpy as np
from registration_cases import Case, case_of
from registration_scores import Guess, Outcome, describe, judged, matcher_parser, share, text_table, uniform_guess, write_json
from registration_worlds import BUILT_IN, CORRIDORS

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.matching import Registration, Verdict
from pose_graph_mapping.registration.methods import create_registration

SHIFT_M = {20: 0.5, 45: 1.5, 90: 1.5, 180: 3.0}
CLAIMED_UP_TO_DEG = 45
HEADER = ("world", "yaw deg", "shift m", "pairs", "right %", "refused %", "ambiguous %", "wrong %", "far off %", "median ms", "95 % ms")


def guess_of(case: Case, degrees: int, seed: int) -> Guess:
    """The guess of one case in one class; it depends on the seed, the class and the case alone."""
    rng = np.random.default_rng([seed, degrees, *case.name.encode()])
    return uniform_guess(rng, case.T_map_base, math.radians(degrees), SHIFT_M[degrees], claimed=degrees <= CLAIMED_UP_TO_DEG)


def outcome_of(matcher: Registration, case: Case, degrees: int, seed: int) -> Outcome:
    """One case in one class."""
    return judged(f"{case.name} at {degrees} deg", matcher, case, guess_of(case, degrees, seed), case.T_map_base)[0]


def row(world: str, degrees: int, outcomes: Sequence[Outcome]) -> list[object]:
    """A line of the table."""
    times = [o.milliseconds for o in outcomes]
    shares = [
        share([o.right for o in outcomes]),
        share([o.verdict is Verdict.REFUSED for o in outcomes]),
        share([o.verdict is Verdict.AMBIGUOUS for o in outcomes]),
        share([o.wrong for o in outcomes]),
        share([o.far_off for o in outcomes]),
    ]
    return [world, degrees, SHIFT_M[degrees], len(outcomes), *shares, float(np.median(times)), float(np.percentile(times, 95))]


def parsed() -> argparse.Namespace:
    parser = matcher_parser(__doc__)
    parser.add_argument("--worlds", nargs="+", default=[*BUILT_IN, *CORRIDORS], help="default: all, corridors with half of the pairs")
    parser.add_argument("--classes", nargs="+", type=int, choices=SHIFT_M, default=list(SHIFT_M), metavar="DEG")
    parser.add_argument("--pairs", type=int, default=40, metavar="N")
    parser.add_argument("--only", metavar="CASE", help="one case, as world/drive/sweep")
    return parser.parse_args()


def cases_of(world: str, options: argparse.Namespace) -> list[Case]:
    """The cases of one world that were asked for."""
    pairs = math.ceil(options.pairs / 2) if world in CORRIDORS else options.pairs
    return [case_of(world, k, options.mount, options.cache) for k in range(pairs)]


def one_case(name: str, options: argparse.Namespace) -> Case:
    world, drive, sweep = name.split("/")
    return case_of(world, (int(drive) - 1) * 10 + int(sweep) - 1, options.mount, options.cache)


def main() -> int:
    options = parsed()
    matcher = create_registration(RegistrationConfig(method=options.method))
    worlds = [options.only.split("/")[0]] if options.only else options.worlds
    rows, everything, warm = [], [], False
    for world in worlds:
        cases = [one_case(options.only, options)] if options.only else cases_of(world, options)
        if not warm:
            outcome_of(matcher, cases[0], options.classes[0], options.seed)
            warm = True
        for degrees in options.classes:
            outcomes = [outcome_of(matcher, case, degrees, options.seed) for case in cases]
            rows.append(row(world, degrees, outcomes))
            everything += outcomes
            print(f"{world}, {degrees} deg: {rows[-1][4]:.0f} % right", file=sys.stderr, flush=True)
    print("\n".join(describe(o) for o in everything if options.only or not o.right))
    print(text_table(HEADER, rows))
    write_json(options.json, {"rows": [dict(zip(HEADER, r, strict=True)) for r in rows], "matches": [asdict(o) for o in everything]})
    return int(any(o.wrong for o in everything))


if __name__ == "__main__":
    sys.exit(main())
