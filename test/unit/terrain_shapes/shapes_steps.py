"""Steps: kerbs up and down, stairs, things that lie across the way. The robot climbs 10 cm, up or down."""

import numpy as np
from shape import Shape, Stand, no_path, not_traversable, obstacle, path, seen, traversable
from shape_parts import GROUND, block, on_ground, prism, run_of, slope, wall_with_door

from pybullet_simulation.solids import Solid

CLIMBED_M = 0.10
BROAD = (-5.0, 5.0)


def _kerb(height: float, ground: float = 0.0) -> Shape:
    """A raised floor from x = 0 on, come upon from below; `ground` moves all of it against the layers of voxels."""
    top = ground + height
    floor = block((-12.0, 12.0), (-12.0, 12.0), (-0.5, ground))
    solids = (floor, block((0.0, 6.0), BROAD, (-0.5, top)))
    stands = (Stand(-2.6, 0.0, ground), Stand(-1.1, 0.5, ground, 20.0))
    name = f"kerb of {100 * height:g} cm, up" + (f", ground at {100 * ground:g} cm" if ground else "")
    if height > CLIMBED_M:
        return seen(name, solids, stands, obstacle((-0.1, -1.5, ground), (0.2, 1.5, top)), no_path((1.5, 0.0, top)))
    return seen(name, solids, stands, traversable((-1.0, -1.2, ground), (1.0, 1.2, top)), path((1.5, 0.0, top)))


def _kerb_down(height: float, ground: float = 0.0) -> Shape:
    """The same from above: the edge at x = 0."""
    top = ground + height
    floor = block((-12.0, 12.0), (-12.0, 12.0), (-0.5, ground))
    solids = (floor, block((-6.0, 0.0), BROAD, (-0.5, top)))
    stands = (Stand(-2.6, 0.0, top), Stand(-1.1, 0.5, top, 20.0))
    name = f"kerb of {100 * height:g} cm, down" + (f", ground at {100 * ground:g} cm" if ground else "")
    if height > CLIMBED_M:
        edge = not_traversable((-0.25, -1.5, ground), (0.2, 1.5, top))
        return seen(name, solids, stands, edge, no_path((1.5, 0.0, ground)), traversable((-1.6, -1.0, top), (-0.8, 1.0, top)))
    return seen(name, solids, stands, traversable((-1.0, -1.2, ground), (1.0, 1.2, top)), path((1.5, 0.0, ground)))


def _stairs(count: int, rise: float, tread: float, y: tuple[float, float]) -> list[Solid]:
    """Steps up along x from x = 0, and a platform of 3 m behind the last one."""
    steps = [on_ground((k * tread, count * tread), y, (k + 1) * rise) for k in range(count)]
    return [*steps, on_ground((count * tread - 0.01, count * tread + 3.0), y, count * rise)]


def _stairs_down() -> Shape:
    solids = [GROUND, *_stairs(6, 0.17, 0.29, BROAD)]
    turned = [type(s)(s.name, s.vertices * [-1.0, 1.0, 1.0], s.triangles[:, ::-1]) for s in solids]
    return seen(
        "stairs down",
        turned,
        (Stand(-4.0, 0.0, 1.02), Stand(-2.3, 0.3, 1.02)),
        not_traversable((-1.7, -0.4, 0.0), (-0.1, 1.0, 1.02)),
        no_path((0.8, 0.0, 0.0)),
        traversable((-3.2, -1.0, 1.02), (-2.2, 1.0, 1.02)),
    )


def _stairs_beside_a_ramp() -> Shape:
    run = run_of(1.02, 18.0)
    solids = [
        GROUND,
        *_stairs(6, 0.17, 0.29, (0.1, 3.5)),
        slope((1.74 - run, 1.74), (0.0, 1.02), (-3.0, 0.1)),
        on_ground((1.74, 4.74), (-3.0, 0.2), 1.02),
    ]
    stands = (Stand(-2.8, 0.8), Stand(-1.8, -1.2, yaw_deg=20.0), Stand(0.2, -1.4, 0.52), Stand(2.9, -1.0, 1.02, 60.0))
    return seen(
        "stairs beside a ramp",
        solids,
        stands,
        not_traversable((0.05, 0.3, 0.1), (1.6, 3.2, 0.9)),
        traversable((-1.2, -2.1, 0.0), (1.6, -0.9, 1.0)),
        path((-2.5, 1.5, 0.0)),
        path((3.3, 1.5, 1.02)),
    )


