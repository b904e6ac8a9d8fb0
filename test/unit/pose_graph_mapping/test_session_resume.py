"""A session that is gone on with: the same graph, the same map, and a robot that finds itself in it or stands still."""

import numpy as np
import pytest
from synthetic_sweeps import furnished_room, pose, sweep, world_of

from pose_graph_mapping.config import MappingConfig, RegistrationConfig
from pose_graph_mapping.graph.localisation import Placement, area_around, localise, places
from pose_graph_mapping.graph.mapper import PoseGraphMapper
from pose_graph_mapping.graph.pose_graph import EdgeKind
from pose_graph_mapping.registration.cloud import PointCloud
from pose_graph_mapping.registration.matching import RegistrationResult, Verdict, refused
from pose_graph_mapping.registration.methods import create_registration
from pose_graph_mapping.session.session_record import Measured
from pose_graph_mapping.session.session_resume import resume
from pose_graph_mapping.session.session_store import SessionStore
from rigid_geometry import transform_from_rpy, translation_distance

COVARIANCE = np.diag([1e-6] * 3 + [1e-5] * 3)
UP = np.array([0.02, -0.01, 1.0])


def result_at(T, verdict=Verdict.ACCEPTED, rivals=(), overlap=0.9):
    rivals = np.array(rivals).reshape(-1, 4, 4)
    return RegistrationResult(T, COVARIANCE, 0.9, overlap, 0.0, 4, np.zeros((0, 6)), verdict, "fake", rivals)


def any_sweep(seed):
    rng = np.random.default_rng(seed)
    return rng.uniform(-3, 3, (600, 3)).astype(np.float32), np.tile([0.2, 0.0, 0.8], (600, 1)).astype(np.float32)


def at_the_guess(reference, reading, T_guess, covariance):
    """A matcher that moves every guess a little, always the same."""
    return result_at(T_guess @ transform_from_rpy((0.01, -0.02, 0.0), (0, 0, 0.003)))


def drive(mapper, store, count, match_from=0):
    for k in range(match_from, count):
        T_odom = transform_from_rpy((1.5 * k, 0.05 * k * k, 0.1), (0.01, 0.0, 0.02 * k))
        mapper.add_sweep(2.0 * k, *any_sweep(k), T_odom, gravity_base=UP, gravity_sigma_rad=0.01)
        store.add_sweep(k, 2.0 * k, *any_sweep(k), mapper.graph, Measured(T_odom, UP, 0.01))
    return mapper


def mapped(directory, count):
    return drive(PoseGraphMapper(MappingConfig(), at_the_guess), SessionStore(directory), count)


def test_resumed_mapper_has_the_graph_and_the_map_that_it_left(tmp_path):
    before = mapped(tmp_path, 6)
    after = resume(SessionStore(tmp_path), MappingConfig(), at_the_guess)
    assert after.notes == () and after.mapper.stamps_s == before.stamps_s
    assert after.mapper.graph.edges() == before.graph.edges()
    np.testing.assert_allclose(after.mapper.graph.poses(), before.graph.poses(), atol=1e-5)
    np.testing.assert_allclose(after.mapper.T_map_odom(), before.T_map_odom(), atol=1e-4)
    np.testing.assert_allclose(after.mapper.map_cloud().points, before.map_cloud().points, atol=1e-4)
    for a, b in zip(after.mapper.vertex_clouds(), before.vertex_clouds(), strict=True):
        np.testing.assert_array_equal(a.points, b.points)
        np.testing.assert_array_equal(a.normals, b.normals)


@pytest.mark.parametrize("stopped_after", [1, 3, 5])
def test_run_that_was_interrupted_ends_like_one_that_was_not(tmp_path, stopped_after):
    whole = mapped(tmp_path / "whole", 6)
    mapped(tmp_path / "cut", stopped_after)
    store = SessionStore(tmp_path / "cut")
    resumed = drive(resume(store, MappingConfig(), at_the_guess).mapper, store, 6, match_from=stopped_after)
    assert resumed.graph.edges() == whole.graph.edges()
    np.testing.assert_allclose(resumed.graph.poses(), whole.graph.poses(), atol=1e-5)


def test_gravity_is_not_used_where_the_configuration_says_so(tmp_path):
    mapped(tmp_path, 2)
    level = resume(SessionStore(tmp_path), MappingConfig(use_gravity=True), at_the_guess).mapper.graph.pose(0)
    left = resume(SessionStore(tmp_path), MappingConfig(use_gravity=False), at_the_guess).mapper.graph.pose(0)
    np.testing.assert_allclose(level[:3, :3] @ UP / np.linalg.norm(UP), [0, 0, 1], atol=1e-3)
    assert translation_distance(level, left) < 1e-3


