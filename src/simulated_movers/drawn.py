"""Movers by number alone: which kinds, how fast, from a seed."""

import numpy as np

from simulated_movers.specification import MoverSpec

_DRAWN = 19  # random stream of a seed
_TURN = (("person", "random"), ("person", "steps_in"), ("cart", "random"), ("robot", "random"))
_SPEEDS_MPS = {"person": (0.7, 1.3), "cart": (0.4, 0.8), "robot": (0.3, 0.6)}
_STANDS_IN_THE_WAY_S = 4.0
MOST = 50


def drawn_movers(count: int, seed: int) -> tuple[MoverSpec, ...]:
    """So many movers: a walker, a mean person, a cart, another robot, and so on in turn, at speeds from the seed. ValueError for a number
    that is none."""
    if not 0 <= count <= MOST:
        raise ValueError(f"{count} movers, expected 0 to {MOST}")
    rng = np.random.default_rng([seed, _DRAWN])
    return tuple(_drawn(number, rng) for number in range(count))


def _drawn(number: int, rng: np.random.Generator) -> MoverSpec:
    kind, walk = _TURN[number % len(_TURN)]
    speed = float(rng.uniform(*_SPEEDS_MPS[kind]))
    pause = _STANDS_IN_THE_WAY_S if walk == "steps_in" else float(rng.uniform(0.5, 3.0))
    name = f"{'mean_' if walk == 'steps_in' else ''}{kind}_{number + 1}"
    return MoverSpec(kind=kind, name=name, walk=walk, speed_mps=speed, pause_s=pause)
