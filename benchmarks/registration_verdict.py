"""Is a match's own verdict true? Thousands of matches, half of them wrong on purpose: false accepts, and how many right ones are kept.

    python benchmarks/registration_verdict.py [--matches 2000] [--kinds turned slid] [--seed 1] [--json FILE] [--only turned/17]

With PYTHONPATH as benchmarks/README.md sets it. The right ones start from guesses drawn with sigmas of 5 deg and 0.3 m, which the match is
told. Of the wrong ones nothing is claimed that is not true: mostly nothing at all. A false accept is a usable result more than 20 cm or
3 deg off in the directions that it holds, or any usable one where there is no truth. Exit code 1 when there was one.
"""

import argparse
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from registration_cases import SWEEPS_A_DRIVE, Case, case_of
from registration_scores import (
    Guess,
    Outcome,
    claimed_covariance,
    describe,
    disturbed,
    judged,
    matcher_parser,
    normal_guess,
    share,
    text_table,
    write_json,
)
from registration_worlds import BUILT_IN, CORRIDORS, MOVED

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.matching import Registration, Verdict
from pose_graph_mapping.registration.methods import create_registration
from rigid_geometry import rotation_from_rpy, rpy_from_rotation

Array = NDArray[np.float64]

PAIRS, OFFICES, OFFICE_SWEEPS = 40, 20, 4
YAW_SIGMA_RAD, SHIFT_SIGMA_M = math.radians(5.0), 0.3
BEYOND_M = (4.5, 6.5)  # a match looks 3 m around a guess of which nothing is claimed, and farther in the corners of that square
HEADER = ("kind", "matches", "accepted", "degenerate", "ambiguous", "refused", "false accepts", "kept %", "within 5 cm %", "median ms")


@dataclass(frozen=True, eq=False)
class Trial:
    """A match to be made; T_true is None where no placement is right."""

    case: Case
    guess: Guess
    T_true: Array | None


class Source(Protocol):
    """Where cases come from: the k-th of a world, of drives of so many sweeps."""

    def __call__(self, world: str, k: int, sweeps: int = SWEEPS_A_DRIVE) -> Case: ...


Maker = Callable[[Source, np.random.Generator, int], Trial]


def right(world: str) -> Maker:
    """A sweep and the map before it, from a good guess."""

    def make(source: Source, rng: np.random.Generator, k: int) -> Trial:
        case = source(world, k % PAIRS)
        return Trial(case, normal_guess(rng, case.T_map_base, YAW_SIGMA_RAD, SHIFT_SIGMA_M), case.T_map_base)

    return make


