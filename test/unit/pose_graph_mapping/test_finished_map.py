"""Localisation only: sweeps are placed in a finished map, and the map stays as it is."""

import pickle

import numpy as np
import pytest
from synthetic_sweeps import furnished_room, pose, sweep, world_of

from pose_graph_mapping.config import MappingConfig, RegistrationConfig
from pose_graph_mapping.graph.finished_map import FinishedMap
from pose_graph_mapping.graph.localisation import Placement, localise
from pose_graph_mapping.graph.mapper import PoseGraphMapper
from pose_graph_mapping.registration.cloud import PointCloud
from pose_graph_mapping.registration.matching import RegistrationResult, Verdict, refused
from pose_graph_mapping.registration.methods import create_registration
from rigid_geometry import inverse, rotation_angle, transform_from_rpy

PLACES = [pose(-2.0, -0.5), pose(-1.0, 0.5, 0.3), pose(0.5, 0.6, 0.8), pose(2.0, -0.5, 1.4)]
VISITS = [pose(-0.3, 0.2, 2.0), pose(0.6, -0.2, 1.5), pose(1.8, 0.4, 0.6)]
SLIP = transform_from_rpy((0.06, -0.04, 0.0), (0.0, 0.0, 0.03))  # of odometry, between two sweeps


@pytest.fixture(scope="module")
def mapped():
    """A mapper with the map of a room, the room, and what makes its noise."""
    scene, rng = world_of(furnished_room()), np.random.default_rng(3)
    mapper = PoseGraphMapper(MappingConfig(), create_registration(RegistrationConfig()).match)
    for k, T in enumerate(PLACES):
        mapper.add_sweep(2.0 * k, *sweep(scene, T, rng), T)
    return mapper, scene, rng


def error_of(T_map_base, T_true):
    """Metres and radians; the map lies as its first pose does."""
    off = inverse(T_true) @ T_map_base
    return float(np.linalg.norm(off[:3, 3])), rotation_angle(off)


def visit(finished, scene, rng, count=3, begin_s=100.0):
    """The updates of a robot that wakes up in the room and drives on, its odometry somewhere else and slipping."""
    T_odom, updates = transform_from_rpy((5.0, 5.0, 0.0), (0.0, 0.0, 1.0)), []
    for k, T_true in enumerate(VISITS[:count]):
        cloud, placement = sweep(scene, T_true, rng), None
        if k == 0:
            match = create_registration(RegistrationConfig()).match
            placement = localise(finished.graph, finished.vertex_clouds(), PointCloud.of_finite(*cloud), match)
            assert placement.accepted, placement.reason
        else:
            T_odom = T_odom @ inverse(VISITS[k - 1]) @ T_true @ SLIP
        updates.append(finished.add_sweep(begin_s + k, *cloud, T_odom, None, None, placement))
    return updates


def test_robot_is_found_and_followed_and_neither_graph_nor_clouds_change(mapped):
    mapper, scene, rng = mapped
    poses, edges, clouds = mapper.graph.poses(), mapper.graph.edges(), [c.points.copy() for c in mapper.vertex_clouds()]
    finished = FinishedMap(mapper, MappingConfig(), create_registration(RegistrationConfig()).match)
    for update, T_true in zip(visit(finished, scene, rng), VISITS, strict=True):
        metres, radians = error_of(update.vertex_poses[-1], T_true)
        assert update.match_used and metres < 0.03 and radians < 0.01, (metres, radians)
        np.testing.assert_array_equal(update.vertex_poses[: len(poses)], poses)
    np.testing.assert_array_equal(mapper.graph.poses(), poses)
    assert mapper.graph.edges() == edges and len(mapper.stamps_s) == len(PLACES)
    for before, after in zip(clouds, mapper.vertex_clouds(), strict=True):
        np.testing.assert_array_equal(before, after.points)


def test_answer_has_the_map_s_poses_the_first_place_and_the_newest_with_their_stamps(mapped):
    mapper, scene, rng = mapped
    finished = FinishedMap(mapper, MappingConfig(), create_registration(RegistrationConfig()).match)
    first, _, third = visit(finished, scene, rng)
    assert (len(first.vertex_poses), len(third.vertex_poses), third.vertex_id) == (len(PLACES) + 1, len(PLACES) + 2, len(PLACES) + 1)
    np.testing.assert_array_equal(third.vertex_poses[-2], first.vertex_poses[-1])
    assert finished.stamps_s == (0.0, 2.0, 4.0, 6.0, 100.0, 102.0)
    stamps_s, kept = finished.kept()  # after which a sweep that fails is told of
    assert stamps_s == (0.0, 2.0, 4.0, 6.0, 100.0)
    np.testing.assert_array_equal(kept, first.vertex_poses)


def test_localisation_goes_on_in_another_process_as_if_it_were_the_same(mapped):
    """What is kept of it for a process that is started again is its visits."""
    mapper, scene, rng = mapped
    match = create_registration(RegistrationConfig()).match
    finished = FinishedMap(mapper, MappingConfig(), match)
    second = visit(finished, scene, rng, 2)[-1]
    goes_on = FinishedMap(mapper, MappingConfig(), match, pickle.loads(pickle.dumps(finished.visits)))
    np.testing.assert_array_equal(goes_on.vertex_poses, second.vertex_poses)
    assert goes_on.stamps_s == finished.stamps_s and len(goes_on.surroundings()) == len(finished.surroundings())
    cloud, T_odom = sweep(scene, VISITS[2], rng), second.vertex_poses[-1] @ inverse(VISITS[1]) @ VISITS[2]
    T_odom = inverse(second.T_map_odom) @ T_odom
    here, there = (m.add_sweep(110.0, *cloud, T_odom, None, None, None) for m in (finished, goes_on))
    assert there.match_used
    np.testing.assert_array_equal(here.vertex_poses, there.vertex_poses)


