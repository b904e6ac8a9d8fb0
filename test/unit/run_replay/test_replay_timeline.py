"""Frames follow the run's clock, the pace follows the wall's, and a path is thinned without losing its ends."""

import numpy as np
import pytest

from rigid_geometry import transform_from_rpy
from run_replay.timeline import Pace, driven_m, frame_step_s, frames, thinned

STAMPS_S = np.array([1.0, 2.0, 4.0])
POSES = np.stack([transform_from_rpy((x, 0.0, 0.0)) for x in (0.0, 1.0, 3.0)])


def test_frames_begin_with_the_first_stamp_and_end_with_the_last() -> None:
    stamps = [f.stamp_s for f in frames(STAMPS_S, POSES, np.array([1.5]), 0.7)]
    np.testing.assert_allclose(stamps, [1.0, 1.7, 2.4, 3.1, 3.8, 4.0])


def test_robot_is_on_its_path_between_two_poses() -> None:
    frame = frames(STAMPS_S, POSES, np.array([1.5]), 0.5)[4]
    assert frame.stamp_s == 3.0
    np.testing.assert_allclose(frame.T_map_base[:3, 3], [2.0, 0.0, 0.0])
    assert frame.distance_m == pytest.approx(2.0)


def test_sweep_is_in_the_map_from_its_stamp_on() -> None:
    assert [f.sweeps for f in frames(STAMPS_S, POSES, np.array([1.0, 2.0, 3.5]), 1.0)] == [1, 2, 2, 3]


def test_robot_stands_where_its_path_is_not_known() -> None:
    shown = frames(STAMPS_S, POSES, np.array([0.0, 5.0]), 1.0)
    assert (shown[0].stamp_s, shown[-1].stamp_s, shown[-1].sweeps) == (0.0, 5.0, 2)
    np.testing.assert_allclose([shown[0].T_map_base[0, 3], shown[-1].T_map_base[0, 3]], [0.0, 3.0])


def test_run_of_one_sweep_is_one_frame() -> None:
    (frame,) = frames(STAMPS_S[:1], POSES[:1], STAMPS_S[:1], 0.4)
    assert (frame.stamp_s, frame.sweeps, frame.distance_m) == (1.0, 1, 0.0)


@pytest.mark.parametrize("step_s", [0.0, -1.0, float("nan")])
def test_step_that_leads_nowhere_is_refused(step_s: float) -> None:
    with pytest.raises(ValueError, match="step"):
        frames(STAMPS_S, POSES, STAMPS_S, step_s)


def test_pace_counts_from_the_first_stamp_at_its_speed() -> None:
    pace = Pace(10.0)
    assert pace.seconds_until(100.0, now_s=5.0) == 0.0
    assert pace.seconds_until(120.0, now_s=5.5) == pytest.approx(1.5)
    assert pace.seconds_until(120.0, now_s=8.0) == 0.0


def test_pace_zero_never_waits() -> None:
    pace = Pace(0.0)
    assert pace.seconds_until(0.0, 0.0) == pace.seconds_until(1e6, 0.0) == 0.0


def test_frames_keep_their_rate_at_every_speed() -> None:
    assert frame_step_s(10.0, 25.0) == pytest.approx(0.4)
    assert frame_step_s(1.0, 25.0) == pytest.approx(0.04)
    assert frame_step_s(0.0, 25.0) > 0.0


def test_thinned_path_keeps_both_ends_and_its_steps() -> None:
    positions = np.column_stack([np.linspace(0.0, 1.0, 101), np.zeros(101), np.zeros(101)])
    kept = thinned(positions, 0.25)
    assert kept[0] == 0 and kept[-1] == 100
    assert np.diff(driven_m(positions)[kept]).max() <= 0.25 + 0.011
    assert len(kept) == 5


def test_robot_that_stands_leaves_two_points() -> None:
    assert thinned(np.zeros((50, 3)), 0.1).tolist() == [0, 49]