def _rubble(low: float, high: float, gap: float, seed: int) -> list[Solid]:
    """Stones of 10 to 30 cm, `low` to `high` metres high, one every `gap` metres from x = 0 to 4."""
    rng = np.random.default_rng(seed)
    places = [(x, y) for x in np.arange(0.2, 4.0, gap) for y in np.arange(-3.0, 3.0, gap)]
    shifts, sizes, heights = (
        rng.uniform(-0.1, 0.1, (len(places), 2)),
        rng.uniform(0.05, 0.15, (len(places), 2)),
        rng.uniform(low, high, len(places)),
    )
    return [
        on_ground((x + dx - a, x + dx + a), (y + dy - b, y + dy + b), h)
        for (x, y), (dx, dy), (a, b), h in zip(places, shifts, sizes, heights, strict=True)
    ]


BEFORE = (Stand(-2.6, 0.0), Stand(-1.1, 0.3))

SHAPES = (
    *(_kerb(height) for height in (0.02, 0.05, 0.08, 0.10, 0.12, 0.15, 0.20)),
    _kerb(0.05, ground=0.06),
    _kerb(0.12, ground=0.03),
    _kerb(0.12, ground=0.06),
    _kerb(0.15, ground=0.06),
    _kerb(0.15, ground=0.02),
    *(_kerb_down(height) for height in (0.05, 0.08, 0.12, 0.15, 0.20, 0.30)),
    _kerb_down(0.11, ground=0.06),
    *(_kerb_down(0.15, ground=ground) for ground in (0.02, 0.04, 0.06)),
    seen(
        "stairs up",
        [GROUND, *_stairs(6, 0.17, 0.29, BROAD)],
        (Stand(-2.6, 0.0), Stand(-1.2, 0.3)),
        obstacle((-0.1, -1.5, 0.0), (0.2, 1.5, 0.2)),
        not_traversable((-0.1, -1.5, 0.0), (1.7, 1.5, 1.0)),
        no_path((3.0, 0.0, 1.02)),
    ),
    _stairs_down(),
    seen(
        "stairs of 7 cm",
        [GROUND, *_stairs(5, 0.07, 0.60, BROAD)],
        (Stand(-2.0, 0.0), Stand(-0.3, 0.3), Stand(1.5, 0.0, 0.21)),
        traversable((-1.0, -1.0, 0.0), (2.8, 1.0, 0.35)),
        path((3.5, 0.0, 0.35)),
    ),
    _stairs_beside_a_ramp(),
    seen(
        "threshold of 5 cm in a door",
        [GROUND, *wall_with_door(1.6), on_ground((0.0, 0.15), (-0.8, 0.8), 0.05)],
        (Stand(-2.2, 0.0), Stand(1.4, 0.1)),
        path((-1.5, 0.0, 0.0)),
        obstacle((-0.1, 1.0, 0.0), (0.25, 2.5, 2.0)),
    ),
    seen(
        "speed bump of 8 cm",
        (GROUND, prism([(-0.25, -0.05), (-0.25, 0.0), (0.0, 0.08), (0.25, 0.0), (0.25, -0.05)], BROAD)),
        (*BEFORE, Stand(1.4, 0.0)),
        traversable((-0.6, -1.2, 0.0), (0.8, 1.2, 0.08)),
        path((-1.5, 0.0, 0.0)),
    ),
    seen(
        "log of 16 cm",
        (GROUND, on_ground((-0.08, 0.08), (-12.0, 12.0), 0.16)),
        BEFORE,
        obstacle((-0.16, -1.5, 0.0), (0.16, 1.5, 0.16)),
        no_path((1.5, 0.0, 0.0)),
    ),
    seen(
        "plank of 4 cm",
        (GROUND, on_ground((-0.1, 0.1), (-2.0, 2.0), 0.04)),
        BEFORE,
        traversable((-0.8, -1.2, 0.0), (1.0, 1.2, 0.04)),
        path((1.5, 0.0, 0.0)),
    ),
    seen(
        "rubble of 3 to 7 cm",
        [GROUND, *_rubble(0.03, 0.07, 0.6, seed=1)],
        (Stand(-1.6, 0.0), Stand(0.3, 0.1), Stand(2.4, 0.0)),
        traversable((-0.5, -1.2, 0.0), (3.5, 1.2, 0.07)),
        path((-1.2, 0.0, 0.0)),
    ),
    seen(
        "rubble of 15 to 35 cm",
        [GROUND, *_rubble(0.15, 0.35, 0.7, seed=2)],
        BEFORE,
        not_traversable((0.2, -1.5, 0.0), (2.5, 1.5, 0.4)),
        no_path((2.0, 0.0, 0.0)),
    ),
)
