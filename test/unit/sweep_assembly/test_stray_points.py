"""Points without company are no surface; what a thin thing gives is."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from sweep_assembly.assembler import SweepAssemblyConfig
from sweep_assembly.stray_points import stray_points


def rail(step_m: float = 0.04) -> np.ndarray:
    """One line of beams along something thin."""
    y = np.arange(-1.0, 1.0, step_m)
    return np.stack([np.full_like(y, 3.0), y, np.full_like(y, 0.5)], axis=1)


def test_thin_thing_is_kept_and_what_hangs_beside_it_is_not():
    points = np.concatenate([rail(), [[3.0, 0.0, 0.9], [3.0, 0.1, 0.9], [2.0, 0.0, 0.5]]])
    stray = stray_points(points, np.full(len(points), 0.2), 2)
    assert stray[-3:].all() and not stray[:-3].any()
    assert np.flatnonzero(stray_points(points, np.full(len(points), 0.2), 1)).tolist() == [len(points) - 1]


def test_by_default_the_floor_is_no_company_for_what_hangs_a_hand_above_it():
    config = SweepAssemblyConfig()
    x, y = np.meshgrid(np.arange(2.0, 3.0, 0.06), np.arange(-0.5, 0.5, 0.03))
    points = np.vstack([np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]), [2.5, 0.0, 0.11]])
    radius = np.maximum(config.stray_radius_m, config.stray_radius_ratio * np.linalg.norm(points, axis=1))
    assert np.flatnonzero(stray_points(points, radius, config.stray_neighbours)).tolist() == [len(points) - 1]


def test_farther_points_may_lie_farther_apart():
    points = np.stack([np.arange(5) * 0.3, np.zeros(5), np.zeros(5)], axis=1)
    assert stray_points(points, np.array([0.2, 0.2, 0.7, 0.2, 0.2]), 2).tolist() == [True, True, False, True, True]


@pytest.mark.parametrize("neighbours", [1, 2, 5])
def test_is_what_all_pairs_say(neighbours):
    rng = np.random.default_rng(4)
    points = rng.uniform(-3.0, 3.0, (600, 3)).astype(np.float32)
    radius = rng.uniform(0.3, 0.8, len(points))
    near = (cdist(points.astype(float), points.astype(float)) <= radius[:, None]).sum(axis=1) - 1
    np.testing.assert_array_equal(stray_points(points, radius, neighbours), near < neighbours)


def test_nothing_is_stray_where_nobody_asks_or_nothing_is():
    assert not stray_points(np.array([[1.0, 2.0, 3.0]]), np.array([0.2]), 0).any()
    assert stray_points(np.zeros((0, 3)), np.zeros(0), 2).shape == (0,)
    assert stray_points(np.array([[1.0, 2.0, 3.0]]), np.array([0.2]), 2).all()
