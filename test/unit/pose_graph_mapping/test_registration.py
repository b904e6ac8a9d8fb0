"""Both registrations on simulated rooms with a known answer, where there is none, and on a real room."""

import dataclasses
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest
from synthetic_sweeps import corridor, divided_corridor, furnished_room, pose, sweep, world_of

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.cloud import PointCloud, merged, vertex_cloud
from pose_graph_mapping.registration.gicp import facing
from pose_graph_mapping.registration.match_quality import DEGENERATE_SIGMA_M, free_space_contradiction
from pose_graph_mapping.registration.matching import Verdict
from pose_graph_mapping.registration.methods import create_registration
from rigid_geometry import inverse, rotation_angle, transform_from_rpy

METHODS = ("gicp", "thesis_chain")
DISTURBANCE = transform_from_rpy((0.25, -0.2, 0.03), (0.01, -0.01, 0.15))
T_REAL_GUESS = transform_from_rpy((1.79387, 0.720047, 0.0), (0.0, 0.0, 0.6931))
REAL_FOLDER = Path(__file__).resolve().parents[4] / "shared" / "data"


def error_of(T, T_true):
    off = inverse(T_true) @ T
    return np.linalg.norm(off[:3, 3]), np.degrees(rotation_angle(off))


@pytest.fixture(scope="module")
def room():
    """Poses and clouds of four sweeps in a furnished room."""
    rng, scene = np.random.default_rng(11), world_of(furnished_room())
    poses = [pose(-2, -1, 0.1), pose(-1, -0.3, 0.5), pose(0.3, 0.5, 1.0), pose(1, 1, 1.2)]
    return poses, [PointCloud(*sweep(scene, T, rng)) for T in poses]


@pytest.fixture(scope="module")
def long_corridor():
    rng, scene = np.random.default_rng(12), world_of(corridor())
    poses = [pose(0, 0, 0), pose(1.5, 0.1, 0.1), pose(3, 0, -0.1)]
    return poses, [PointCloud(*sweep(scene, T, rng, lines=240)) for T in poses]


def area_of(poses, clouds):
    return merged([vertex_cloud(c, 0.1, 20).transformed(T) for c, T in zip(clouds, poses, strict=True)])


def registration(method, **values):
    return create_registration(RegistrationConfig(method=method, **values))


@pytest.mark.parametrize("method", METHODS)
def test_known_transform_is_found_within_a_centimetre(room, method):
    poses, clouds = room
    result = registration(method).match(area_of(poses[:3], clouds[:3]), clouds[3], poses[3] @ DISTURBANCE)
    metres, degrees = error_of(result.T_reference_reading, poses[3])
    assert result.verdict is Verdict.ACCEPTED, result.reason
    assert metres < 0.01 and degrees < 0.1
    assert result.overlap > 0.9 and result.free_space_contradiction < 0.003
    assert 0.6 < result.match_ratio <= 1.0 and result.iterations > 0


@pytest.mark.parametrize("method", METHODS)
def test_reference_without_normals_and_raw_gives_the_same_answer(room, method):
    poses, clouds = room
    raw = merged([c.transformed(T) for c, T in zip(clouds[:3], poses[:3], strict=True)])
    result = registration(method).match(raw, clouds[3], poses[3] @ DISTURBANCE)
    assert result.verdict is Verdict.ACCEPTED, result.reason
    assert error_of(result.T_reference_reading, poses[3])[0] < 0.01


@pytest.mark.parametrize("method", METHODS)
def test_match_is_bit_identical_when_repeated(room, method):
    poses, clouds = room
    area, matcher = area_of(poses[:2], clouds[:2]), registration(method)
    first, second = (matcher.match(area, clouds[3], poses[3] @ DISTURBANCE) for _ in range(2))
    assert first.T_reference_reading.tobytes() == second.T_reference_reading.tobytes()
    assert first.covariance.tobytes() == second.covariance.tobytes()


def test_match_does_not_depend_on_the_frame_of_the_reference(room):
    poses, clouds = room
    T_other_map = transform_from_rpy((5.0, -3.0, 1.0), (0.05, -0.1, 2.0))
    area, matcher = area_of(poses[:3], clouds[:3]), registration("gicp")
    here = matcher.match(area, clouds[3], poses[3] @ DISTURBANCE)
    there = matcher.match(area.transformed(T_other_map), clouds[3], T_other_map @ poses[3] @ DISTURBANCE)
    assert error_of(there.T_reference_reading, T_other_map @ here.T_reference_reading)[0] < 0.003