def furniture(source: Source, rng: np.random.Generator, k: int) -> Trial:
    """One thing stands elsewhere than when the map was made; the match is right all the same."""
    world = BUILT_IN[k % 2]
    before, now = source(world, k // 2 % PAIRS), source(world + MOVED, k // 2 % PAIRS)
    case = Case(now.name, now.world, before.reference, now.reading, now.T_map_base)
    return Trial(case, normal_guess(rng, case.T_map_base, YAW_SIGMA_RAD, SHIFT_SIGMA_M), case.T_map_base)


def elsewhere(here: Case, there: Case, rng: np.random.Generator) -> Trial:
    """The reading of `there` against the map of `here`, from anywhere near where that map's robot stood."""
    roll, pitch, _ = rpy_from_rotation(there.T_map_base[:3, :3])
    T_guess = here.T_map_base.copy()
    T_guess[:3, :3] = rotation_from_rpy(roll, pitch, rng.uniform(-math.pi, math.pi))
    T_guess[:2, 3] += rng.uniform(-1.0, 1.0, 2)
    case = Case(f"{there.name} in {here.name}", there.world, here.reference, there.reading, T_guess)
    return Trial(case, Guess(T_guess, None), None)


def other_world(source: Source, rng: np.random.Generator, k: int) -> Trial:
    """A sweep of another world; of the first two drives each, which fit the memory."""
    here, there = rng.permutation([*BUILT_IN, *CORRIDORS[:1]])[:2]
    return elsewhere(source(here, int(rng.integers(20))), source(there, int(rng.integers(20))), rng)


def other_room(source: Source, rng: np.random.Generator, k: int) -> Trial:
    """A sweep of another room of the same kind."""
    here, there = rng.permutation(OFFICES)[:2] * (OFFICE_SWEEPS - 1) + rng.integers(OFFICE_SWEEPS - 1, size=2)
    return elsewhere(source("office", int(here), sweeps=OFFICE_SWEEPS), source("office", int(there), sweeps=OFFICE_SWEEPS), rng)


def other_ground(source: Source, rng: np.random.Generator, k: int) -> Trial:
    """A sweep of other ground within the same four walls."""
    here, there = rng.permutation(PAIRS // 10)[:2] * 10 + rng.integers(10, size=2)
    return elsewhere(source("moon", int(here)), source("moon", int(there)), rng)


def out_of_window(source: Source, rng: np.random.Generator, k: int) -> Trial:
    """A guess so far off that the truth lies where no match looks."""
    case = source(BUILT_IN[k % 3], k // 3 % PAIRS)
    bearing, radius = rng.uniform(-math.pi, math.pi), rng.uniform(*BEYOND_M)
    shift = np.array([radius * math.cos(bearing), radius * math.sin(bearing), rng.normal(0.0, 0.1)])
    return Trial(case, Guess(disturbed(case.T_map_base, rng.uniform(-math.pi, math.pi), shift, np.zeros(2)), None), case.T_map_base)


def slid(source: Source, rng: np.random.Generator, k: int) -> Trial:
    """Along a corridor by 1 to 3 m: every other one is told sigmas of 5 deg and 2 m, the rest nothing."""
    case = source(CORRIDORS[k // 2 % 2], k // 4 % (PAIRS // 2))
    shift = rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 3.0) * np.array([1.0, 0.0, 0.0])
    T_guess = disturbed(case.T_map_base, rng.normal(0.0, YAW_SIGMA_RAD), shift, np.zeros(2))
    return Trial(case, Guess(T_guess, claimed_covariance(T_guess, YAW_SIGMA_RAD, 2.0) if k % 2 else None), case.T_map_base)


def turned(source: Source, rng: np.random.Generator, k: int) -> Trial:
    """Facing the other way in a corridor, as far as the guess goes."""
    case = source(CORRIDORS[k % 2], k // 2 % (PAIRS // 2))
    yaw = math.pi + rng.normal(0.0, YAW_SIGMA_RAD)
    return Trial(case, Guess(disturbed(case.T_map_base, yaw, rng.normal(0.0, 0.3, 3) * [1, 1, 0.1], np.zeros(2)), None), case.T_map_base)


RIGHT: dict[str, tuple[int, Maker]] = {
    "rooms": (220, right("rooms")),
    "ramp": (220, right("ramp")),
    "moon": (220, right("moon")),
    "corridor": (110, right("corridor")),
    "corridor_features": (110, right("corridor_features")),
    "furniture": (120, furniture),
}
WRONG: dict[str, tuple[int, Maker]] = {
    "other_world": (200, other_world),
    "other_room": (200, other_room),
    "other_ground": (100, other_ground),
    "out_of_window": (300, out_of_window),
    "slid": (100, slid),
    "turned": (100, turned),
}
KINDS = RIGHT | WRONG
"""Of 2,000 matches so many, and how they are made."""


def outcome_of(matcher: Registration, kind: str, k: int, options: argparse.Namespace) -> Outcome:
    """The k-th match of a kind; it depends on the seed, the kind and k alone."""

    def source(world: str, k: int, sweeps: int = SWEEPS_A_DRIVE) -> Case:
        return case_of(world, k, options.mount, options.cache, sweeps)

    trial = KINDS[kind][1](source, np.random.default_rng([options.seed, k, *kind.encode()]), k)
    return judged(f"{kind}/{k} ({trial.case.name})", matcher, trial.case, trial.guess, trial.T_true)[0]


def halves(found: Mapping[str, Sequence[Outcome]]) -> list[str]:
    """What is asked of a verdict, in a line each: right ones that are kept, in corridors and elsewhere, and false accepts."""
    groups = {
        "right ones kept": list(RIGHT),
        ".. in corridors": list(CORRIDORS),
        ".. elsewhere": [kind for kind in RIGHT if kind not in CORRIDORS],
    }
    lines = []
    for what, kinds in groups.items():
        outcomes = [o for kind in kinds for o in found.get(kind, [])]
        kept = [o.usable and not o.far_off for o in outcomes]
        lines += [f"{what}: {share(kept):.1f} %, {sum(kept)} of {len(kept)}"] if kept else []
    for what, kinds in (("right", list(RIGHT)), ("wrong on purpose", list(WRONG))):
        false = [o.far_off for kind in kinds for o in found.get(kind, [])]
        lines += [f"false accepts among those {what}: {sum(false)} of {len(false)}"] if false else []
    return lines


def row(kind: str, outcomes: Sequence[Outcome]) -> list[object]:
    """A line of the table; nothing is to be kept of what is wrong on purpose, although the truth may be found."""
    counts = [sum(o.verdict is verdict for o in outcomes) for verdict in (Verdict.ACCEPTED, Verdict.DEGENERATE, Verdict.AMBIGUOUS)]
    counts += [sum(o.verdict is Verdict.REFUSED for o in outcomes), sum(o.far_off for o in outcomes)]
    kept = [share([o.usable and not o.far_off for o in outcomes]), share([o.right for o in outcomes])] if kind in RIGHT else ["-", "-"]
    return [kind, len(outcomes), *counts, *kept, float(np.median([o.milliseconds for o in outcomes]))]


def parsed() -> argparse.Namespace:
    parser = matcher_parser(__doc__)
    parser.add_argument("--matches", type=int, default=2000, metavar="N", help="of all kinds together, in fixed shares")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS), metavar="KIND", help=", ".join(KINDS))
    parser.add_argument("--only", metavar="KIND/K", help="one match again")
    return parser.parse_args()


def main() -> int:
    options = parsed()
    matcher = create_registration(RegistrationConfig(method=options.method))
    if options.only:
        kind, _, k = options.only.partition("/")
        print(describe(outcome_of(matcher, kind, int(k), options)))
        return 0
    found: dict[str, list[Outcome]] = {}
    for kind in options.kinds:
        found[kind] = [outcome_of(matcher, kind, k, options) for k in range(math.ceil(KINDS[kind][0] * options.matches / 2000))]
        print(f"{kind}: {sum(o.far_off for o in found[kind])} false accepts of {len(found[kind])}", file=sys.stderr, flush=True)
    everything = [o for outcomes in found.values() for o in outcomes]
    lost = [o for kind, outcomes in found.items() if kind in RIGHT for o in outcomes if not o.usable]
    false = [o for o in everything if o.far_off]
    print("\n".join(["Right ones that were lost:", *map(describe, lost), "", "False accepts:", *map(describe, false), ""]))
    rows = [row(kind, outcomes) for kind, outcomes in found.items()]
    print(text_table(HEADER, rows))
    print("\n".join(["", *halves(found)]))
    write_json(options.json, {"rows": [dict(zip(HEADER, r, strict=True)) for r in rows], "matches": [asdict(o) for o in everything]})
    return int(bool(false))


if __name__ == "__main__":
    sys.exit(main())
