"""How far what stands in a column extends: strays of a wall, tips of corners, and what few beams met."""

from types import SimpleNamespace

import numpy as np
import pytest

from octomap_server_3dnav.octree.surface_heights import HitHeights, SurfaceHeights
from octomap_server_3dnav.terrain.hit_extent import of_things, reach_of

NOISE = 0.125
SCENE = SimpleNamespace(key=(0, 0), columns=SimpleNamespace(ny=20))


def thing_in(column_x, points):
    """(6,) of what stands in column (column_x, 5), from points (N, 2) in voxels that beams met."""
    resolution = 0.08
    heights = SurfaceHeights(resolution)
    heights.add(HitHeights.of(np.column_stack([points, np.full(len(points), 2.5)]) * resolution, resolution))
    low, high = np.array([1]), np.array([9])
    return of_things(heights, SCENE, np.array([column_x * 20 + 5]), low, high, NOISE)[0]


def test_beams_that_ended_a_little_before_a_wall_are_of_the_wall():
    rng = np.random.default_rng(1)
    wall = np.column_stack([4.9 + NOISE * rng.standard_normal(400), rng.uniform(5.0, 6.0, 400)])
    assert 5 < (wall[:, 0] > 5.0).sum() < 120
    thing = thing_in(5, wall)
    assert thing[0] == 400
    assert 5.5 + thing[1] == pytest.approx(4.9, abs=0.02)


def test_tip_of_a_corner_stays_where_it_was_met_though_there_is_more_behind():
    rng = np.random.default_rng(2)
    behind, tip = rng.uniform([4.0, 5.2], [4.5, 5.8], (120, 2)), rng.uniform([5.02, 5.4], [5.12, 5.6], (9, 2))
    thing = thing_in(5, np.vstack([behind, tip]))
    assert thing[0] == 129
    assert thing[1:3] == pytest.approx(tip.mean(axis=0) - [5.5, 5.5], abs=0.02)


def test_what_few_beams_met_may_extend_farther_than_they_tell():
    counts = np.array([0, 5, 20, 28, 40, 100, 1000])
    things = np.column_stack([counts, np.zeros((counts.size, 5))])
    unmet = reach_of(things, NOISE)[:, 2]
    assert (np.diff(unmet) <= 0.0).all()
    assert unmet[[0, 3, 6]] == pytest.approx([0.6, 0.5, 0.0], abs=1e-3)


def test_line_of_hits_extends_to_its_ends_and_noise_across_it_does_not():
    n, across = 1000, 0.85 * NOISE  # a side that is seen from several directions
    line = np.array([[n, 0.0, 0.0, 0.25**2 / 3.0 + across**2, across**2, 0.0]])
    along_x, along_y, around = reach_of(line, NOISE)[0]
    assert 0.25 <= along_x <= 0.25 + NOISE
    assert (along_y, around) == pytest.approx((0.0, 0.0), abs=2e-3)


@pytest.mark.parametrize("arm", [0.15, 0.25, 0.4, 0.8])
@pytest.mark.parametrize("share", [0.5, 0.8])
def test_corner_of_which_little_lies_in_the_column_is_within_reach(arm, share):
    rng = np.random.default_rng(4)
    n, corner = 1000, np.array([5.1, 5.1])
    on_x, along = rng.random(n) < share, rng.uniform(0.0, arm, n)
    points = corner + np.where(on_x[:, None], [1.0, 0.0], [0.0, 1.0]) * along[:, None] + 0.8 * NOISE * rng.standard_normal((n, 2))
    own = points[(np.floor(points) == 5.0).all(axis=1)]
    mean, cov = own.mean(axis=0) - 5.5, np.cov(own.T)
    reach = reach_of(np.array([[len(own), *mean, cov[0, 0], cov[1, 1], cov[0, 1]]]), NOISE)[0]
    off = corner - 5.5 - mean
    square = max(reach[0] ** 2 + reach[1] ** 2, 1e-9)
    line = np.clip(off @ reach[:2] / square, -1.0, 1.0) * reach[:2]
    assert np.hypot(*(off - line)) - reach[2] < 0.135  # 11 mm
