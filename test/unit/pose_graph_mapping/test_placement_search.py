"""The search for placements far from the guess: where it looks, what it finds, and when two placements rival."""

import numpy as np
import pytest
from synthetic_sweeps import corridor, furnished_room, pose, sweep, world_of

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration import placement_search
from pose_graph_mapping.registration.cloud import PointCloud, merged, vertex_cloud, with_normals
from pose_graph_mapping.registration.correlative import (
    SEARCH_APART_M,
    SEARCH_APART_RAD,
    SEARCH_CELL_M,
    SEARCH_LEAST_SHIFT_M,
    SEARCH_LEAST_YAW_RAD,
    SEARCH_PEAKS,
    SEARCH_YAW_RAD,
    SEARCH_YAW_STEP_RAD,
    Window,
    coarse_placements,
    window_of,
)
from pose_graph_mapping.registration.match_quality import Degeneracy, FreeSpace, keep_guess, known_directions, offset_between
from pose_graph_mapping.registration.matching import Verdict
from pose_graph_mapping.registration.methods import create_registration
from rigid_geometry import inverse, rotation_angle, transform_from_rpy

CONFIG = RegistrationConfig()
HALF_TURN = transform_from_rpy((0.0, 0.0, 0.0), (0.0, 0.0, np.pi))


def covariance(yaw_sigma, shift_sigma):
    return np.diag([0.01**2, 0.01**2, yaw_sigma**2, shift_sigma**2, shift_sigma**2, 0.1**2])


def symmetric_room():
    """Half a turn about the middle changes nothing."""
    shell, furniture = furnished_room()[:5], [((2.5, 2.0, 0.4), (1.0, 0.6, 0.8)), ((1.0, -2.5, 0.9), (0.4, 0.4, 1.8))]
    return shell + furniture + [((-x, -y, z), size) for (x, y, z), size in furniture]


def area_and_reading(boxes, seed):
    """The map of two sweeps, a third sweep, and where it was made."""
    rng, scene = np.random.default_rng(seed), world_of(boxes)
    poses = [pose(-2.0, -1.0, 0.1), pose(1.5, 0.8, 2.5), pose(0.3, 0.5, 1.0)]
    clouds = [PointCloud(*sweep(scene, T, rng)) for T in poses]
    area = merged([vertex_cloud(c, 0.1, 20).transformed(T) for c, T in zip(clouds[:2], poses[:2], strict=True)])
    return area, clouds[2], poses[2]


@pytest.fixture(scope="module")
def room():
    return area_and_reading(furnished_room(), 21)


@pytest.fixture(scope="module")
def ambiguous_room():
    return area_and_reading(symmetric_room(), 22)


def assert_right(result, T_true, metres=0.02, degrees=0.2):
    off = inverse(T_true) @ result.T_reference_reading
    assert np.linalg.norm(off[:3, 3]) < metres and np.degrees(rotation_angle(off)) < degrees, result.reason


def test_window_is_three_sigmas_between_its_limits():
    T = transform_from_rpy((1.0, 2.0, 0.0), (0.0, 0.0, 0.7))
    assert window_of(None, T, CONFIG) == Window(CONFIG.search_shift_m, CONFIG.search_height_m, SEARCH_YAW_RAD)
    window = window_of(covariance(0.5, 0.7), T, CONFIG)
    assert window.shift_m == pytest.approx(2.1) and window.yaw_rad == pytest.approx(1.5) and window.is_wide()
    narrow = window_of(covariance(1e-3, 1e-3), T, CONFIG)
    assert (narrow.shift_m, narrow.yaw_rad) == (SEARCH_LEAST_SHIFT_M, SEARCH_LEAST_YAW_RAD) and not narrow.is_wide()


@pytest.mark.parametrize(
    ("shift", "yaw", "is_held"),
    [((0.9, -0.9, 0.9), 0.7, True), ((-1.7, 0.0, 0.0), 0.0, False), ((0.0, 0.0, 1.7), 0.0, False), ((0.0, 0.0, 0.0), -1.2, False)],
)
def test_window_holds_what_lies_within_it_of_the_guess(shift, yaw, is_held):
    T_guess = transform_from_rpy((4.0, -2.0, 1.0), (0.1, -0.1, 3.0))
    T = transform_from_rpy(shift) @ T_guess @ transform_from_rpy((0.0, 0.0, 0.0), (0.0, 0.0, yaw))
    assert window_of(covariance(1e-3, 1e-3), T_guess, CONFIG).holds(T_guess, T) is is_held


