"""The fused odometry against exact motions: where it must be exact, how fast it may drift, and whether it knows."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kinematic_robot import Errors, Motion, simulate
from scipy.spatial.transform import Rotation

from odometry_fusion import OdometryConfig, OdometryFilter
from odometry_fusion.error_state import POSITION
from odometry_fusion.track import carried, track_covariance
from rigid_geometry import LeapWatch, inverse, rotation_from_rpy, rpy_from_rotation, yaw_of
from robot_body import RobotBody

REST = Motion(2.0)


def drive(motions, errors=None, seed=0, R_start=None):
    return simulate(motions, errors or Errors(), np.random.default_rng(seed), R_start)


def estimates(data, odometry=None):
    """One estimate a wheel message, as in lock-step."""
    odometry = odometry or OdometryFilter(OdometryConfig(), RobotBody())
    pending, found = list(data.imu), []
    for stamp, v, w in data.wheels:
        while pending and pending[0][0] <= stamp:
            odometry.add_imu(*pending.pop(0))
        odometry.add_wheels(stamp, v, w)
        found.append(odometry.estimate(stamp))
    return found


def pose_error(data, estimate):
    """(6,) true minus estimated: position and rotation in odom, which is the true frame at the first wheel message."""
    T_true = data.truth[estimate.stamp_s]
    T = estimate.T_odom_base
    return np.r_[T_true[:3, 3] - T[:3, 3], Rotation.from_matrix(T_true[:3, :3] @ T[:3, :3].T).as_rotvec()]


def tour(rng):
    """Five legs with turns and ramps, a stop of five seconds after each."""
    motions = [Motion(3.0)]
    for _ in range(5):
        pitch = float(rng.uniform(-0.2, 0.2))
        motions += [Motion(float(rng.uniform(2, 7)), 0.5), Motion(float(rng.uniform(0.5, 2)), 0.1, float(rng.choice([-0.8, 0.8])))]
        motions += [Motion(float(rng.uniform(1, 4)), 0.4, float(rng.uniform(-0.2, 0.2)))]
        motions += [Motion(1, 0.4, 0, pitch), Motion(3, 0.5), Motion(1, 0.4, 0, -pitch), Motion(1.5), Motion(5.0)]
    return motions


def stops(found):
    """The last estimate of every time of standing."""
    return [e for e, after in zip(found, [*found[1:], None], strict=True) if e.standing and (after is None or not after.standing)]


@pytest.fixture(scope="module")
def tours():
    """Ten tours with drawn errors of the sensors, each with its estimates."""
    found = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        data = simulate(tour(rng), Errors.drawn(rng), rng)
        found.append((data, estimates(data)))
    return found


def test_straight_drive_gives_its_length():
    data = drive([REST, Motion(10.0, 0.5), REST])
    assert estimates(data)[-1].T_odom_base[:3, 3] == pytest.approx([5.0, 0.0, 0.0], abs=5e-3)


def test_circle_comes_back_to_its_start():
    data = drive([REST, Motion(2 * math.pi / 0.4, 0.4, 0.4), REST])
    last = estimates(data)[-1]
    assert np.abs(pose_error(data, last)[:3]).max() < 0.01
    assert abs(pose_error(data, last)[5]) < 1e-3


def test_ramp_climbs():
    """Nose up by 0.3 rad, 5 s at 0.5 m/s: z rises by 2.5 sin 0.3."""
    data = drive([REST, Motion(1.0, 0.0, 0.0, -0.3), Motion(5.0, 0.5), REST])
    last = estimates(data)[-1]
    assert last.T_odom_base[2, 3] == pytest.approx(2.5 * math.sin(0.3), abs=5e-3)
    assert rpy_from_rotation(last.T_odom_base[:3, :3])[1] == pytest.approx(-0.3, abs=1e-3)


@pytest.mark.parametrize("rpy", [(0.0, 0.0, 0.0), (0.1, -0.2, 0.0), (-0.3, 0.35, 0.0)])
def test_first_estimate_is_level_and_refines_at_rest(rpy):
    errors = Errors(accel_noise=0.05, gyro_noise=0.005)
    found = estimates(drive([Motion(3.0)], errors, R_start=rotation_from_rpy(*rpy)))
    first, last = (np.array(rpy_from_rotation(e.T_odom_base[:3, :3])) for e in (found[0], found[-1]))
    assert first == pytest.approx(rpy, abs=0.012)
    assert last == pytest.approx(rpy, abs=0.0015)
    assert found[-1].pose_covariance[3, 3] < found[0].pose_covariance[3, 3]


def test_every_tick_from_the_first_has_an_estimate():
    data = drive([Motion(1.0)])
    found = estimates(data)
    assert [e.stamp_s for e in found] == [stamp for stamp, _, _ in data.wheels]


def test_gyroscope_bias_is_learnt_while_standing_and_yaw_does_not_creep():
    errors = Errors(gyro_bias=np.array([0.003, -0.002, 0.004]))
    data = drive([Motion(10.0), Motion(30.0, 0.5)], errors)
    found = estimates(data)
    at_rest = found[195]
    assert at_rest.standing and abs(yaw_of(at_rest.T_odom_base)) < 2e-3
    assert abs(yaw_of(found[-1].T_odom_base)) < math.radians(0.3)


def test_wheels_that_slip_in_turns_do_not_turn_the_estimate():
    data = drive([REST, Motion(4.0, 0.0, 0.8), REST], Errors(turning_slip=0.15))
    assert abs(pose_error(data, estimates(data)[-1])[5]) < 5e-3


def test_yaw_and_position_drift_stay_small_on_tours(tours):
    """Yaw under 0.5 deg a minute of driving: 0.32 over 24 tours, all of it the gyroscope's white noise."""
    yaw_deg_per_min, sigmas, share_of_path = [], [], []
    for data, found in tours:
        error, last = pose_error(data, found[-1]), found[-1]
        driving_min = sum(not e.standing for e in found) * 0.05 / 60.0
        yaw_deg_per_min.append(math.degrees(abs(error[5])) / driving_min)
        sigmas.append(abs(error[5]) / math.sqrt(last.pose_covariance[5, 5]))
        share_of_path.append(np.linalg.norm(error[:3]) / data.path_m)
    assert np.mean(yaw_deg_per_min) < 0.5
    assert max(sigmas) < 3.5
    assert np.mean(share_of_path) < 0.02


