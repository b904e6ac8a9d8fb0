"""Slopes: up, down, sideways, over a crest and through a valley. The robot drives 25 degrees, whichever way."""

from shape import (
    Expectation,
    Shape,
    Stand,
    frontier,
    no_cliff,
    no_frontier,
    no_path,
    not_traversable,
    obstacle,
    path,
    seen,
    traversable,
)
from shape_parts import GROUND, on_ground, rise_of, run_of, slope

WIDE = (-2.0, 2.0)


def _up(angle_deg: float, height: float = 1.0) -> Shape:
    """The foot at x = 1, a platform of 3 m behind the head; seen from before and, where it can be driven, from above."""
    head = 1.0 + run_of(height, angle_deg)
    solids = (GROUND, slope((1.0, head), (0.0, height), WIDE), on_ground((head, head + 3.0), WIDE, height))
    before = (Stand(-1.7, 0.0), Stand(0.2, 0.3))
    middle = ((1.0 + head) / 2, 0.0, height / 2)
    if angle_deg > 25.0:
        foot = obstacle((1.05, -1.5, 0.05), (1.0 + run_of(0.6, angle_deg), 1.5, 0.6))
        return seen(f"ramp up, {angle_deg:g} deg", solids, before, foot, no_path(middle), no_path((head + 1.2, 0.0, height)))
    return seen(
        f"ramp up, {angle_deg:g} deg",
        solids,
        (*before, Stand(*middle), Stand(head + 1.0, 0.0, height)),
        traversable((1.1, -1.0, 0.0), (head - 0.1, 1.0, height)),
        path((-1.5, 0.0, 0.0)),
        path((head + 2.0, 0.0, height)),
    )


def _first_look_up(angle_deg: float, height: float = 1.0) -> Shape:
    """What there is to say before anything was driven: the ramp can be gone up to."""
    head = 1.0 + run_of(height, angle_deg)
    return seen(
        f"ramp up, {angle_deg:g} deg, first look",
        (GROUND, slope((1.0, head), (0.0, height), WIDE), on_ground((head, head + 3.0), WIDE, height)),
        (Stand(-1.2, 0.0),),
        traversable((1.1, -0.7, 0.0), (2.0, 0.7, rise_of(1.0, angle_deg))),
        no_cliff((1.0, -1.5, 0.0), (2.5, 1.5, height)),
    )


def _down(angle_deg: float, height: float = 1.0) -> Shape:
    """From a platform, seen from above only; the head at x = 0."""
    foot = run_of(height, angle_deg)
    upper = min(1.6, foot - 0.2)
    solids = (GROUND, on_ground((-5.0, 0.0), WIDE, height), slope((0.0, foot), (height, 0.0), WIDE))
    stands = (Stand(-2.6, 0.0, height), Stand(-1.0, 0.2, height))
    low = height * (1.0 - upper / foot)
    expected: tuple[Expectation, ...] = (
        no_cliff((-0.3, -1.2, height - 0.2), (0.4, 1.2, height)),
        traversable((-0.3, -1.0, low), (upper, 1.0, height)),
        path((upper, 0.0, low)),
    )
    if angle_deg > 25.0:
        expected = (not_traversable((0.1, -1.5, 0.1), (foot, 1.5, height - 0.1)), no_path((foot + 1.2, 0.0, 0.0)))
    return seen(f"ramp down, {angle_deg:g} deg", solids, stands, *expected)


def _sideways(angle_deg: float) -> Shape:
    """A hillside along x that begins at y = 0; the robot drives along it."""
    height = rise_of(4.0, angle_deg)
    hill = slope((0.0, 4.0), (0.0, height), (-6.0, 6.0))
    turned = type(hill)(hill.name, hill.vertices[:, [1, 0, 2]], hill.triangles[:, ::-1])  # x and y change places
    low, high = (-1.5, 0.8, 0.8 * height / 4), (1.5, 2.4, 2.4 * height / 4)
    if angle_deg > 25.0:
        stands = (Stand(-2.0, -1.2), Stand(0.5, -0.8))
        return seen(
            f"hillside, {angle_deg:g} deg", (GROUND, turned), stands, not_traversable(low, high), no_path((0.0, 1.8, 1.8 * height / 4))
        )
    return seen(
        f"hillside, {angle_deg:g} deg",
        (GROUND, turned),
        (Stand(-2.0, -1.2), Stand(-0.5, 1.5, 1.5 * height / 4)),
        traversable(low, high),
        path((1.4, 1.8, 1.8 * height / 4)),
    )


def _crest(name: str, *, stands: tuple[Stand, ...], expected: tuple[Expectation, ...], behind: bool = False) -> Shape:
    """A ridge of 0.8 m across x = 4 with slopes of 15 degrees; `behind` it a hill that looks over it."""
    run = run_of(0.8, 15.0)
    solids = [GROUND, slope((4.0 - run, 4.0), (0.0, 0.8), (-5.0, 5.0)), slope((4.0, 4.0 + run), (0.8, 0.0), (-5.0, 5.0))]
    hill = [slope((7.2, 7.2 + run_of(2.0, 15.0)), (0.0, 2.0), (-5.0, 5.0))] if behind else []
    return seen(name, [*solids, *hill], stands, *expected)


BEFORE_THE_CREST = (Stand(-1.5, 0.0), Stand(0.4, 0.0))
HIDDEN = (no_cliff((3.4, -1.0, 0.5), (4.6, 1.0, 0.8)), frontier((3.4, -1.5, 0.5), (5.2, 1.5, 0.9)))
OVER = (
    traversable((2.0, -1.5, 0.2), (4.8, 1.5, 0.8)),
    no_cliff((2.0, -1.5, 0.2), (5.5, 1.5, 0.8)),
    no_frontier((3.8, -1.5, 0.4), (4.8, 1.5, 0.8)),
    path((4.8, 0.0, 0.58)),
)
VALLEY = run_of(0.6, 15.0)

SHAPES = (
    _up(5.0, 0.5),
    *(_up(angle) for angle in (10.0, 15.0, 20.0, 22.0, 25.0, 27.0, 30.0, 35.0, 40.0)),
    _first_look_up(15.0),
    _first_look_up(25.0),
    *(_down(angle) for angle in (5.0, 10.0, 15.0, 20.0, 22.0, 25.0, 27.0, 30.0, 40.0)),
    *(_sideways(angle) for angle in (10.0, 20.0, 22.0, 25.0, 27.0, 30.0)),
    _crest("crest, its back hidden", stands=BEFORE_THE_CREST, expected=HIDDEN),
    _crest("crest, its back hidden, a hill behind", stands=BEFORE_THE_CREST, expected=HIDDEN, behind=True),
    _crest("crest, looked over", stands=(Stand(-1.5, 0.0), Stand(0.4, 0.0), Stand(3.0, 0.0, 0.53)), expected=OVER),
    seen(
        "valley",
        (
            on_ground((-8.0, 0.0), (-5.0, 5.0), 0.6),
            slope((0.0, VALLEY), (0.6, 0.0), (-5.0, 5.0)),
            slope((VALLEY, 2 * VALLEY), (0.0, 0.6), (-5.0, 5.0)),
            on_ground((2 * VALLEY, 9.0), (-5.0, 5.0), 0.6),
        ),
        (Stand(-2.5, 0.0, 0.6), Stand(-0.8, 0.0, 0.6), Stand(1.3, 0.3, 0.25)),
        traversable((-0.5, -1.5, 0.0), (2 * VALLEY - 0.3, 1.5, 0.6)),
        path((2 * VALLEY + 0.5, 0.0, 0.6)),
    ),
)
