"""What is left of a spinning lidar's revolution, and the level scan made of it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lidar_in_a_room import LIDAR, ROOM_HIGH, ROOM_LOW, TILT, beams, revolution, room_ranges, with_points

from point_cloud2 import BeamCloud
from rigid_geometry import transform_from_rpy
from robot_body import RobotBody
from sweep_assembly import LEVEL_BEAMS, LidarConfig, Revolution, RevolutionChain, RevolutionFilter, ScanFilterConfig, TiltGeometry
from sweep_assembly.revolution import counted_from_below, free_directions

FAR_SIGHTED = ScanFilterConfig(horizontal_max_range_m=20.0)


def level(_: float) -> float:
    return 0.0


def still(_: float) -> np.ndarray:
    return transform_from_rpy((1.0, 0.5, 0.0), (0.0, 0.0, 0.3))


def turning(t: float) -> np.ndarray:
    """0.9 rad/s: 5 deg in a revolution, 20 cm at the end of the obstacle layer."""
    return transform_from_rpy((0.3 * t, 0.1, 0.0), (0.0, 0.0, 0.9 * t))


def filtered(one: Revolution, tilt: float = 0.0, **changes) -> Revolution:
    return RevolutionFilter(ScanFilterConfig(**changes), LIDAR, TILT, RobotBody()).filter(one, np.full(len(one.points), tilt))


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_directions_of_beams_that_met_nothing_follow_from_those_that_did(sense):
    directions, rings, times = beams(sense=sense)
    points = (4.0 * directions).astype(np.float32)
    gone = (np.arange(len(points)) % 7 == 3) | (rings == 15)
    points[gone] = np.nan
    np.testing.assert_allclose(free_directions(Revolution(points, rings, times), LIDAR), directions[gone], atol=1e-5)


def test_where_nothing_at_all_was_met_no_direction_is_known():
    _, rings, times = beams()
    nothing = Revolution(np.full((len(rings), 3), np.nan, np.float32), rings, times)
    assert np.isnan(free_directions(nothing, LIDAR)).any(axis=1).all()
    assert len(filtered(nothing).points) == 0


def test_surfaces_pass_unchanged():
    seen = revolution(1.0, still, level)
    left = filtered(seen)
    np.testing.assert_array_equal(left.points, seen.points)
    np.testing.assert_array_equal(left.times_s, seen.times_s)


def test_readings_too_near_are_dropped_and_those_too_far_met_nothing():
    far = np.array([[9.0, 0.1 * i, 0.0] for i in range(9)])
    far[4] = [31.0, 0.5, 0.0]
    left = filtered(with_points(np.vstack([far, [[0.1, 0.0, 0.0]]])))
    assert len(left.points) == 9 and left.met_nothing.sum() == 1


def test_body_is_dropped_where_it_is_and_where_the_tilt_is_not_known():
    deck = with_points(np.array([[0.1, 0.0, -0.9], [2.0, 0.0, 0.0]]))
    assert len(filtered(deck).points) == 1
    assert len(filtered(deck, math.nan).points) == 1
    assert len(filtered(deck, math.pi / 2).points) == 2  # nose down, the same reading lies behind the robot


def test_single_point_between_an_edge_and_the_background_is_veiled_but_a_wall_at_a_low_angle_is_not():
    azimuths = -np.arange(40) * 0.4 * math.pi / 180
    ranges = np.where(np.arange(40) < 20, 2.0, 8.0)
    ranges[20] = 5.0
    around = np.stack([ranges * np.cos(azimuths), ranges * np.sin(azimuths), np.zeros(40)], axis=1)
    edge = Revolution(around.astype(np.float32), np.full(40, 7, np.uint16), np.arange(40) * 0.1 / 900)
    left = filtered(edge)
    assert len(left.points) == 39 and not (np.abs(np.linalg.norm(left.points, axis=1) - 5.0) < 0.5).any()
    other_ring = Revolution(edge.points, np.where(np.arange(40) <= 20, 7, 8).astype(np.uint16), edge.times_s)
    assert len(filtered(other_ring).points) == 40


def test_point_behind_a_wall_that_is_seen_at_a_low_angle_is_veiled_and_the_wall_is_not():
    """Along the wall, ranges of beams 0.4 deg apart differ by as much as those of a laser's beams across an edge."""
    ranges = np.array([5.19, 5.19, 5.20, 5.20, 3.90, 3.28, 3.09, 2.92, 2.77, 2.63, 2.51])
    azimuths = -np.arange(len(ranges)) * 0.4 * math.pi / 180
    around = np.stack([ranges * np.cos(azimuths), ranges * np.sin(azimuths), np.zeros(len(ranges))], axis=1)
    left = filtered(Revolution(around.astype(np.float32), np.full(len(ranges), 7, np.uint16), np.arange(len(ranges)) * 0.1 / 900))
    np.testing.assert_allclose(np.linalg.norm(left.points, axis=1), np.delete(ranges, 4), atol=1e-5)