@pytest.mark.parametrize(
    "errors", [Errors(), Errors(turning_slip=0.1, skid_m=0.1), Errors(gyro_bias=np.full(3, 0.002)), Errors(accel_bias=np.full(3, 0.04))]
)
def test_nothing_but_noise_makes_yaw_drift(errors):
    data = simulate(tour(np.random.default_rng(1)), errors, np.random.default_rng(2))
    assert abs(pose_error(data, estimates(data)[-1])[5]) < math.radians(0.02)


def test_covariance_gained_between_stops_is_honest(tours):
    """Mean NEES of six degrees of freedom, and none that would be one in a million."""
    nees = []
    for data, found in tours:
        at = stops(found)
        for a, b in zip(at, at[1:], strict=False):
            carry, to_b = carried(b.T_odom_base[:3, 3] - a.T_odom_base[:3, 3]), np.kron(np.eye(2), b.T_odom_base[:3, :3].T)
            gained = to_b @ (b.pose_covariance - carry @ a.pose_covariance @ carry.T) @ to_b.T
            error = inverse(b.T_odom_base) @ a.T_odom_base @ inverse(data.truth[a.stamp_s]) @ data.truth[b.stamp_s]
            e = np.r_[error[:3, 3], Rotation.from_matrix(error[:3, :3]).as_rotvec()]
            nees.append(e @ np.linalg.solve(gained, e))
    assert len(nees) == 50
    assert 3.0 < np.mean(nees) < 12.0
    assert max(nees) < 40.0


def test_up_is_known_at_least_as_well_as_the_pose_says(tours):
    """As `odometry_gravity` reads it; the covariance is summed up from stop to stop, and so says too much."""
    ratio = []
    for data, found in tours:
        for e in stops(found):
            angle = np.linalg.norm(np.cross(data.truth[e.stamp_s][2, :3], e.T_odom_base[2, :3]))
            ratio.append(angle**2 / (2.0 * e.pose_covariance[[3, 4], [3, 4]].max()))
    assert 0.02 < np.mean(ratio) < 2.0