def test_damaged_sweep_keeps_its_vertex_and_loses_its_points(tmp_path):
    before = mapped(tmp_path, 6)
    path = tmp_path / "sweeps/000003.npz"
    path.write_bytes(path.read_bytes()[:-100])
    sizes = []

    def match(reference, reading, T_guess, covariance):
        sizes.append(min(len(reference), len(reading)))
        return at_the_guess(reference, reading, T_guess, covariance)

    store = SessionStore(tmp_path)
    after = resume(store, MappingConfig(loop_min_dist_m=1.0, loop_min_dist_match=1, loop_max_dist_m=9.0), match)
    assert len(after.notes) == 1 and "sweeps/000003.npz is damaged" in after.notes[0] and "vertex 3 stays" in after.notes[0]
    assert after.mapper.graph.edges() == before.graph.edges()
    assert [len(c) > 0 for c in after.mapper.vertex_clouds()] == [True, True, True, False, True, True]
    drive(after.mapper, store, 8, match_from=6)
    assert len(sizes) >= 2 and min(sizes) > 0
    assert store.save(after.mapper.graph)[0].startswith("sweeps/000003.npz")


def test_last_sweep_that_is_damaged_leaves_the_next_to_odometry_or_a_wider_area(tmp_path):
    mapped(tmp_path, 1)
    (tmp_path / "sweeps/000000.npz").unlink()
    store = SessionStore(tmp_path)
    mapper = resume(store, MappingConfig(), at_the_guess).mapper
    update = mapper.add_sweep(99.0, *any_sweep(1), transform_from_rpy((1, 0, 0)))
    assert not update.match_used and "damaged" in update.result.reason


def test_session_without_sweeps_or_graph_cannot_be_gone_on_with(tmp_path):
    with pytest.raises(ValueError, match="no sweeps"):
        resume(SessionStore(tmp_path), MappingConfig(), at_the_guess)
    SessionStore(tmp_path).add_sweep(0, 0.0, *any_sweep(0))
    with pytest.raises(ValueError, match="stored without its odometry"):
        resume(SessionStore(tmp_path), MappingConfig(), at_the_guess)


def test_places_cover_the_map_and_start_at_the_last_vertex():
    positions = np.column_stack([np.linspace(0, 20, 41), np.zeros(41), np.zeros(41)])
    chosen = places(positions, 40, 3.0)
    assert chosen[:3] == [40, 34, 28]
    gaps = np.abs(positions[:, None, 0] - positions[chosen, 0])
    assert gaps.min(axis=1).max() < 3.0 and np.diff(np.sort(positions[chosen, 0])).min() >= 3.0


def line_map(count=11):
    mapper = PoseGraphMapper(MappingConfig(), at_the_guess)
    for k in range(count):
        mapper.add_sweep(float(k), *any_sweep(k), transform_from_rpy((2.0 * k, 0, 0)))
    return mapper


def found_by(mapper, match, **values):
    return localise(mapper.graph, mapper.vertex_clouds(), PointCloud(*any_sweep(50)), match, **values)


def near(T, metres=1.5):
    """Accepts a guess that is near to one of the true places, and puts it there."""

    def match(reference, reading, T_guess, covariance):
        assert covariance is None
        hits = [true for true in T if translation_distance(true, T_guess) < metres]
        return result_at(hits[0]) if hits else refused(T_guess, "not here")

    return match


def test_robot_that_was_not_moved_is_found_at_the_first_try():
    mapper = line_map()
    T = mapper.graph.pose(10) @ transform_from_rpy((0.5, 0.3, 0.0), (0, 0, 2.0))
    placement = found_by(mapper, near([T]))
    assert (placement.accepted, placement.vertex_id, placement.tries) == (True, 10, 1)
    np.testing.assert_array_equal(placement.result.T_reference_reading, T)


def test_robot_that_was_carried_off_is_found_elsewhere_in_the_map():
    mapper = line_map()
    T = mapper.graph.pose(2) @ transform_from_rpy((0.2, 0.8, 0.0))
    placement = found_by(mapper, near([T]))
    assert placement.accepted and placement.vertex_id == 2 and placement.tries == 6


def test_robot_in_a_strange_place_is_found_nowhere():
    placement = found_by(line_map(), near([transform_from_rpy((100, 0, 0))]))
    assert not placement.accepted and "found at none of 6 places" in placement.reason and "not here" in placement.reason


def test_two_places_that_look_alike_are_no_place():
    mapper = line_map()
    placement = found_by(mapper, near([mapper.graph.pose(2), mapper.graph.pose(6)]))
    assert not placement.accepted and placement.result.verdict is Verdict.AMBIGUOUS and "look alike" in placement.reason


def test_rival_of_an_ambiguous_match_counts_against_an_accepted_one():
    mapper = line_map()
    T, rival = mapper.graph.pose(1), mapper.graph.pose(5)

    def match(reference, reading, T_guess, covariance):
        if translation_distance(T_guess, rival) < 3.5:
            return result_at(T, Verdict.AMBIGUOUS, [rival])
        return near([T])(reference, reading, T_guess, covariance)

    assert not found_by(mapper, match).accepted