@pytest.mark.parametrize("method", METHODS)
def test_covariance_is_symmetric_positive_and_at_least_the_floor(room, method):
    poses, clouds = room
    config = RegistrationConfig(method=method)
    covariance = create_registration(config).match(area_of(poses[:3], clouds[:3]), clouds[3], poses[3]).covariance
    np.testing.assert_array_equal(covariance, covariance.T)
    floor = np.diag([config.floor_rotation_rad**2] * 3 + [config.floor_translation_m**2] * 3)
    assert np.linalg.eigvalsh(covariance - floor)[0] > -1e-12


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("least", [0.0, 1.0])
def test_match_ratio_alone_decides_where_it_is_told_to(room, method, least):
    poses, clouds = room
    match = create_registration(RegistrationConfig(method=method, verdict="match_ratio", min_match_ratio=least)).match
    result = match(area_of(poses[:1], clouds[:1]), clouds[1], poses[1])
    assert result.verdict is (Verdict.ACCEPTED if least == 0.0 else Verdict.REFUSED)
    assert f"{result.match_ratio:.2f}" in result.reason


@pytest.mark.parametrize("method", METHODS)
def test_clouds_of_different_places_are_refused(room, method):
    poses, clouds = room
    result = registration(method).match(area_of(poses[:1], clouds[:1]), clouds[3], poses[0] @ transform_from_rpy((25.0, 0.0, 0.0)))
    assert result.verdict is Verdict.REFUSED
    assert result.reason


@pytest.mark.parametrize("method", METHODS)
def test_sweep_of_another_building_is_refused(room, long_corridor, method):
    poses, clouds = room
    result = registration(method).match(area_of(poses, clouds), long_corridor[1][0], poses[1])
    assert result.verdict is Verdict.REFUSED, result.reason


@pytest.mark.parametrize("method", METHODS)
def test_corridor_keeps_the_guess_along_its_axis(long_corridor, method):
    poses, clouds = long_corridor
    T_guess = transform_from_rpy((0.4, 0.1, 0.0)) @ poses[2] @ transform_from_rpy((0, 0, 0), (0, 0, 0.05))
    known = np.diag([0.02**2] * 3 + [0.3**2] * 3)
    result = registration(method).match(area_of(poses[:2], clouds[:2]), clouds[2], T_guess, known)
    assert result.verdict is Verdict.DEGENERATE, result.reason
    assert len(result.degenerate_directions) == 1
    assert abs(result.T_reference_reading[0, 3] - T_guess[0, 3]) < 0.03
    assert abs(result.T_reference_reading[1, 3] - poses[2][1, 3]) < 0.02
    assert error_of(result.T_reference_reading, poses[2])[1] < 0.2


@pytest.mark.parametrize("method", METHODS)
def test_corridor_covariance_is_large_along_its_axis_only(long_corridor, method):
    poses, clouds = long_corridor
    config = RegistrationConfig(method=method)
    result = create_registration(config).match(area_of(poses[:2], clouds[:2]), clouds[2], poses[2])
    R_map_base = result.T_reference_reading[:3, :3]
    sigma_map = np.sqrt(np.diag(R_map_base @ result.covariance[3:, 3:] @ R_map_base.T))
    assert sigma_map[0] > 0.9 * DEGENERATE_SIGMA_M
    assert max(sigma_map[1:]) < 0.2 * DEGENERATE_SIGMA_M


@pytest.mark.parametrize("thickness", [0.1, 0.15, 0.2])
@pytest.mark.parametrize("off_m", [-0.12, 0.0, 0.12])
def test_two_sides_of_a_wall_are_never_laid_on_each_other(off_m, thickness):
    rng, scene = np.random.default_rng(13), world_of(divided_corridor(thickness))
    this_side, in_the_opening = pose(2.0, 1.0, np.pi), pose(-0.3, 1.2, np.pi)
    clouds = [PointCloud(*sweep(scene, T, rng, lines=240)) for T in (this_side, in_the_opening)]
    known = np.diag([0.0175, 0.0175, 0.1, 0.15, 0.15, 0.05]) ** 2
    T_guess = pose(-0.3 + off_m, 1.2, np.pi)
    result = registration("gicp").match(clouds[0].transformed(this_side), clouds[1], T_guess, known)
    assert result.verdict is Verdict.DEGENERATE, result.reason
    assert abs(result.T_reference_reading[0, 3] - T_guess[0, 3]) < 0.02


@pytest.mark.parametrize("method", METHODS)
def test_empty_clouds_are_an_error(room, method):
    cloud, empty = room[1][0], PointCloud(np.zeros((0, 3)), np.zeros((0, 3)))
    for pair in ((empty, cloud), (cloud, empty)):
        with pytest.raises(ValueError, match="must hold points"):
            registration(method).match(*pair, np.eye(4))


@pytest.mark.parametrize("method", METHODS)
def test_guess_that_is_not_rigid_is_an_error(room, method):
    with pytest.raises(ValueError, match="transform"):
        registration(method).match(room[1][0], room[1][1], np.full((4, 4), np.nan))


def two_points(rng):
    return PointCloud([[1.0, 0, 0], [2.0, 0, 0]], np.zeros((2, 3)))


