"""What sweeps ask of the odometry, and that the next process of a node knows it too."""

from pathlib import Path

import numpy as np
import pytest

from node_life import Life
from node_life.life import MEMORY
from rigid_geometry import transform_from_rpy
from ros_adapters.odometry_record import OdometryRecord

UP = np.array([0.0, 0.0, 1.0])


def at(x: float) -> np.ndarray:
    return transform_from_rpy((x, 0.0, 0.0))


def filled(life: Life) -> OdometryRecord:
    record = OdometryRecord(life)
    for k in range(11):
        record.add_pose(0.1 * k, at(0.1 * k))
        record.add_up(0.1 * k, UP, 0.01 + 0.01 * k)
    return record


def test_pose_lies_between_those_around_it_and_up_is_the_first_since() -> None:
    found = filled(Life({})).at(0.45)
    np.testing.assert_allclose(found.T_odom_base, at(0.45), atol=1e-12)
    assert found.up_sigma_rad == pytest.approx(0.06)


def test_record_reaches_as_far_as_both_do() -> None:
    record = filled(Life({}))
    assert record.reaches(1.0) and not record.reaches(1.05)
    record.add_pose(1.1, at(1.1))
    assert not record.reaches(1.05)
    record.add_up(1.1, UP, 0.01)
    assert record.reaches(1.05)


def test_clock_that_was_set_back_leaves_no_up_of_later() -> None:
    record = filled(Life({}))
    record.add_up(0.2, UP, 0.5)
    assert not record.reaches(0.3)


def test_nothing_is_known_in_the_midst_of_a_silence() -> None:
    """A node that is started again heard nothing meanwhile, and the robot may have turned."""
    record = filled(Life({}))
    record.add_pose(3.5, at(1.3))
    record.add_up(3.5, UP, 0.01)
    np.testing.assert_allclose(record.at(3.5).T_odom_base, at(1.3), atol=1e-12)
    with pytest.raises(ValueError, match="for 2.5 s"):
        record.at(1.6)
    np.testing.assert_allclose(record.newest(), at(1.3))


def test_up_of_seconds_later_is_not_that_of_the_sweep() -> None:
    record = OdometryRecord(Life({}))
    for k in range(40):
        record.add_pose(0.1 * k, at(0.1 * k))
    record.add_up(2.0, UP, 0.01)
    with pytest.raises(ValueError, match="1.0 s later"):
        record.at(1.0)


def test_one_late_message_forgets_nothing() -> None:
    record = filled(Life({}))
    record.add_up(0.95, UP, 0.5)
    assert record.reaches(1.0) and record.at(0.45).up_sigma_rad == pytest.approx(0.06)


@pytest.mark.parametrize("samples", [30, 1200])  # noted one by one; and kept as a whole meanwhile
def test_next_process_knows_what_this_one_knew(tmp_path: Path, samples: int) -> None:
    environment = {MEMORY: str(tmp_path)}
    record = OdometryRecord(Life(environment))
    for k in range(samples):
        record.add_pose(0.1 * k, at(0.1 * k))
        record.add_up(0.1 * k, UP, 0.01)
    last_s = 0.1 * (samples - 1)
    again = OdometryRecord(Life(environment))
    assert again.reaches(last_s) and not again.reaches(last_s + 0.05)
    np.testing.assert_array_equal(again.at(last_s - 0.02).T_odom_base, record.at(last_s - 0.02).T_odom_base)