def test_covariance_grows_while_driving_and_not_while_standing():
    data = drive([Motion(3.0), Motion(6.0, 0.5, 0.1), Motion(8.0)], Errors(gyro_noise=0.005, accel_noise=0.05))
    found = estimates(data)
    volume = [np.trace(e.pose_covariance[:3, :3]) + e.pose_covariance[5, 5] for e in found]
    driving = volume[70:175]
    assert all(b > a for a, b in zip(driving, driving[1:], strict=False))
    assert found[200].standing and volume[-1] <= volume[200] * 1.02
    assert all(np.linalg.eigvalsh(e.pose_covariance).min() > 0.0 for e in found[::10])


def test_standing_is_told_only_when_wheels_and_body_are_still():
    data = drive([REST, Motion(2.0, 0.3), REST])
    flags = np.array([e.standing for e in estimates(data)])
    assert not flags[:9].any() and flags[12:40].all() and not flags[42:92].any() and flags[-20:].all()


def test_a_robot_that_rocks_on_still_wheels_is_followed():
    """Over fast, at 0.025 rad/s, and back slowly, at 0.01: what is slow counts as much."""
    beats = [Motion(0.2, 0.0, 0.0, 0.025), Motion(0.4, 0.0, 0.0, -0.01)] * 8
    data = drive([REST, *beats, Motion(0.3), REST], Errors(gyro_bias=np.array([0.001, -0.002, 0.001])))
    found = estimates(data)
    assert not any(e.standing for e in found[42:130]) and found[-1].standing
    tilt = np.array([(pose_error(data, e) - pose_error(data, found[39]))[3:5] for e in found[40:]])
    assert np.linalg.norm(tilt, axis=1).max() < math.radians(0.03)


def test_an_unknown_bias_is_no_rocking():
    """1.5 times the sigma that the filter expects, on each axis: it stands, and learns it."""
    data = drive([REST, REST], Errors(gyro_bias=np.full(3, 0.0075), gyro_noise=0.005))
    found = estimates(data)
    assert found[12].standing and found[-1].standing


def test_twist_is_the_motion_of_the_body():
    found = estimates(drive([REST, Motion(3.0, 0.4, 0.2)]))
    assert found[-1].twist == pytest.approx([0.4, 0, 0, 0, 0, 0.2], abs=0.01)
    assert found[20].twist == pytest.approx(np.zeros(6), abs=1e-3)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(st.randoms(use_true_random=False))
def test_order_between_topics_and_earlier_questions_do_not_matter(random):
    data = drive([Motion(0.5), Motion(1.0, 0.5, 0.3), Motion(0.6)], Errors(gyro_noise=0.005, accel_noise=0.05))
    expected = {e.stamp_s: e for e in estimates(data)}
    odometry, asked = OdometryFilter(OdometryConfig(), RobotBody()), [s for s in expected if random.random() < 0.7]
    asked = sorted({*asked, data.wheels[-1][0]} | {s + 0.013 for s in asked[:-1]})
    imu, wheels = list(data.imu), list(data.wheels)
    while imu or wheels:
        for _ in range(random.choice([1, 5, 40])):
            if imu and (random.random() < 0.8 or not wheels):
                odometry.add_imu(*imu.pop(0))
            elif wheels:
                odometry.add_wheels(*wheels.pop(0))
        while asked and (e := odometry.estimate(asked[0])) is not None:
            stamp = asked.pop(0)
            if stamp in expected:
                np.testing.assert_array_equal(e.T_odom_base, expected[stamp].T_odom_base)
                np.testing.assert_array_equal(e.pose_covariance, expected[stamp].pose_covariance)
    assert asked == []


def test_estimate_waits_for_both_inputs_up_to_its_stamp():
    odometry = OdometryFilter(OdometryConfig(), RobotBody())
    for i in range(1, 11):
        odometry.add_imu(i * 0.01, np.zeros(3), [0, 0, 9.81])
    assert odometry.estimate(0.05) is None and odometry.complete_until_s is None
    odometry.add_wheels(0.05, 0.0, 0.0)
    assert odometry.complete_until_s == pytest.approx(0.05, abs=1e-5)
    assert odometry.estimate(0.05) is not None
    assert odometry.estimate(0.07) is None
    odometry.add_wheels(0.10, 0.0, 0.0)
    assert odometry.estimate(0.07).stamp_s == pytest.approx(0.07)
    assert odometry.estimate(0.11) is None
    assert odometry.estimate(0.02) is None  # before the first wheel message
    with pytest.raises(ValueError, match="finite"):
        odometry.estimate(math.nan)