def test_where_nothing_matches_odometry_goes_on_and_grows_uncertain(mapped):
    mapper, scene, rng = mapped
    seen = []

    def never(reference, reading, T_guess, covariance):
        seen.append(covariance)
        return refused(T_guess, "in the test")

    finished = FinishedMap(mapper, MappingConfig(), never)
    first, *later = visit(finished, scene, rng)
    for before, after in zip([first, *later], later, strict=False):
        assert not after.match_used and after.result.verdict is Verdict.REFUSED
        np.testing.assert_allclose(after.T_map_odom, before.T_map_odom)
    sigmas = [float(np.sqrt(np.trace(c[3:, 3:]))) for c in seen]
    assert len(sigmas) == 2 and sigmas[1] > 1.2 * sigmas[0] > 0.02


def test_match_that_moves_the_robot_too_far_is_refused(mapped):
    mapper, scene, rng = mapped
    away = transform_from_rpy((3.0, 0.0, 0.0))
    match = create_registration(RegistrationConfig()).match

    def elsewhere(reference, reading, T_guess, covariance):
        result = match(reference, reading, T_guess, covariance)
        return type(result)(**{**vars(result), "T_reference_reading": result.T_reference_reading @ away})

    finished = FinishedMap(mapper, MappingConfig(), elsewhere)
    first, second = visit(finished, scene, rng, 2)
    assert not second.match_used and "moves the prediction" in second.result.reason
    np.testing.assert_allclose(second.T_map_odom, first.T_map_odom)


def test_robot_whose_clock_is_behind_that_of_the_map_is_found_and_no_sweep_is_placed_twice(mapped):
    mapper, scene, rng = mapped
    finished = FinishedMap(mapper, MappingConfig(), create_registration(RegistrationConfig()).match)
    assert len(visit(finished, scene, rng, 2, begin_s=mapper.stamps_s[1])) == 2
    with pytest.raises(ValueError, match="already"):
        finished.add_sweep(mapper.stamps_s[1] + 1.0, *sweep(scene, VISITS[1], rng), np.eye(4))


def test_what_is_no_sweep_is_an_error_and_changes_nothing(mapped):
    mapper, scene, rng = mapped
    finished = FinishedMap(mapper, MappingConfig(), create_registration(RegistrationConfig()).match)
    points, origins = sweep(scene, VISITS[0], rng)
    with pytest.raises(ValueError, match="looked for in all of it"):
        finished.add_sweep(100.0, points, origins, np.eye(4))
    with pytest.raises(ValueError, match="finite"):
        finished.add_sweep(np.nan, points, origins, np.eye(4))
    with pytest.raises(ValueError, match="finite points"):
        finished.add_sweep(100.0, points[:50], origins[:50], np.eye(4))
    with pytest.raises(ValueError, match="not found"):
        finished.surroundings()
    assert finished.stamps_s == mapper.stamps_s


def test_place_that_was_visited_often_makes_no_larger_area(mapped):
    mapper, scene, rng = mapped
    match = create_registration(RegistrationConfig()).match
    often = PoseGraphMapper(MappingConfig(), match)
    for k in range(8):
        T = PLACES[k % 2] @ transform_from_rpy((0.02 * k, 0.0, 0.0))
        often.add_sweep(2.0 * k, *sweep(scene, T, rng), T)
    finished = FinishedMap(often, MappingConfig(), match)
    visit(finished, scene, rng, 1)
    assert len(finished.surroundings()) < 2.5 * len(often.vertex_clouds()[0])


def test_what_a_match_does_not_hold_stays_as_well_known_as_odometry_has_it(mapped):
    """A corridor: no match holds x, and odometry is good to centimetres along it."""
    mapper, scene, rng = mapped
    priors, open_m = [], 2.0

    def corridor(_reference, _reading, T_guess, covariance=None):
        priors.append(covariance)
        known = np.diag([1e-8] * 3 + [open_m**2, 1e-6, 1e-6])
        return RegistrationResult(T_guess, known, 0.9, 0.9, 0.0, 3, np.eye(6)[3:4], Verdict.DEGENERATE, "x is open")

    finished = FinishedMap(mapper, MappingConfig(), corridor)
    found = RegistrationResult(VISITS[0], np.diag([1e-6] * 6), 0.9, 0.9, 0.0, 3, np.zeros((0, 6)), Verdict.ACCEPTED, "")
    placement = Placement(True, found, 0, 1, "")
    T_odom, turned = VISITS[0], transform_from_rpy((1.0, 0.0, 0.0), (0.0, 0.0, np.pi / 2))
    finished.add_sweep(100.0, *sweep(scene, VISITS[0], rng), T_odom, None, None, placement)
    for k in range(1, 4):
        T_odom = T_odom @ (turned if k == 3 else transform_from_rpy((1.0, 0.0, 0.0)))
        finished.add_sweep(100.0 + k, *sweep(scene, VISITS[0], rng), T_odom)
    sigmas_m = [np.sqrt(np.diag(covariance)[3:]) for covariance in priors]
    assert sigmas_m[1][0] < 0.3 and sigmas_m[1][1] < 0.2, "two legs of a metre"
    assert sigmas_m[2][1] > sigmas_m[1][0] > 0.05, "after a turn what was ahead lies across"
