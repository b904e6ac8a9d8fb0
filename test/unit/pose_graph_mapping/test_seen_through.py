"""What moved is forgotten by the clouds that later sweeps are matched to, and by the saved one; what is thin is not."""

import numpy as np
import open3d as o3d
import pytest
from synthetic_sweeps import furnished_room, pose, sweep, world_of

from pose_graph_mapping.config import MappingConfig
from pose_graph_mapping.graph.light_clouds import LightClouds
from pose_graph_mapping.graph.mapper import PoseGraphMapper
from pose_graph_mapping.registration.matching import RegistrationResult, Verdict, refused
from pose_graph_mapping.registration.seen_through import Gone
from pose_graph_mapping.session.session_record import Measured
from pose_graph_mapping.session.session_resume import resume
from pose_graph_mapping.session.session_store import SessionStore
from rigid_geometry import transform_points

COVARIANCE = np.diag([1e-6] * 3 + [1e-5] * 3)
WAY = [pose(-3.4 + 0.4 * k, -0.8 + 0.1 * k, 0.15 * k) for k in range(6)]
PERSON = ((0.8, 0.3, 0.85), (0.4, 0.4, 1.7))
POLE = ((0.8, 0.3, 0.75), (0.06, 0.06, 1.5))
FENCE = [((1.2, 0.4 * k - 1.2, 0.5), (0.04, 0.04, 1.0)) for k in range(7)]


def at_the_guess(reference, reading, T_guess, covariance):
    return RegistrationResult(T_guess, COVARIANCE, 0.9, 0.9, 0.0, 4, np.zeros((0, 6)), Verdict.ACCEPTED, "fake")


def never(reference, reading, T_guess, covariance):
    return refused(T_guess, "nothing matches")


def sweeps_of(stays, *, of, others=()):
    """Sweeps along the way through the furnished room with these things in it, and others while the first `of` are made."""
    rng, before, after = np.random.default_rng(7), world_of([*furnished_room(), *stays, *others]), world_of([*furnished_room(), *stays])
    return [
        tuple(rows.astype(np.float32) for rows in sweep(before if k < of else after, T, rng, lines=240, beams=721))
        for k, T in enumerate(WAY)
    ]


def drive(sweeps, match=at_the_guess, store=None, **values):
    mapper = PoseGraphMapper(MappingConfig(**values), match)
    for k, (measured, T) in enumerate(zip(sweeps, WAY, strict=False)):
        mapper.add_sweep(float(k), *measured, T)
        if store is not None:
            store.add_sweep(k, float(k), *measured, mapper.graph, Measured(T))
    return mapper


def of_the_person(mapper):
    """Points that the mapper has where the person stood, clear of floor, by vertex."""
    (x, y, _), counts = PERSON[0], []
    for cloud, T in zip(mapper.vertex_clouds(), mapper.graph.poses(), strict=True):
        points = transform_points(T, cloud.points)
        counts.append(int(np.count_nonzero((np.abs(points[:, :2] - (x, y)) < 0.35).all(axis=1) & (points[:, 2] > 0.25))))
    return counts


@pytest.fixture(scope="module")
def left():
    """Somebody who stood there during the first two sweeps."""
    return sweeps_of([], of=2, others=[PERSON])


def test_who_left_is_forgotten_when_two_sweeps_looked_through_and_nothing_else_is(left):
    stood, once, twice = (drive(left[:count]) for count in (2, 3, 4))
    assert min(of_the_person(stood)) > 50 and of_the_person(once)[:2] == of_the_person(stood)
    assert max(of_the_person(twice)[:2]) < 0.5 * min(of_the_person(stood))
    gone = np.concatenate([transform_points(T, p) for p, T in zip(twice.gone().points, twice.graph.poses(), strict=True)])
    assert (np.abs(gone[:, :2] - PERSON[0][:2]) < 0.35).all()
    assert len(twice.surroundings()) == sum(len(cloud) for cloud in twice.vertex_clouds())


def test_who_stays_is_kept():
    mapper = drive(sweeps_of([PERSON], of=0))
    assert all(len(points) == 0 for points in mapper.gone().points) and min(of_the_person(mapper)) > 30


@pytest.mark.parametrize("thin", [[POLE], FENCE])
def test_thin_things_are_kept_although_most_beams_pass_them(thin):
    mapper = drive(sweeps_of(thin, of=0))
    assert sum(len(points) for points in mapper.gone().points) == 0


def test_what_only_odometry_placed_looks_through_nothing(left):
    mapper = drive(left, never)
    assert all(len(points) == 0 for points in mapper.gone().points)


def test_nothing_is_forgotten_where_the_configuration_says_so(left):
    assert min(of_the_person(drive(left, gone_sweeps=0))[:2]) > 50


def test_gone_on_session_has_forgotten_the_same(left, tmp_path):
    before = drive(left, store=SessionStore(tmp_path))
    after = resume(SessionStore(tmp_path), MappingConfig(), at_the_guess).mapper
    for a, b in zip(after.gone().points, before.gone().points, strict=True):
        np.testing.assert_array_equal(a, b)


def test_session_that_was_looked_through_is_not_looked_through_again(left, tmp_path, monkeypatch):
    before = drive(left, store=SessionStore(tmp_path))
    asked = []
    look_through = LightClouds.look_through
    monkeypatch.setattr(LightClouds, "look_through", lambda clouds, k, others: (asked.append(k), look_through(clouds, k, others)))
    after = resume(SessionStore(tmp_path), MappingConfig(), at_the_guess, before.looked_through()).mapper
    assert asked == []
    for a, b in zip(after.looked_through(), before.looked_through(), strict=True):
        np.testing.assert_array_equal(a, b)
    resume(SessionStore(tmp_path), MappingConfig(), at_the_guess, before.looked_through()[:-1])
    assert asked == [len(WAY) - 1], "the sweep that was on disk before it was remembered"


def test_counts_that_do_not_fit_their_cloud_begin_at_zero(left, tmp_path):
    before = drive(left, store=SessionStore(tmp_path))
    counts = (before.looked_through()[0][:-5], *before.looked_through()[1:])
    after = resume(SessionStore(tmp_path), MappingConfig(), at_the_guess, counts).mapper
    assert not after.looked_through()[0].any() and after.looked_through()[1].any()


def test_saved_cloud_is_without_what_has_gone_and_the_sweeps_stay_as_they_were(left, tmp_path):
    store = SessionStore(tmp_path)
    mapper = drive(left, store=store)
    store.save(mapper.graph, gone=mapper.gone())
    points = np.asarray(o3d.io.read_point_cloud(str(tmp_path / "cloud.ply")).points)
    everything = store.merged_points(mapper.graph.poses(), 0.04)
    there, before = ((np.abs(p - PERSON[0]) < (0.35, 0.35, 0.6)).all(axis=1).sum() for p in (points, everything))
    assert before > 200 and there < 0.2 * before and len(everything) - len(points) < 1.5 * before
    np.testing.assert_array_equal(store.load_sweep(0).points, left[0][0])


def test_points_in_the_same_voxel_as_one_that_has_gone_go_with_it():
    gone = Gone((np.array([[-0.04, 0.25, 1.01]]), np.zeros((0, 3))), 0.1)
    points = np.array([[-0.09, 0.21, 1.09], [0.01, 0.25, 1.01], [-0.04, 0.25, 0.99], [5.0, -3.0, 0.0]])
    np.testing.assert_array_equal(gone.left_of(0, points), points[1:])
    np.testing.assert_array_equal(gone.left_of(1, points), points)