def a_line(rng):
    points = np.column_stack([np.linspace(-5, 5, 4000), np.zeros(4000), np.zeros(4000)])
    return PointCloud(points, np.tile([0.0, 0, 1], (4000, 1)))


def the_same_point(rng):
    return PointCloud(np.ones((5000, 3)), np.zeros((5000, 3)))


def a_plane(rng):
    return PointCloud(np.column_stack([rng.uniform(-5, 5, (8000, 2)), np.zeros(8000)]), np.tile([0.0, 0, 1], (8000, 1)))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("shape", [two_points, a_line, the_same_point])
def test_clouds_without_surface_never_give_an_edge(method, shape):
    result = registration(method).match(shape(np.random.default_rng(1)), shape(np.random.default_rng(2)), np.eye(4))
    assert result.verdict is Verdict.REFUSED
    assert np.isnan(result.covariance).all() or np.isfinite(result.covariance).all()


@pytest.mark.parametrize("method", METHODS)
def test_plane_keeps_the_guess_in_its_three_free_directions(method):
    T_guess = transform_from_rpy((0.1, 0.05, 0.08), (0.0, 0.0, 0.05))
    known = np.diag([0.02**2] * 3 + [0.3**2] * 3)
    result = registration(method).match(a_plane(np.random.default_rng(1)), a_plane(np.random.default_rng(2)), T_guess, known)
    assert result.verdict is not Verdict.ACCEPTED
    assert len(result.degenerate_directions) == 3
    np.testing.assert_allclose(result.T_reference_reading[:3, 3], [0.1, 0.05, 0.0], atol=0.01)


@pytest.mark.parametrize("method", METHODS)
def test_without_beam_origins_nothing_is_accepted(room, method):
    poses, clouds = room
    result = registration(method).match(PointCloud(clouds[2].points), PointCloud(clouds[3].points), inverse(poses[2]) @ poses[3])
    assert result.verdict is Verdict.REFUSED and "origins" in result.reason
    assert np.isnan(result.free_space_contradiction)


def test_free_space_tells_a_shifted_match_from_a_right_one(room):
    poses, clouds = room
    config = RegistrationConfig()
    light = [vertex_cloud(c, 0.1, 20) for c in clouds]
    T_right = inverse(poses[2]) @ poses[3]
    assert free_space_contradiction(light[2], light[3], T_right, config) < 0.003
    for shift in ((0.8, 0, 0), (0, 0.8, 0)):
        assert free_space_contradiction(light[2], light[3], transform_from_rpy(shift) @ T_right, config) > 0.03


def test_points_facing_away_are_left_out_and_unknown_normals_kept():
    cloud = PointCloud([[1.0, 0, 0]] * 3, [[0.0, 0, 0]] * 3, [[-1.0, 0, 0], [1.0, 0, 0], [0.0, 0, 0]])
    np.testing.assert_allclose(facing(cloud, np.zeros(3), -0.1).normals[:, 0], [-1.0, 0.0])


def real_room(number):
    path = REAL_FOLDER / f"room_scan{number}.pcd"
    if not path.exists():
        pytest.skip(f"{path.name} is absent: real scans are not part of the repository")
    points = np.asarray(o3d.io.read_point_cloud(str(path)).points)
    off_the_vehicle = points[np.linalg.norm(points, axis=1) > 1.5]
    return PointCloud(off_the_vehicle, np.zeros_like(off_the_vehicle))


def test_real_room_is_matched_alike_by_both_chains_and_backwards():
    first, second = real_room(1), real_room(2)
    # Something moved between the two scans: 0.9 % of the points contradict a match that is right.
    configs = [RegistrationConfig(method=method) for method in METHODS]
    found = [create_registration(config).match(first, second, T_REAL_GUESS) for config in configs]
    back = create_registration(configs[0]).match(second, first, inverse(T_REAL_GUESS))
    assert [result.verdict for result in (*found, back)] == [Verdict.ACCEPTED] * 3
    assert max(error_of(found[0].T_reference_reading, found[1].T_reference_reading)) < 0.05
    assert error_of(found[0].T_reference_reading, inverse(back.T_reference_reading))[0] < 0.02


def test_real_room_is_matched_without_a_guess():
    found = [
        create_registration(RegistrationConfig(max_contradiction=0.02)).match(real_room(1), real_room(2), T)
        for T in (np.eye(4), T_REAL_GUESS)
    ]
    assert [result.verdict for result in found] == [Verdict.ACCEPTED] * 2, found[0].reason
    metres, degrees = error_of(found[0].T_reference_reading, found[1].T_reference_reading)
    assert metres < 0.05 and degrees < 1.0


def test_wrong_configuration_lists_every_value():
    config = dataclasses.replace(RegistrationConfig(), voxel_m=-1.0, fine_distance_m=2.0)
    with pytest.raises(ValueError, match=r"voxel_m.*; fine_distance_m"):
        create_registration(config)