def without_echo(gone: np.ndarray, other_m: float = 4.0) -> Revolution:
    """Walls at `other_m`, but for the beams that are gone."""
    directions, rings, times = beams(900)
    points = (other_m * directions).astype(np.float32)
    points[gone] = np.nan
    return Revolution(points, rings, times)


def test_direction_in_which_no_ring_has_an_echo_is_not_known_to_be_free():
    """A driver gives NaN also for what is nearer than its own min_range: a person beside the robot has no echo in any ring."""
    _, rings, times = beams(900)
    person = (times > 0.0499) & (times < 0.0553)  # from 180 to 199 deg
    left = filtered(without_echo(person))
    assert not left.met_nothing.any() and len(left.points) == (~person).sum()
    some = filtered(without_echo(person & (rings != 3)))
    assert some.met_nothing.sum() == (person & (rings != 3)).sum(), "a ring below has its echo behind what would be too near"


def test_sky_above_walls_and_walls_beyond_the_range_are_free():
    _, rings, times = beams(900)
    sky = rings > 8
    assert filtered(without_echo(sky)).met_nothing.sum() == sky.sum()
    assert filtered(without_echo(rings > 99, other_m=31.0)).met_nothing.all()


def test_echo_of_the_robot_itself_or_too_near_does_not_tell_that_its_direction_is_free():
    _, rings, times = beams(900)
    seen = without_echo((times > 0.0499) & (times < 0.0553))
    for near in (np.float32([0.1, 0.0, 0.0]), np.float32([0.1, 0.0, -0.9])):  # below min_range_m, and on the deck
        points = seen.points.copy()
        points[seen.met_nothing & (rings == 0)] = near
        assert not filtered(Revolution(points, rings, times)).met_nothing.any()


def test_free_beam_through_the_robot_is_dropped_and_one_past_it_kept():
    """Nose down by 80 deg the lidar looks at its own mast, too near for an echo; that is not the way to an abyss."""
    directions, rings, times = beams()
    points = (4.0 * directions).astype(np.float32)
    points[::5] = np.nan
    seen = Revolution(points, rings, times)
    level_left, down_left = filtered(seen).met_nothing.sum(), filtered(seen, 1.4).met_nothing.sum()
    assert level_left == seen.met_nothing.sum()
    assert 0 < down_left < level_left


def chain(config=FAR_SIGHTED) -> RevolutionChain:
    return RevolutionChain(config, LIDAR, TILT, RobotBody())


def inputs(pose, tilt_at=level, begin=1.0, turns=3) -> dict[str, list[tuple[float, object]]]:
    """Joints every 25 ms, odometry every 50 ms, revolutions that begin every 100 ms."""
    end = begin + turns * LIDAR.duration_s
    return {
        "joint": [(t, tilt_at(t)) for t in np.arange(begin, end + 1e-6, 0.025).round(6)],
        "odometry": [(t, pose(t)) for t in np.arange(begin, end + 1e-6, 0.05).round(6)],
        "revolution": [(t, revolution(t, pose, tilt_at)) for t in np.arange(begin, end - 1e-6, 0.1).round(6)],
    }


