"""Raw IMU samples: turned into base_link as the URDF mounts them, held until gravity speaks for them, refused with the reason."""

import numpy as np
import pytest

from odometry_fusion import ImuInput
from rigid_geometry import rotation_from_rpy
from sensor_checks import ImuLimits

G = 9.81
MOUNTS = {"imu_link": np.eye(3), "flipped": rotation_from_rpy(np.pi, 0.0, 0.0), "sideways": rotation_from_rpy(0.1, 0.2, 1.5)}


def rotation_of(frame):
    if frame not in MOUNTS:
        raise ValueError(f"unknown {frame}")
    return MOUNTS[frame]


def imu_input(**limits):
    return ImuInput(ImuLimits(**limits), rotation_of)


def feed(imu, frame="imu_link", accel=(0.0, 0.0, G), gyro=(0.0, 0.0, 0.0), start_s=10.0, count=200, dt=0.01, wheel_rate=None, noise=1e-13):
    """What came out, and the faults that were told; `noise` of the rates in rad/s."""
    out, faults = [], []
    for i in range(count):
        if wheel_rate is not None:
            imu.add_wheels(start_s + i * dt, wheel_rate)
        try:
            out += imu.add(start_s + i * dt, frame, (gyro[0] + noise * (i % 2), *gyro[1:]), accel)
        except ValueError as error:
            faults.append(str(error))
    return out, faults


@pytest.mark.parametrize("frame", MOUNTS)
def test_samples_come_out_in_base_link_however_the_imu_is_mounted(frame):
    R = MOUNTS[frame]
    out, faults = feed(imu_input(), frame, R.T @ [0.2, 0.0, G], R.T @ [0.0, 0.1, 0.3])
    assert not faults and len(out) == 200
    assert out[-1].accel == pytest.approx([0.2, 0.0, G])
    assert out[-1].gyro == pytest.approx([0.0, 0.1, 0.3])


def test_leading_slash_of_a_frame_means_nothing():
    assert len(feed(imu_input(), "/imu_link")[0]) == 200


def test_mounting_that_gravity_contradicts_is_refused_after_the_time_of_judgement():
    out, faults = feed(imu_input(), "flipped", (0.0, 0.0, G))
    assert not out and len(faults) == 100
    assert "upside down" in faults[0] and "flipped" in faults[0]


def test_shake_at_the_start_holds_samples_and_loses_none():
    imu = imu_input()
    shaken, _ = feed(imu, accel=(0.0, 0.0, 14.0), count=5)
    calm, faults = feed(imu, start_s=10.05)
    assert not shaken and not faults
    assert [round(s.stamp_s, 3) for s in calm] == [round(10.0 + 0.01 * i, 3) for i in range(205)]


def test_refused_imu_is_believed_again_once_it_is_right():
    imu = imu_input()
    feed(imu, accel=(0.0, 0.0, 1.0))
    out, faults = feed(imu, start_s=12.0, count=300)
    assert "in g" in faults[0]
    assert len(out) >= 190 and len(faults) <= 110


def test_imu_in_g_is_told_of_also_when_it_is_slow_or_its_samples_come_late():
    assert "in g" in feed(imu_input(), accel=(0.0, 0.0, 1.0), dt=2.0, count=3)[1][0]
    imu, faults = imu_input(), []
    for i in range(200):
        try:
            imu.add(10.0 + 0.01 * (i - 3 * (i % 2)), "imu_link", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
        except ValueError as error:
            faults.append(str(error))
    assert "in g" in faults[0]


def test_trusted_imu_may_shake():
    imu = imu_input()
    feed(imu)
    out, faults = feed(imu, accel=(5.0, 0.0, 2.0), start_s=20.0)
    assert len(out) == 200 and not faults


def test_numbers_that_are_not_finite_go_on_to_the_filter_that_counts_them():
    imu = imu_input()
    feed(imu, count=50)
    assert len(feed(imu, gyro=(np.nan, 0.0, 0.0), start_s=10.5, count=3)[0]) == 3
    assert len(feed(imu_input(), accel=(np.inf, 0.0, 0.0), count=3)[0]) == 3


def test_unknown_frame_is_refused():
    assert feed(imu_input(), "elsewhere", count=2)[1] == ["unknown elsewhere"] * 2


@pytest.mark.parametrize("rate, said", [(0.5 * 57.3, "deg/s"), (-0.5, "other way")])
def test_rates_are_judged_by_a_turn_of_the_wheels(rate, said):
    out, faults = feed(imu_input(), gyro=(0.0, 0.0, rate), wheel_rate=0.5, count=400)
    assert said in faults[0]
    assert 150 < len(out) < 250, "they are used until the wheels have turned by a radian"


def test_turning_as_the_wheels_do_is_right_whatever_they_slip():
    for rate in (0.5, 0.25, 0.0):
        assert not feed(imu_input(), gyro=(0.0, 0.0, rate), wheel_rate=0.5, count=800)[1]


def test_degrees_that_were_told_are_forgotten_after_a_right_turn():
    imu = imu_input()
    feed(imu, gyro=(0.0, 0.0, 28.0), wheel_rate=0.5, count=400)
    out, faults = feed(imu, gyro=(0.0, 0.0, 0.5), wheel_rate=0.5, count=800, start_s=20.0)
    assert out and faults and len(faults) < 420


def test_two_imus_of_two_frames_are_judged_apart():
    imu, faults = imu_input(), []
    for i in range(300):
        for frame in ("imu_link", "flipped"):
            try:
                imu.add(10.0 + 0.01 * i, frame, (0.0, 0.0, 0.0), (0.0, 0.0, G))
            except ValueError as error:
                faults.append(str(error))
    assert faults and all("flipped" in text for text in faults)


def test_wheels_that_slip_on_a_long_straight_way_say_nothing_of_the_imu():
    """The robot bends slowly to one side while its wheels, which slip, seem to bend to the other."""
    out, faults = feed(imu_input(), gyro=(0.0, 0.0, -0.05), count=6000, wheel_rate=0.04)
    assert not faults and len(out) == 6000


def test_sample_that_is_sent_again_and_again_while_the_wheels_turn_the_robot_is_refused():
    imu = imu_input()
    assert not feed(imu, noise=0.0, count=500, wheel_rate=0.0)[1], "of a robot that stands it says nothing"
    out, faults = feed(imu, start_s=15.0, noise=0.0, count=300, wheel_rate=-0.5)
    assert "the same sample" in faults[0] and "turned by 0.2 rad" in faults[0]
    assert len(out) == pytest.approx(40, abs=2) and len(out) + len(faults) == 300
    assert len(feed(imu, start_s=18.0, gyro=(0.0, 0.0, -0.5), count=300, wheel_rate=-0.5)[0]) >= 299, "one that changes is believed at once"


def test_samples_that_come_twice_or_of_a_frame_each_are_not_frozen():
    imu, faults = imu_input(), []
    for i in range(600):
        imu.add_wheels(10.0 + 0.01 * i, 0.5)
        for frame in ("imu_link", "imu_link", "sideways"):
            gyro = (1e-6 * (i % 2), 0.0, 0.5)
            try:
                imu.add(10.0 + 0.01 * i, frame, tuple(MOUNTS[frame].T @ gyro), tuple(MOUNTS[frame].T @ (0.0, 0.0, G)))
            except ValueError as error:
                faults.append(str(error))
    assert not faults


def test_leap_of_the_wheels_stamps_is_no_turn():
    imu = imu_input()
    feed(imu, noise=0.0, count=10, wheel_rate=0.2)
    assert not feed(imu, start_s=90.0, noise=0.0, count=10, wheel_rate=0.2)[1]