def test_placement_is_refused_where_the_guess_says_that_the_truth_is_not(room):
    """Where the clouds agree 1.7 m from a guess that is known to centimetres, they agree by chance, as far as the guess knows."""
    area, reading, T_true = room
    T_guess = transform_from_rpy((1.7, 0.0, 0.0)) @ T_true
    assert create_registration(CONFIG).match(area, reading, T_guess, covariance(0.02, 0.7)).verdict is Verdict.ACCEPTED
    result = create_registration(CONFIG).match(area, reading, T_guess, covariance(0.02, 0.05))
    assert result.verdict is Verdict.REFUSED and result.reason.startswith("placed 1.7 m"), result.reason


def test_window_turns_with_the_frames():
    """Sideways of a robot that lies on its nose is not sideways of the map."""
    T = transform_from_rpy((0.0, 0.0, 0.0), (0.0, np.pi / 2, 0.0))
    window = window_of(np.diag([0.5**2, 0.0, 0.0, 0.5**2, 0.9**2, 0.9**2]), T, RegistrationConfig(search_height_m=5.0))
    assert window.height_m == pytest.approx(1.5) and window.shift_m == pytest.approx(2.7) and window.yaw_rad == pytest.approx(1.5)


def test_best_coarse_placement_is_near_the_truth(room):
    area, reading, T_true = room
    T_guess = transform_from_rpy((1.4, -0.9, 0.2)) @ T_true @ transform_from_rpy((0.0, 0.0, 0.0), (0.0, 0.0, 2.4))
    placements, _ = coarse_placements(area, with_normals(vertex_cloud(reading, 0.1, 20), 20), T_guess, Window(3.0, 0.5, np.pi), CONFIG)
    off = offset_between(T_true, placements[0])
    assert np.linalg.norm(off[3:]) < 2.0 * SEARCH_CELL_M and np.linalg.norm(off[:3]) < 2.0 * SEARCH_YAW_STEP_RAD


def test_placements_lie_well_apart_and_within_the_window(room):
    area, reading, T_guess = room
    window = Window(1.2, 0.6, 0.8)
    placements, more = coarse_placements(area, vertex_cloud(reading, 0.1, 20), T_guess, window, CONFIG)
    assert 1 < len(placements) <= SEARCH_PEAKS and 0 < len(more) <= 2 * SEARCH_PEAKS
    assert not any(np.array_equal(T, other) for T in placements for other in more)
    shifts = placements[:, :3, 3] - T_guess[:3, 3]
    assert np.abs(shifts[:, :2]).max() <= window.shift_m + 1e-9 and np.abs(shifts[:, 2]).max() <= window.height_m + 1e-9
    assert max(rotation_angle(inverse(T_guess) @ T) for T in placements) <= window.yaw_rad + 1e-9
    for k, T in enumerate(placements):
        for other in placements[:k]:
            off = offset_between(other, T)
            assert np.linalg.norm(off[:3]) > SEARCH_APART_RAD or np.linalg.norm(off[3:]) > SEARCH_APART_M


@pytest.mark.parametrize(("yaw", "shift"), [(0.7, (1.2, -0.8, 0.2)), (-2.0, (-1.5, 1.5, 0.3)), (np.pi, (2.5, 1.2, -0.4))])
def test_reading_is_placed_from_far_off(room, yaw, shift):
    area, reading, T_true = room
    T_guess = transform_from_rpy(shift) @ T_true @ transform_from_rpy((0.0, 0.0, 0.0), (0.0, 0.0, yaw))
    result = create_registration(CONFIG).match(area, reading, T_guess)
    assert result.verdict is Verdict.ACCEPTED and not len(result.rivals), result.reason
    assert_right(result, T_true)


def test_narrow_guess_that_is_refused_is_searched_around(room):
    area, reading, T_true = room
    T_guess = transform_from_rpy((0.6, -0.6, 0.0)) @ T_true @ transform_from_rpy((0.0, 0.0, 0.0), (0.0, 0.0, 0.75))
    result = create_registration(CONFIG).match(area, reading, T_guess, covariance(0.02, 0.05))
    assert result.verdict is Verdict.ACCEPTED, result.reason
    assert_right(result, T_true)