def feed(target: RevolutionChain, topic: str, stamp: float, value: object) -> None:
    {"joint": target.add_joint, "odometry": target.add_odometry, "revolution": target.add_revolution}[topic](stamp, value)


def run(target: RevolutionChain, given_: dict) -> list:
    """Everything in the order of the stamps of its last part, as a driver sends it."""
    late = {"joint": 0.0, "odometry": 0.01, "revolution": LIDAR.duration_s + 0.02}
    rows = sorted((stamp + late[topic], topic, i) for topic, values in given_.items() for i, (stamp, _) in enumerate(values))
    out = []
    for _, topic, i in rows:
        feed(target, topic, *given_[topic][i])
        out += list(target.poll())
    return out


TURNING = inputs(turning)


def test_every_stamp_of_the_odometry_is_answered_once_in_order():
    answers = run(chain(), TURNING)
    stamps = [a.end_stamp_s for a in answers]
    whole = [a.end_stamp_s for a in answers if a.revolution is not None]
    assert whole == pytest.approx([1.1, 1.2, 1.3])
    assert stamps == sorted(stamps)
    assert set(np.round(stamps, 3)) == {1.0, 1.05, 1.1, 1.15, 1.2, 1.25, 1.3}
    after_the_first = [s for s in stamps if s > 1.1 + 1e-6]
    assert len(after_the_first) == len(set(np.round(after_the_first, 3)))


def test_level_scan_is_the_room_as_seen_from_where_the_robot_is_at_the_end():
    (last,) = [a for a in run(chain(), TURNING) if a.revolution is not None and a.end_stamp_s > 1.29]
    known = np.isfinite(last.level_ranges)
    assert known.sum() >= 115  # of 120 columns
    angles = -math.pi + (np.arange(LEVEL_BEAMS)[known] + 0.5) * 2.0 * math.pi / LEVEL_BEAMS
    T = np.tile(turning(1.3) @ TILT.base_from_laser(0.0)[0], (known.sum(), 1, 1))
    directions = np.stack([np.cos(angles), np.sin(angles), np.zeros(angles.size)], axis=1)
    expected = room_ranges(T, directions)
    assert np.abs(last.level_ranges[known] - expected).max() < 0.07  # half a beam of the level scan, at a low angle
    assert np.median(np.abs(last.level_ranges[known] - expected)) < 0.01


def test_beyond_the_short_range_nothing_is_there():
    ranges = [a.level_ranges for a in run(chain(ScanFilterConfig()), TURNING) if a.revolution is not None][-1]
    assert np.isinf(ranges).sum() > 50 and np.nanmax(ranges[np.isfinite(ranges)]) <= 2.5


def test_level_scan_of_a_beam_that_met_nothing_says_so():
    given_ = inputs(still)
    for i, (stamp, one) in enumerate(given_["revolution"]):
        points = one.points.copy()
        points[(one.points[:, 0] < 0.0) & (one.rings > 4)] = np.nan  # those below meet the floor
        given_["revolution"][i] = (stamp, Revolution(points, one.rings, one.times_s))
    ranges = [a.level_ranges for a in run(chain(), given_) if a.revolution is not None][-1]
    behind = np.abs(-math.pi + (np.arange(LEVEL_BEAMS) + 0.5) * 2.0 * math.pi / LEVEL_BEAMS) > math.pi / 2 + 0.05
    assert not np.isfinite(ranges[behind]).any() and np.isposinf(ranges[behind]).sum() > 50


def test_tilted_lidar_gives_no_level_scan():
    answers = run(chain(), inputs(still, lambda t: 0.2))
    assert all(np.isnan(a.level_ranges).all() for a in answers) and any(a.revolution is not None for a in answers)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.randoms(use_true_random=False))