@pytest.mark.parametrize("verdict", [Verdict.DEGENERATE, Verdict.AMBIGUOUS, Verdict.REFUSED])
def test_only_an_accepted_match_places_the_robot(verdict):
    assert not found_by(line_map(), lambda a, b, T, c: result_at(T, verdict)).accepted


def test_guesses_are_levelled_by_gravity():
    guesses, mapper = [], line_map(3)

    def match(reference, reading, T_guess, covariance):
        guesses.append(T_guess)
        return refused(T_guess, "no")

    found_by(mapper, match, gravity_base=UP)
    np.testing.assert_allclose(guesses[0][:3, :3] @ UP / np.linalg.norm(UP), [0, 0, 1], atol=1e-9)


def test_area_holds_the_vertices_within_a_straight_distance():
    mapper = line_map()
    area = area_around(mapper.graph, mapper.vertex_clouds(), 5, 4.5)
    assert len(area) == sum(len(c) for c in mapper.vertex_clouds()[3:8])


def test_what_cannot_be_searched_is_an_error():
    mapper = line_map(2)
    with pytest.raises(ValueError, match="0 points"):
        localise(mapper.graph, mapper.vertex_clouds(), PointCloud(np.zeros((0, 3))), at_the_guess)


def test_localised_sweep_hangs_on_the_vertex_beside_it_and_odometry_goes_on_from_there():
    mapper = line_map()
    T = mapper.graph.pose(3) @ transform_from_rpy((0.4, 0.0, 0.0))
    placement = Placement(True, result_at(T), 3, 5, "found")
    T_odom = transform_from_rpy((-50.0, 7.0, 0.0), (0, 0, 1.0))
    update = mapper.add_sweep(100.0, *any_sweep(60), T_odom, placement=placement)
    assert mapper.graph.edges()[-1] == (3, 11, EdgeKind.MATCH) and update.match_used and update.tries == 5
    np.testing.assert_allclose(update.vertex_poses[-1], T, atol=1e-6)
    step = transform_from_rpy((1.0, 0.0, 0.0))
    after = mapper.add_sweep(101.0, *any_sweep(61), T_odom @ step)
    assert translation_distance(after.vertex_poses[-1], T @ step) < 0.05


def test_sweep_that_was_not_found_is_not_added():
    mapper = line_map(2)
    with pytest.raises(ValueError, match="not found in the map: nowhere"):
        mapper.add_sweep(100.0, *any_sweep(60), np.eye(4), placement=Placement(False, refused(np.eye(4), "no"), 0, 1, "nowhere"))
    assert len(mapper.graph) == 2


def two_rooms():
    """Two rooms with different furniture and a door between them; the second one 9.5 m along x."""
    moved = [((x + 9.5, -y, z), size) for (x, y, z), size in furnished_room()[4:]]
    walls = [part for part in furnished_room() if part[0] != (4.5, 0, 1.25)]
    door = [((4.5, 2.4, 1.25), (0.1, 2.2, 2.5)), ((4.5, -2.4, 1.25), (0.1, 2.2, 2.5))]
    return walls + door + moved + [((9.25, 0, -0.05), (10, 8, 0.1)), ((14.0, 0, 1.25), (0.1, 7, 2.5)), ((9.5, 3.5, 1.25), (9, 0.1, 2.5))]


def test_robot_carried_to_another_room_is_found_by_the_real_matcher(tmp_path):
    rng, scene = np.random.default_rng(4), world_of(two_rooms())
    truth = [pose(x, y, yaw) for x, y, yaw in [(-2.5, -1, 0), (-0.5, -0.6, 0.2), (1.5, 0, 0.1), (3.5, 0, 0), (6, 0, 0), (8, 0.5, 0.3)]]
    match = create_registration(RegistrationConfig()).match
    mapper, store = PoseGraphMapper(MappingConfig(), match), SessionStore(tmp_path)
    for k, T in enumerate(truth):
        cloud = [part.astype(np.float32) for part in sweep(scene, T, rng)]
        mapper.add_sweep(float(k), *cloud, T, gravity_base=T[2, :3])
        store.add_sweep(k, float(k), *cloud, mapper.graph, Measured(T, T[2, :3]))
    resumed = resume(SessionStore(tmp_path), MappingConfig(), match).mapper
    T_true = pose(-1.6, -0.2, 2.6)
    cloud = PointCloud(*sweep(scene, T_true, rng))
    placement = localise(resumed.graph, resumed.vertex_clouds(), cloud, match, gravity_base=(0, 0, 1))
    assert placement.accepted, placement.reason
    assert translation_distance(placement.result.T_reference_reading, T_true) < 0.05
    strange = PointCloud(*sweep(world_of(furnished_room(25.0, 20.0)[:5] + [((3, 1, 1), (1, 6, 2))]), pose(0, 0, 1.0), rng))
    assert not localise(resumed.graph, resumed.vertex_clouds(), strange, match, gravity_base=(0, 0, 1)).accepted
