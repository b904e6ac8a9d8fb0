"""Where a robot was between two messages of its odometry is known when they are near in time, or it stood."""

import math

import pytest

from rigid_geometry import OdometryHistory, transform_from_rpy


def history(rate_hz: float, forward_mps: float, yaw_rate: float = 0.0) -> OdometryHistory[str]:
    """Eight messages from 0 s on."""
    odometry = OdometryHistory[str]()
    for k in range(8):
        t = k / rate_hz
        odometry.add_pose(t, transform_from_rpy((forward_mps * t, 0.0, 0.0), (0.0, 0.0, yaw_rate * t)))
        odometry.add_up(t, f"up {k}")
    return odometry


@pytest.mark.parametrize("rate_hz", [0.5, 1.0, 2.0, 3.0])
def test_slow_odometry_of_a_robot_that_stands_is_known(rate_hz: float) -> None:
    for odometry in (history(rate_hz, 0.0), history(rate_hz, 0.02 * rate_hz, math.radians(0.5) * rate_hz)):
        pose, up = odometry.at(3.3 / rate_hz)
        assert up == "up 4" and abs(pose[0, 3]) < 0.1


@pytest.mark.parametrize("motion", [(0.5, 0.0), (0.0, 0.5)])
def test_slow_odometry_of_a_robot_that_moves_is_known_at_its_stamps_alone(motion: tuple[float, float]) -> None:
    odometry = history(2.0, *motion)
    assert odometry.at(1.5)[1] == "up 3"
    with pytest.raises(ValueError, match=r"the pose at 1\.600 s is not known: there was none for 0\.5 s"):
        odometry.at(1.6)
    assert history(4.0, *motion).at(1.6)[1] == "up 7"


def test_up_that_was_told_later_is_that_of_a_robot_that_stood() -> None:
    for forward_mps, is_known in ((0.0, True), (0.5, False)):
        odometry = OdometryHistory[str]()
        for k in range(41):
            odometry.add_pose(0.05 * k, transform_from_rpy((forward_mps * 0.05 * k, 0.0, 0.0)))
        odometry.add_up(2.0, "up")
        if is_known:
            assert odometry.at(1.0)[1] == "up"
        else:
            with pytest.raises(ValueError, match=r"what was up at 1\.000 s is not known"):
                odometry.at(1.0)


def test_robot_may_have_driven_away_and_back_in_a_long_silence() -> None:
    odometry = history(0.4, 0.0)
    assert odometry.at(2.5)[1] == "up 1"
    with pytest.raises(ValueError, match=r"there was none for 2\.5 s"):
        odometry.at(3.0)