def test_stamps_that_differ_by_rounding_are_the_same_instant():
    data = drive([Motion(1.0), Motion(2.0, 0.5)])
    jitter = np.random.default_rng(2)
    imu = [(stamp + jitter.uniform(-2e-7, 2e-7), gyro, accel) for stamp, gyro, accel in data.imu]
    found = estimates(type(data)([(min(s, round(s, 2)), g, a) for s, g, a in imu], data.wheels, data.truth, data.path_m))
    exact = estimates(data)
    assert all(e is not None for e in found)
    np.testing.assert_allclose(found[-1].T_odom_base, exact[-1].T_odom_base, atol=1e-5)
    odometry = OdometryFilter(OdometryConfig(), RobotBody())
    for sample in data.imu:
        odometry.add_imu(*sample)
    for message in data.wheels:
        odometry.add_wheels(*message)
    asked = [odometry.estimate(e.stamp_s + jitter.uniform(-2e-7, 2e-7)) for e in exact]
    np.testing.assert_array_equal(asked[-1].T_odom_base, exact[-1].T_odom_base)


def test_estimate_between_wheel_messages_lies_between_theirs():
    data = drive([REST, Motion(4.0, 0.5)])
    odometry = OdometryFilter(OdometryConfig(), RobotBody())
    for sample in data.imu:
        odometry.add_imu(*sample)
    for message in data.wheels:
        odometry.add_wheels(*message)
    x = [odometry.estimate(s).T_odom_base[0, 3] for s in (5.0, 5.02, 5.05)]
    assert x[1] - x[0] == pytest.approx(0.01, abs=1e-4) and x[2] - x[0] == pytest.approx(0.025, abs=1e-4)


def test_unreadable_late_and_repeated_samples_are_dropped_and_counted():
    odometry = OdometryFilter(OdometryConfig(), RobotBody())
    odometry.add_imu(1.0, np.zeros(3), [0, 0, 9.81])
    odometry.add_imu(1.0, np.zeros(3), [0, 0, 9.81])
    odometry.add_imu(1.01, [0, np.nan, 0], [0, 0, 9.81])
    odometry.add_wheels(1.0, math.inf, 0.0)
    odometry.add_wheels(1.0, 0.0, 0.0)
    odometry.add_wheels(0.9, 0.0, 0.0)
    assert odometry.dropped == {"imu_late": 1, "imu_not_finite": 1, "wheels_not_finite": 1, "wheels_late": 1}
    assert odometry.estimate(1.0) is not None
    with pytest.raises(ValueError, match="three rates"):
        odometry.add_imu(1.1, np.zeros(2), np.zeros(3))


def test_time_that_jumps_back_starts_afresh():
    data = drive([REST, Motion(2.0, 0.5)])
    odometry = OdometryFilter(OdometryConfig(), RobotBody())
    estimates(data, odometry)
    again = estimates(data, odometry)
    assert odometry.dropped["time_jump"] >= 1
    np.testing.assert_array_equal(again[-1].T_odom_base, estimates(data)[-1].T_odom_base)


def test_bag_that_is_played_once_more_gives_the_same_to_the_bit_but_for_how_sure_it_is_of_its_place():
    data = drive([REST, Motion(2.0, 0.5), REST, Motion(1.0, 0.2, 0.5)])
    odometry = OdometryFilter(OdometryConfig(), RobotBody())
    _, second, third = (estimates(data, odometry) for _ in range(3))
    for one, other, fresh in zip(second, third, estimates(data), strict=True):
        for found in (one, other):
            np.testing.assert_array_equal(found.T_odom_base, fresh.T_odom_base)
            np.testing.assert_array_equal(found.twist, fresh.twist)
            np.testing.assert_array_equal(found.pose_covariance[3:, 3:], fresh.pose_covariance[3:, 3:])
            assert found.standing == fresh.standing