def test_order_between_topics_does_not_matter(random):
    def whole(answers):
        return [(a.end_stamp_s, a.revolution.points.tobytes(), a.level_ranges.tobytes()) for a in answers if a.revolution is not None]

    def part(first_turn):
        ends = {"joint": 0.0, "odometry": 0.0, "revolution": LIDAR.duration_s}
        return {topic: [r for r in rows if (r[0] + ends[topic] < 1.1 + 1e-6) == first_turn] for topic, rows in TURNING.items()}

    expected, target = run(chain(), TURNING), chain()
    answers, queues = run(target, part(True)), part(False)
    while any(queues.values()):
        feed(target, topic := random.choice([t for t, rows in queues.items() if rows]), *queues[topic].pop(0))
        answers += list(target.poll())
    assert whole(answers) == whole(expected)
    assert [round(a.end_stamp_s, 3) for a in answers][-4:] == [1.15, 1.2, 1.25, 1.3]


def test_nothing_is_given_out_before_joints_and_odometry_reach_the_end():
    for silent in ("joint", "odometry"):
        target = chain()
        cut = {topic: [r for r in rows if topic != silent or r[0] < 1.09] for topic, rows in inputs(still, turns=1).items()}
        assert not [a for a in run(target, cut) if a.revolution is not None]
        feed(target, silent, *inputs(still, turns=1)[silent][-1])
        assert len([a for a in target.poll() if a.revolution is not None]) == 1


def test_mount_that_is_sampled_a_thousand_times_a_second_is_known_for_the_whole_revolution():
    given_ = inputs(still, turns=2)
    given_["joint"] = [(t, 0.0) for t in np.arange(1.0, 1.3, 0.001).round(6)]
    ranges = [a.level_ranges for a in run(chain(), given_) if a.revolution is not None]
    assert len(ranges) == 2 and all(np.isfinite(r).sum() > 100 for r in ranges)


def test_driver_may_stamp_with_the_last_beam():
    one, (answer, *_) = revolution(1.0, still, level), [a for a in run(chain(), inputs(still, turns=1)) if a.revolution is not None]
    given_ = inputs(still, turns=1) | {"revolution": [(1.1, Revolution(one.points, one.rings, one.times_s - 0.1))]}
    (last,) = [a for a in run(chain(), given_) if a.revolution is not None]
    assert last.end_stamp_s == pytest.approx(answer.end_stamp_s)
    np.testing.assert_array_equal(last.level_ranges, answer.level_ranges)


@pytest.mark.parametrize(("shift_s", "stretch"), [(-0.2, 1.0), (0.2, 1.0), (0.0, 3.0)])
def test_revolution_whose_times_are_not_of_a_turn_around_its_stamp_is_refused(shift_s, stretch):
    one = revolution(1.0, still, level)
    with pytest.raises(ValueError, match=r"within one turn, 0\.100 s, of its stamp, not"):
        chain().add_revolution(1.0, Revolution(one.points, one.rings, stretch * one.times_s + shift_s))


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("staggered_deg", [0.0, 3.0])
@pytest.mark.parametrize(("rate_hz", "said"), [(10.0, ""), (10.4, ""), (12.0, "12"), (20.0, "20"), (40.0, "40")])
def test_revolution_that_turns_faster_than_configured_is_refused(rate_hz, said, sense, staggered_deg):
    """With 20 Hz in place of 10 its free beams would be placed up to half a turn off."""
    directions, rings, times = beams(900, sense)
    aside = math.radians(staggered_deg) * (rings.astype(float) % 2.0 * 2.0 - 1.0)  # of two rings one looks ahead, the other behind
    x, y = (
        np.cos(aside) * directions[:, 0] - np.sin(aside) * directions[:, 1],
        np.sin(aside) * directions[:, 0] + np.cos(aside) * directions[:, 1],
    )
    points = (4.0 * np.stack([x, y, directions[:, 2]], axis=1)).astype(np.float32)
    points[(times > 0.02) & (times < 0.05)] = np.nan
    one = Revolution(points, rings, times * LIDAR.rate_hz / rate_hz)
    if not said:
        return chain().add_revolution(1.0, one)
    with pytest.raises(ValueError, match=rf"turns {said}\.?\d* times a second, .* 10: set lidar/rate_hz"):
        chain().add_revolution(1.0, one)


