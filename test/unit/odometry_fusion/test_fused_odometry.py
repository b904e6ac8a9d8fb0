"""From raw messages to estimates: one at every stamp of the wheels, whatever the order between the two topics."""

import pickle

import numpy as np
import pytest
from test_imu_input import G, rotation_of

from odometry_fusion import FusedOdometry, OdometryConfig, OdometryEstimate
from robot_body import RobotBody
from sensor_checks import ImuLimits

WHEELS_S = np.round(10.0 + 0.05 * np.arange(40), 3)
IMU_S = np.round(10.003 + 0.01 * np.arange(200), 3)


def fused() -> FusedOdometry:
    return FusedOdometry(OdometryConfig(), ImuLimits(), RobotBody(), rotation_of)


def fed(odometry: FusedOdometry, stamps: list[tuple[float, str]], frame: str = "imu_link", up: float = G) -> list[OdometryEstimate]:
    found = []
    for stamp_s, topic in stamps:
        if topic == "wheels":
            odometry.add_wheels(stamp_s, 0.3, 0.0)
        else:
            odometry.add_imu(stamp_s, frame, (0.0, 0.0, 0.0), (0.0, 0.0, up))
        found += odometry.poll()
    return found


def by_time(delay_s: float = 0.0, begin_s: float = 0.0) -> list[tuple[float, str]]:
    """Both topics as they arrive; the IMU's messages are late by so much."""
    rows = [(t, t, "wheels") for t in WHEELS_S] + [(t + delay_s, t, "imu") for t in IMU_S]
    return [(float(begin_s + stamp), topic) for _, stamp, topic in sorted(rows)]


def test_estimate_comes_out_once_at_every_wheel_stamp_that_the_imu_reaches() -> None:
    stamps = [estimate.stamp_s for estimate in fed(fused(), by_time())]
    np.testing.assert_allclose(stamps, WHEELS_S[1:])  # before the first sample nothing says where up is


@pytest.mark.parametrize("delay_s", [0.02, 0.4])
def test_order_between_the_topics_changes_no_bit(delay_s: float) -> None:
    one, other = fed(fused(), by_time()), fed(fused(), by_time(delay_s))
    assert [e.stamp_s for e in one] == [e.stamp_s for e in other]
    assert all(np.array_equal(a.T_odom_base, b.T_odom_base) for a, b in zip(one, other, strict=True))


def test_doubled_and_late_wheels_give_no_second_estimate() -> None:
    rows = [row for row in by_time() for _ in range(1 + (row[1] == "wheels"))] + [(11.8, "wheels")]
    odometry = fused()
    assert [e.stamp_s for e in fed(odometry, rows)] == [e.stamp_s for e in fed(fused(), by_time())]
    assert odometry.dropped["wheels_late"] == 41


def test_clock_that_was_set_back_starts_afresh() -> None:
    odometry = fused()
    fed(odometry, by_time(begin_s=100.0))
    odometry.add_wheels(102.5, 0.3, 0.0)  # waits for its IMU
    np.testing.assert_allclose([e.stamp_s for e in fed(odometry, by_time())], WHEELS_S[1:])


def test_imu_mounted_upside_down_is_turned_and_one_that_cannot_be_right_is_refused() -> None:
    T_last = fed(fused(), by_time(), "flipped", -G)[-1].T_odom_base
    np.testing.assert_allclose(T_last, fed(fused(), by_time())[-1].T_odom_base, atol=1e-12)
    with pytest.raises(ValueError, match="it is in g"):
        fed(fused(), by_time(), up=1.0)


def test_odometry_that_was_kept_goes_on_to_the_bit() -> None:
    rows, whole = by_time(), fed(fused(), by_time())
    odometry = fused()
    found = fed(odometry, rows[:120])
    found += fed(pickle.loads(pickle.dumps(odometry)), rows[120:])
    assert [e.stamp_s for e in found] == [e.stamp_s for e in whole]
    assert all(np.array_equal(a.T_odom_base, b.T_odom_base) for a, b in zip(found, whole, strict=True))


def test_kept_odometry_does_not_jump_where_messages_were_lost() -> None:
    """Half a second of both topics is lost, of a robot that goes straight at 0.3 m/s all the while."""
    kept = pickle.loads(pickle.dumps(odometry := fused()))
    before = fed(kept, [row for row in by_time() if row[0] <= 11.0])[-1]
    after = fed(pickle.loads(pickle.dumps(kept)), [row for row in by_time() if row[0] > 11.5])
    assert odometry.dropped == {}
    way = [float(e.T_odom_base[0, 3] - before.T_odom_base[0, 3]) for e in after]
    np.testing.assert_allclose(way, [0.3 * (e.stamp_s - before.stamp_s) for e in after], atol=0.01)