def leaps_of(found, watch):
    return [watch.leapt(one.pose_covariance[0, 0], one.pose_covariance[1, 1]) for one in found if one is not None]


@pytest.mark.parametrize("lost_m", [0.0, 30.0])
def test_robot_whose_clock_was_set_back_knows_nothing_of_the_way_to_its_first_estimate(lost_m):
    """x was 10 m before, and 0 after with a sigma of a millimetre: nobody looked where the robot is.

    So it is when the clock is set back once more, and after the robot was carried.
    """
    data = drive([REST, Motion(4.0, 0.5)])
    odometry, watch = OdometryFilter(OdometryConfig(), RobotBody()), LeapWatch()
    first = estimates(data, odometry)
    assert not any(leaps_of(first, watch)) and not any(one.displaced for one in first)
    state = odometry._track.state
    np.einsum("ii->i", state.covariance)[POSITION] += lost_m**2
    watch.leapt(*np.diag(track_covariance(odometry._track))[:2])
    for _ in range(2):
        again = [one for one in estimates(data, odometry) if one is not None]
        told = [one.displaced for one in again]
        assert told[0] == "the clock was set back" and not any(told[1:])
        assert leaps_of(again, watch) == [bool(why) for why in told]


def test_clock_that_is_set_back_twice_before_anything_is_known_again_is_told_all_the_same():
    odometry = OdometryFilter(OdometryConfig(), RobotBody())
    for stamp_s in (9.0, 5.0, 2.0):
        odometry.add_wheels(stamp_s, 0.0, 0.0)
        odometry.add_imu(stamp_s, np.zeros(3), [0, 0, 9.81])
        if stamp_s != 5.0:
            estimate = odometry.estimate(stamp_s)
    assert estimate.displaced == "the clock was set back"


def test_clock_that_is_set_back_before_anything_is_known_displaces_nobody():
    odometry = OdometryFilter(OdometryConfig(), RobotBody())
    for stamp_s in (9.0, 9.01, 2.0, 2.01):
        odometry.add_wheels(stamp_s, 0.0, 0.0)
        odometry.add_imu(stamp_s, np.zeros(3), [0, 0, 9.81])
    assert odometry.dropped == {"time_jump": 1}
    first = odometry.estimate(2.0)
    assert first.displaced == "" and first.pose_covariance[0, 0] < 1.0


@pytest.mark.parametrize(("early_for_s", "afresh"), [(0.36, False), (1.5, True)])
def test_imu_alone_that_stamps_too_early_for_a_moment_is_late_and_the_filter_goes_on(early_for_s, afresh):
    """Found by chaos: stamps 3 s too early for 0.36 s, and the filter began again, tilted, in a motion."""
    data = drive([REST, Motion(6.0, 0.5)])
    early = type(data)(
        [(s - 3.0 if 4.0 < s < 4.0 + early_for_s else s, *rest) for s, *rest in data.imu], data.wheels, data.truth, data.path_m
    )
    odometry = OdometryFilter(OdometryConfig(), RobotBody())
    last = estimates(early, odometry)[-1]
    assert (odometry.dropped.get("time_jump", 0) > 0) is afresh and (odometry.dropped.get("imu_late", 0) > 30) is not afresh
    if not afresh:
        np.testing.assert_allclose(last.T_odom_base, estimates(data)[-1].T_odom_base, atol=0.05)


@pytest.mark.parametrize("source", ["imu", "wheels"])
def test_stamp_far_ahead_is_no_clock_that_was_set(source):
    """One message of one input, 10 s ahead: after it all that is right would lie before the newest."""
    data = drive([REST, Motion(4.0, 0.5)])
    odometry, found = OdometryFilter(OdometryConfig(), RobotBody()), []
    messages = sorted([(row[0], "imu", row) for row in data.imu] + [(row[0], "wheels", row) for row in data.wheels])
    for stamp_s, name, row in messages:
        is_wrong = name == source and 5.0 <= stamp_s < 5.0 + (0.0099 if name == "imu" else 0.0499)
        (odometry.add_imu if name == "imu" else odometry.add_wheels)(stamp_s + 10.0 * is_wrong, *row[1:])
        if name == "wheels" and not is_wrong:
            found.append(odometry.estimate(stamp_s))
    found = [estimate for estimate in found if estimate is not None]
    assert odometry.dropped == {f"{source}_ahead": 1}
    assert np.linalg.norm(pose_error(data, found[-1])[:3]) < 0.03