def test_few_echoes_do_not_tell_how_fast_a_lidar_turns():
    directions, rings, times = beams(900)
    points = np.full(directions.shape, np.nan, np.float32)
    points[5:50] = directions[5:50]
    chain().add_revolution(1.0, Revolution(points, rings, times * 0.5))


def test_rings_that_count_downwards_are_turned_round():
    one = revolution(1.0, still, level)
    downwards = Revolution(one.points, (LIDAR.rings - 1 - one.rings).astype(np.uint16), one.times_s)
    for given_ in (one, downwards):
        np.testing.assert_array_equal(counted_from_below(given_, LIDAR).rings, one.rings)
    with pytest.raises(ValueError, match="cloud of ring 15, of a lidar with 8 rings"):
        counted_from_below(one, LidarConfig(rings=8))


def test_driver_s_cloud_becomes_beams_in_the_order_of_their_times():
    cloud = BeamCloud(np.eye(3), np.array([0, 1, 2]), np.array([0.02, 0.0, 0.01]))
    one = Revolution.of(cloud)
    assert one.rings.tolist() == [1, 2, 0] and one.points[0].tolist() == [0.0, 1.0, 0.0]
    with pytest.raises(ValueError, match="without fields ring or line or channel: a lidar that moves"):
        Revolution.of(BeamCloud(np.eye(3), None, np.zeros(3)))


def test_late_revolution_is_counted_and_time_that_jumps_back_starts_afresh():
    target = chain()
    run(target, inputs(still, begin=50.0))
    target.add_revolution(50.05, revolution(50.05, still, level))
    assert target.dropped["revolution_late"] == 1
    assert len([a for a in run(target, inputs(still, begin=1.0)) if a.revolution is not None]) >= 2
    assert target.dropped["time_jump"] >= 1


def test_empty_revolution_passes():
    target, given_ = chain(), inputs(still, turns=1)
    given_["revolution"] = [(1.0, with_points(np.zeros((0, 3))))]
    (answer,) = [a for a in run(target, given_) if a.revolution is not None]
    assert len(answer.revolution.points) == 0 and np.isnan(answer.level_ranges).all()


def test_shapes_that_do_not_agree_and_wrong_lidars_are_refused():
    with pytest.raises(ValueError, match=r"\(N, 3\) points"):
        Revolution(np.zeros((3, 3), np.float32), np.zeros(2, np.uint16), np.zeros(3))
    with pytest.raises(ValueError, match="lowest_rad"):
        RevolutionFilter(ScanFilterConfig(), LidarConfig(lowest_rad=0.3, highest_rad=0.2), TILT, RobotBody())
    assert (ROOM_LOW < ROOM_HIGH).all()


@pytest.mark.parametrize(("pitch_rad", "seen"), [(0.0, True), (math.radians(25.0), False)])
def test_level_scan_is_not_made_of_rings_that_meet_the_ground(pitch_rad, seen):
    mount = TiltGeometry(transform_from_rpy((0.23, 0.0, 0.79), (0.0, pitch_rad, 0.0)), np.eye(4))
    chain = RevolutionChain(FAR_SIGHTED, LIDAR, mount, RobotBody())
    for t in (0.9, 1.0, 1.05, 1.1, 1.15):
        chain.add_joint(t, 0.0)
        chain.add_odometry(t, still(t))
    chain.add_revolution(1.0, revolution(1.0, still, level))
    (whole,) = [done for done in chain.poll() if done.revolution is not None]
    assert np.isfinite(whole.level_ranges).any() == seen
    assert len(whole.revolution.points) > 1000
