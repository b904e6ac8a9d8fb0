"""The cloud grows by what a sweep saw anew, and follows the graph when that moves."""

import numpy as np
import pytest

from rigid_geometry import transform_from_rpy, transform_points
from run_replay.growing_cloud import GrowingCloud

LINE = np.column_stack([np.arange(0.05, 1.0, 0.1), np.full(10, 0.05), np.full(10, 0.05)])
HERE, ASIDE = np.eye(4), transform_from_rpy((0.0, 2.0, 0.0))


def test_same_sweep_from_the_same_place_adds_nothing() -> None:
    cloud = GrowingCloud(0.1)
    cloud.add(LINE, np.stack([HERE]))
    cloud.add(LINE, np.stack([HERE, HERE]))
    assert len(cloud) == 2
    np.testing.assert_allclose(cloud.points, LINE, atol=1e-9)


def test_sweep_from_elsewhere_is_placed_there() -> None:
    cloud = GrowingCloud(0.1)
    cloud.add(LINE, np.stack([HERE]))
    cloud.add(LINE, np.stack([HERE, ASIDE]))
    np.testing.assert_allclose(cloud.points, np.concatenate([LINE, transform_points(ASIDE, LINE)]), atol=1e-9)


def test_older_sweep_follows_its_vertex() -> None:
    cloud = GrowingCloud(0.1)
    cloud.add(LINE, np.stack([HERE]))
    cloud.add(LINE, np.stack([ASIDE, ASIDE]))
    np.testing.assert_allclose(cloud.points, transform_points(ASIDE, LINE), atol=1e-9)


def test_points_that_are_not_finite_are_left_out() -> None:
    cloud = GrowingCloud(0.1)
    cloud.add(np.vstack([LINE, [[np.nan, 0.0, 0.0]]]), np.stack([HERE]))
    assert np.isfinite(cloud.points).all() and len(cloud.points) == len(LINE)


def test_sweep_without_a_pose_is_refused_and_changes_nothing() -> None:
    cloud = GrowingCloud(0.1)
    with pytest.raises(ValueError, match="poses"):
        cloud.add(LINE, np.stack([HERE, HERE]))
    assert len(cloud) == 0 and len(cloud.points) == 0
