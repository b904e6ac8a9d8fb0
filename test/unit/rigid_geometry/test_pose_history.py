"""Poses are found between those that are known and nowhere else."""

import numpy as np
import pytest

from rigid_geometry import PoseHistory, transform_from_rpy


def history(*stamps_s: float) -> PoseHistory:
    """A robot that drives 1 m/s along x."""
    poses = PoseHistory()
    for stamp_s in stamps_s:
        poses.add(stamp_s, transform_from_rpy((stamp_s, 0.0, 0.0)))
    return poses


def test_pose_between_two_is_interpolated() -> None:
    assert history(1.0, 2.0, 3.0).at(2.25)[0, 3] == pytest.approx(2.25)


def test_pose_at_a_known_stamp_is_that_pose() -> None:
    poses = history(1.0, 2.0)
    for stamp_s in (1.0, 2.0):
        np.testing.assert_allclose(poses.at(stamp_s), transform_from_rpy((stamp_s, 0.0, 0.0)), atol=1e-12)


def test_last_seconds_are_known_however_often_poses_come() -> None:
    poses = history(*np.arange(0.0, 10.0, 0.005))
    assert poses.at(2.0025)[0, 3] == pytest.approx(2.0025)


@pytest.mark.parametrize("stamp_s", [0.9, 2.1])
def test_pose_outside_the_history_is_refused(stamp_s: float) -> None:
    with pytest.raises(ValueError, match="outside"):
        history(1.0, 2.0).at(stamp_s)


def test_stamp_that_differs_by_rounding_from_the_last_is_the_last() -> None:
    assert history(1.0, 2.0).reaches(2.0 + 1e-7)
    assert history(1.0, 2.0).at(2.0 + 1e-7)[0, 3] == pytest.approx(2.0)
    assert not history(1.0, 2.0).reaches(2.001)


def test_history_without_poses_knows_nothing() -> None:
    assert not PoseHistory().reaches(0.0)
    with pytest.raises(ValueError, match="no pose"):
        PoseHistory().at(1.0)


def test_time_that_jumped_back_starts_afresh() -> None:
    poses = history(10.0, 11.0, 5.0, 6.0)
    assert poses.at(5.5)[0, 3] == pytest.approx(5.5)
    with pytest.raises(ValueError):
        poses.at(10.5)


def test_pose_that_is_late_or_doubled_is_left_out() -> None:
    poses = history(1.0, 2.0, 1.9, 2.0, 3.0)
    assert poses.at(1.5)[0, 3] == pytest.approx(1.5) and poses.at(2.5)[0, 3] == pytest.approx(2.5)
    assert not poses.add(2.99, transform_from_rpy((9.0, 0.0, 0.0))) and poses.add(3.1, transform_from_rpy((3.1, 0.0, 0.0)))


def test_pose_that_is_not_rigid_is_refused_and_changes_nothing() -> None:
    poses = history(1.0, 2.0)
    with pytest.raises(ValueError):
        poses.add(3.0, np.full((4, 4), np.nan))
    assert poses.reaches(2.0) and not poses.reaches(3.0)


def test_history_is_bounded() -> None:
    poses = history(*np.arange(1.0, 2001.0))
    assert poses.reaches(2000.0)
    with pytest.raises(ValueError):
        poses.at(100.0)