def test_symmetric_place_is_ambiguous_when_nothing_is_known(ambiguous_room):
    area, reading, T_true = ambiguous_room
    result = create_registration(CONFIG).match(area, reading, transform_from_rpy((0.0, 0.0, 0.132)))
    assert result.verdict is Verdict.AMBIGUOUS and not result.usable, result.reason
    placements = [result.T_reference_reading, *result.rivals]
    assert len(placements) == 2
    for T_expected in (T_true, HALF_TURN @ T_true):
        assert min(np.linalg.norm(offset_between(T_expected, T)) for T in placements) < 0.03


@pytest.mark.parametrize("turn", [np.eye(4), HALF_TURN])
def test_guess_that_is_known_chooses_among_rivals(ambiguous_room, turn):
    area, reading, T_true = ambiguous_room
    T_guess = turn @ transform_from_rpy((0.3, -0.2, 0.05)) @ T_true @ transform_from_rpy((0.0, 0.0, 0.0), (0.0, 0.0, 0.4))
    result = create_registration(CONFIG).match(area, reading, T_guess, covariance(0.4, 0.8))
    assert result.verdict is Verdict.ACCEPTED, result.reason
    assert_right(result, turn @ T_true)


def test_guess_between_two_rivals_chooses_none(ambiguous_room):
    area, reading, T_true = ambiguous_room
    T_guess = transform_from_rpy((0.0, 0.0, 0.132), (0.0, 0.0, 1.0 + np.pi / 2))
    result = create_registration(CONFIG).match(area, reading, T_guess, covariance(0.9, 0.9))
    assert result.verdict is Verdict.AMBIGUOUS, result.reason


@pytest.mark.parametrize("wrong", [np.zeros((6, 6)), np.full((6, 6), np.nan), np.eye(5), -np.eye(6)])
def test_covariance_of_a_guess_that_is_none_is_an_error(room, wrong):
    area, reading, T_true = room
    with pytest.raises(ValueError, match="covariance"):
        create_registration(CONFIG).match(area, reading, T_true, wrong)


def test_search_is_bit_identical_when_repeated(room):
    area, reading, T_true = room
    first, second = (create_registration(CONFIG).match(area, reading, HALF_TURN @ T_true) for _ in range(2))
    assert first.T_reference_reading.tobytes() == second.T_reference_reading.tobytes()


