"""Layers against oracles: brute force for rays and distances, the closed form for costs."""

import math

import numpy as np
import pytest

from local_terrain_costmap.config import CostmapConfig
from local_terrain_costmap.inflation import distance_to_lethal, inflated, inflation_cost
from local_terrain_costmap.obstacle import _clear_rays
from local_terrain_costmap.view import INSCRIBED, LETHAL, NO_INFORMATION
from local_terrain_costmap.window import Window, shifted


def cleared_by_dense_sampling(shape, start, end, resolution, max_range):
    """Cells that hold a point of the beam, by tiny steps, without the end's cell and what touches less than a step."""
    length = np.linalg.norm(end - start)
    travelled = np.arange(0.0, min(length, max_range), 1e-4)
    points = start + np.outer(travelled / length, end - start)
    cells = {tuple(c) for c in np.floor(points / resolution).astype(int)}
    cells.discard(tuple(np.floor(end / resolution).astype(int)))
    return {(r, c) for c, r in cells if 0 <= r < shape[0] and 0 <= c < shape[1]}


def test_ray_clears_the_cells_that_dense_sampling_finds():
    rng = np.random.default_rng(3)
    for _ in range(60):
        marked = np.ones((30, 30), dtype=np.bool_)
        start, end = rng.uniform(0.3, 2.7, 2), rng.uniform(-0.5, 3.5, 2)
        _clear_rays(marked, end[None], start, np.zeros(2), 0.1, 1.5)
        found = {(int(r), int(c)) for r, c in zip(*np.nonzero(~marked), strict=True)}
        expected = cleared_by_dense_sampling(marked.shape, start, end, 0.1, 1.5)
        # Dense sampling misses corners that a beam crosses in less than its step, and never finds too many.
        assert expected <= found and len(found - expected) <= 1


@pytest.mark.parametrize("angle", np.arange(8) * math.pi / 4)
def test_ray_along_axes_and_diagonals_ends_at_its_end(angle):
    marked = np.ones((21, 21), dtype=np.bool_)
    start = np.array([1.05, 1.05])
    end = start + 0.7 * np.array([math.cos(angle), math.sin(angle)])
    _clear_rays(marked, end[None], start, np.zeros(2), 0.1, 5.0)
    column, row = np.floor(end / 0.1).astype(int)
    assert marked[row, column] and not marked[10, 10]
    assert 7 <= (~marked).sum() <= 15


def test_ray_of_no_length_clears_nothing():
    marked = np.ones((5, 5), dtype=np.bool_)
    _clear_rays(marked, np.array([[0.25, 0.25]]), np.array([0.25, 0.25]), np.zeros(2), 0.1, 5.0)
    assert marked.all()


def test_distance_is_that_of_brute_force():
    rng = np.random.default_rng(5)
    cost = np.where(rng.random((17, 23)) < 0.02, LETHAL, 0).astype(np.uint8)
    lethal = np.argwhere(cost == LETHAL)
    cells = np.argwhere(np.ones_like(cost))
    expected = np.min(np.linalg.norm(cells[:, None] - lethal[None], axis=2), axis=1).reshape(cost.shape) * 0.08
    np.testing.assert_allclose(distance_to_lethal(cost, 0.08), expected, atol=1e-12)


def test_distance_without_anything_lethal_is_infinite():
    assert np.isinf(distance_to_lethal(np.full((4, 4), NO_INFORMATION, dtype=np.uint8), 0.1)).all()


def test_cost_falls_as_costmap_2d_has_it():
    config = CostmapConfig(inflation_radius_m=0.9, cost_scaling_factor=5.0)
    cost = inflation_cost(np.array([0.0, 0.1, 0.34, 0.5, 0.9, 0.91, np.inf]), 0.34, config)
    assert cost.tolist() == [254, 253, 253, int(252 * math.exp(-5 * 0.16)), int(252 * math.exp(-5 * 0.56)), 0, 0]


def test_inflation_leaves_unknown_cells_unknown_beyond_the_inscribed_radius():
    cost = np.full((1, 12), NO_INFORMATION, dtype=np.uint8)
    cost[0, 0] = LETHAL
    out = inflated(cost, 0.34, CostmapConfig(resolution_m=0.1))
    assert out[0].tolist() == [LETHAL] + [INSCRIBED] * 3 + [NO_INFORMATION] * 8


@pytest.mark.parametrize(("dx", "dy"), [(0, 0), (2, -1), (-3, 3), (0, 4), (5, 0), (-9, 2)])
def test_shift_moves_values_with_the_ground(dx, dy):
    old, new = Window(10, 20, 5, 0.1), Window(10 + dx, 20 + dy, 5, 0.1)
    values = np.arange(1, 26).reshape(5, 5)
    out = shifted(values, old, new, 0)
    for row in range(5):
        for column in range(5):
            r, c = row + dy, column + dx
            assert out[row, column] == (values[r, c] if 0 <= r < 5 and 0 <= c < 5 else 0)