def test_pause_of_both_inputs_is_believed_with_the_first_of_each():
    data = drive([REST, Motion(4.0, 0.0)])
    kept = [[row for row in rows if not 3.0 < row[0] < 4.2] for rows in (data.imu, data.wheels)]
    odometry = OdometryFilter(OdometryConfig(), RobotBody())
    found = estimates(type(data)(kept[0], kept[1], data.truth, data.path_m), odometry)
    assert found[-1] is not None and "time_jump" not in odometry.dropped and not any("ahead" in name for name in odometry.dropped)


def test_samples_that_are_held_and_jump_back_once_more_are_counted():
    odometry = OdometryFilter(OdometryConfig(), RobotBody())
    for stamp_s in (9.0, 5.0, 2.0, 2.0, 9.1):
        odometry.add_imu(stamp_s, np.zeros(3), [0, 0, 9.81])
    assert odometry.dropped == {"imu_late": 3}


def test_both_inputs_that_jump_back_start_afresh_at_once():
    odometry = OdometryFilter(OdometryConfig(), RobotBody())
    for stamp_s in (5.0, 5.01, 2.0):
        odometry.add_imu(stamp_s, np.zeros(3), [0, 0, 9.81])
        odometry.add_wheels(stamp_s, 0.0, 0.0)
    assert odometry.dropped == {"time_jump": 1}
    assert odometry.estimate(2.0) is not None and odometry.complete_until_s == pytest.approx(2.0, abs=1e-3)


def test_pause_of_the_imu_inflates_the_attitude_and_is_counted():
    data = drive([REST, Motion(4.0, 0.5)])
    whole = estimates(data)[-1]
    odometry = OdometryFilter(OdometryConfig(), RobotBody())
    gapped = type(data)([s for s in data.imu if not 4.0 < s[0] < 4.4], data.wheels, data.truth, data.path_m)
    for sample in gapped.imu:
        odometry.add_imu(*sample)
    for message in gapped.wheels:
        odometry.add_wheels(*message)
    last = odometry.estimate(data.wheels[-1][0])
    assert odometry.dropped["imu_gap"] >= 7
    assert last.pose_covariance[5, 5] > whole.pose_covariance[5, 5] + 0.1**2


def test_pause_of_the_wheels_inflates_the_position_and_is_counted():
    data = drive([REST, Motion(6.0, 0.5)])
    whole = estimates(data)[-1]
    odometry = OdometryFilter(OdometryConfig(), RobotBody())
    gapped = type(data)(data.imu, [m for m in data.wheels if not 4.0 < m[0] < 6.0], data.truth, data.path_m)
    last = estimates(gapped, odometry)[-1]
    assert odometry.dropped["wheels_gap"] == 1
    assert last.pose_covariance[0, 0] > 2 * whole.pose_covariance[0, 0]
    assert abs(pose_error(data, last)[0]) < 3 * math.sqrt(last.pose_covariance[0, 0])


def test_start_in_free_fall_waits_for_gravity():
    odometry = OdometryFilter(OdometryConfig(), RobotBody())
    odometry.add_imu(1.0, np.zeros(3), np.zeros(3))
    odometry.add_wheels(1.0, 0.0, 0.0)
    assert odometry.estimate(1.0) is None
    assert odometry.dropped == {"start_without_gravity": 1}
    assert odometry.complete_until_s >= 1.0  # so nobody need wait for it


def test_memory_stays_bounded_when_nobody_asks_or_a_topic_is_silent():
    odometry = OdometryFilter(OdometryConfig(buffer_s=2.0), RobotBody())
    for i in range(1000):
        odometry.add_imu(i * 0.01, np.zeros(3), [0, 0, 9.81])
    assert len(odometry._imu) <= 202
    assert odometry.dropped["imu_overflow"] > 700


def test_configuration_is_checked():
    assert OdometryConfig().validate() == []
    with pytest.raises(ValueError, match="gyro_noise"):
        OdometryFilter(OdometryConfig(gyro_noise=-1.0), RobotBody())