@pytest.mark.parametrize(("normal", "share"), [((-1.0, 0.0, 0.0), 1.0), ((0.0, 1.0, 0.0), None), ((0.0, 0.0, 0.0), 1.0)])
def test_surface_that_is_seen_along_says_nothing_of_free_space(normal, share):
    """A beam that met something at 6 m passed where the reference has a point at 3 m; a surface along the beam is no obstacle to it."""
    reading = PointCloud([[6.0, 0.0, 0.0]], np.zeros((1, 3)), [[-1.0, 0.0, 0.0]])
    reference = PointCloud([[3.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], [normal])
    found = FreeSpace(reference, reading, np.zeros(3), CONFIG).contradiction(np.eye(4))
    assert np.isnan(found) if share is None else found == share


def test_kept_guess_is_the_guess_along_the_free_direction_only():
    """Also after a large turn: along the wall of the matched frame the guess stands, across it the match."""
    T_matched = transform_from_rpy((4.0, 1.0, 0.0), (0.0, 0.0, np.pi / 2))
    T_guess = transform_from_rpy((2.0, 3.5, 0.0), (0.0, 0.0, 0.0))
    along_body_x = Degeneracy(np.array([3.0, 3.0, 3.0, 1.0, 1.0, 1.0]), np.array([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]]))
    T = keep_guess(T_guess, T_matched, along_body_x)
    np.testing.assert_allclose(T[:3, 3], [4.0, 3.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(T[:3, :3], T_matched[:3, :3], atol=1e-12)


def test_direction_that_nobody_knows_is_left_to_the_match():
    weak = Degeneracy(np.array([3.0, 3.0, 3.0, 1.0, 1.0, 1.0]), np.eye(6)[[2, 3]])
    assert len(known_directions(weak, None, 0.6).directions) == 0
    kept = known_directions(weak, np.diag([0.01, 0.01, 0.3, 0.2, 2.0, 2.0]) ** 2, 0.6)
    np.testing.assert_array_equal(kept.directions, np.eye(6)[[3]])


def corridor_with_doors():
    """Smooth walls and floor, and two pillars: hardly anything of the surface holds a position along it, free space does."""
    return corridor() + [((1.0, 1.05, 0.5), (0.3, 0.2, 1.0)), ((4.5, -1.05, 0.6), (0.4, 0.2, 1.2))]


@pytest.mark.parametrize("slip", [-2.4, -1.2])
def test_free_space_holds_what_surfaces_leave_open(slip):
    rng, scene = np.random.default_rng(31), world_of(corridor_with_doors())
    poses = [pose(0.0, 0.0, 0.0), pose(2.0, 0.1, 0.1), pose(3.5, 0.0, -0.1)]
    clouds = [PointCloud(*sweep(scene, T, rng, lines=240)) for T in poses]
    area = merged([vertex_cloud(c, 0.1, 20).transformed(T) for c, T in zip(clouds[:2], poses[:2], strict=True)])
    result = create_registration(CONFIG).match(area, clouds[2], transform_from_rpy((slip, 0.0, 0.0)) @ poses[2], covariance(0.3, 1.5))
    assert result.usable, result.reason
    assert_right(result, poses[2], metres=0.3, degrees=0.5)


@pytest.mark.parametrize("likely_is_right", [True, False])
def test_more_placements_are_tried_where_free_space_allows_none_of_the_likely_ones(room, monkeypatch, likely_is_right):
    area, reading, T_true = room
    T_wrong, T_right = transform_from_rpy((1.5, 0.0, 0.0)) @ HALF_TURN @ T_true, T_true @ transform_from_rpy((0.1, 0.1, 0.0))
    batches = (T_right[None], None) if likely_is_right else (T_wrong[None], T_right[None])  # None cannot be iterated
    monkeypatch.setattr(placement_search, "coarse_placements", lambda *_: batches)
    result = create_registration(CONFIG).match(area, reading, T_wrong)
    assert result.verdict is Verdict.ACCEPTED, result.reason
    assert_right(result, T_true)


def test_placement_that_hardly_overlaps_hides_none_of_the_same_place():
    """Where hardly anything overlaps, hardly anything contradicts, and nothing holds."""
    open_x, T = np.eye(6)[[3]], transform_from_rpy((2.0, 0.0, 0.0))
    beside = placement_search.Rough(np.eye(4), 0.02, 0.001, open_x)
    assert placement_search.same_place(beside.T, open_x, T)
    assert not placement_search._is_no_better(T, 0.9, beside, None)
    assert placement_search._is_no_better(np.eye(4), 0.9, beside, None)


def test_guess_itself_is_a_start_where_the_search_finds_nothing(room):
    """A reading whose placed points all lie on the floor beside the robot; the guess is near, but nobody knows that."""
    area, reading, T_true = room
    T_guess = transform_from_rpy((0.15, -0.1, 0.02)) @ T_true @ transform_from_rpy((0.0, 0.0, 0.0), (0.0, 0.0, 0.1))
    result = create_registration(RegistrationConfig(search_range_m=1.0)).match(area, reading, T_guess, covariance(0.5, 0.7))
    assert result.verdict is Verdict.ACCEPTED, result.reason
    assert_right(result, T_true)


@pytest.mark.parametrize(
    ("has_twin", "enough", "verdict"), [(False, 0.99, Verdict.ACCEPTED), (True, 0.99, Verdict.AMBIGUOUS), (True, 0.5, Verdict.ACCEPTED)]
)
def test_placement_that_explains_too_little_has_to_be_the_only_one_far_around(room, has_twin, enough, verdict):
    """The twin room lies beyond the first search; what explains much is not asked for it."""
    area, reading, T_true = room
    known = merged([area, area.transformed(transform_from_rpy((0.0, 8.0, 0.0)))]) if has_twin else area
    T_guess = transform_from_rpy((0.0, -0.5, 0.0)) @ T_true
    result = create_registration(RegistrationConfig(min_overlap_unguided=enough, search_wide_m=9.0)).match(known, reading, T_guess)
    assert result.verdict is verdict, result.reason
