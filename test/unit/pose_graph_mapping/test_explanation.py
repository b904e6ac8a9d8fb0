"""What a placement explains in the motion where that is least, and the noise that a cloud shows of itself, on faces of a box."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.cloud import PointCloud
from pose_graph_mapping.registration.explanation import Noise, agreeing_surfaces, least_explained, own_noise
from pose_graph_mapping.registration.gicp_surface import surface_of
from rigid_geometry import transform_from_rpy

Array = NDArray[np.float64]


def box(per_face: int = 200, seed: int = 1) -> tuple[PointCloud, NDArray[np.int64]]:
    """Points on the six faces of a room of 8 x 6 x 3 m with the normals inwards, and the axis that each face is across."""
    rng, half = np.random.default_rng(seed), np.array([4.0, 3.0, 1.5])
    points, normals, axes = [], [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            on_face = rng.uniform(-half, half, (per_face, 3))
            on_face[:, axis] = side * half[axis]
            points.append(on_face)
            normals.append(np.tile(-side * np.eye(3)[axis], (per_face, 1)))
            axes.append(np.full(per_face, axis))
    return PointCloud(np.concatenate(points), None, np.concatenate(normals)), np.concatenate(axes)


def test_everything_is_explained_where_all_points_agree_and_nothing_where_none_is_asked() -> None:
    cloud, axis = box()
    everything = np.ones(len(cloud), dtype=np.bool_)
    assert least_explained(cloud, everything, everything) == pytest.approx(1.0, abs=1e-6)
    assert least_explained(cloud, ~everything, everything) == 0.0
    assert least_explained(cloud, ~everything, ~everything) == 0.0


def test_floor_and_ceiling_do_not_stand_in_for_the_walls_that_object() -> None:
    cloud, axis = box()
    everything = np.ones(len(cloud), dtype=np.bool_)
    objecting = (axis == 0) & (np.arange(len(cloud)) % 4 != 0)
    assert np.mean(~objecting) == pytest.approx(0.75)
    assert least_explained(cloud, ~objecting, everything) == pytest.approx(0.25, abs=0.03)


def test_a_tenth_that_moved_takes_a_tenth_wherever_it_stood() -> None:
    cloud, _ = box()
    everything = np.ones(len(cloud), dtype=np.bool_)
    moved = np.random.default_rng(2).random(len(cloud)) < 0.1
    assert 0.8 < least_explained(cloud, ~moved, everything) < 0.92


def test_least_is_that_of_all_motions_whatever_the_frame() -> None:
    cloud, _ = box(20)
    rng = np.random.default_rng(3)
    agrees, everything = rng.random(len(cloud)) < 0.6, np.ones(len(cloud), dtype=np.bool_)
    assert cloud.normals is not None
    rows = np.hstack([np.cross(cloud.points, cloud.normals), cloud.normals])

    def share(motion: Array) -> float:
        felt = (rows @ motion) ** 2
        return float(felt[agrees].sum() / felt.sum())

    least = min(minimize(share, rng.normal(size=6), method="Nelder-Mead", options={"maxiter": 20_000}).fun for _ in range(5))
    assert least_explained(cloud, agrees, everything) == pytest.approx(least, abs=1e-3)
    elsewhere = cloud.transformed(transform_from_rpy((5.0, -3.0, 2.0), (0.3, -0.2, 1.0)))
    assert least_explained(elsewhere, agrees, everything) == pytest.approx(least, abs=1e-3)


@pytest.mark.parametrize("sigma_m", [0.0, 0.01, 0.02])
def test_own_noise_is_that_across_the_surface(sigma_m: float) -> None:
    cloud, _ = box(1500)
    assert cloud.normals is not None
    noisy = cloud.points + sigma_m * np.random.default_rng(4).standard_normal((len(cloud), 1)) * cloud.normals
    found = own_noise(surface_of(PointCloud(noisy, None, cloud.normals)), RegistrationConfig(misfit_m=max(1.5 * sigma_m, 0.001)))
    assert found.misfit == pytest.approx(0.29 if sigma_m else 0.0, abs=0.08)  # of differences that spread by 1.41 sigma
    assert found.within_m == pytest.approx(1.96 * np.sqrt(2.0) * sigma_m, rel=0.15, abs=1e-9)


def test_a_lone_point_shows_no_noise() -> None:
    assert own_noise(surface_of(PointCloud(np.zeros((1, 3)), None, np.array([[0.0, 0.0, 1.0]]))), RegistrationConfig()) == Noise(0.0, 0.0)


def test_surfaces_count_once_whatever_their_size() -> None:
    cloud, axis = box(300)
    everything = np.ones(len(cloud), dtype=np.bool_)
    assert agreeing_surfaces(cloud, everything) == pytest.approx(6.0, abs=0.1)
    assert agreeing_surfaces(cloud, axis != 2) == pytest.approx(4.0, abs=0.1)
    assert agreeing_surfaces(cloud, np.arange(len(cloud)) % 2 == 0) == pytest.approx(3.0, abs=0.3)


def test_a_surface_more_is_one_more_and_points_without_a_normal_are_none() -> None:
    cloud, _ = box(300)
    assert cloud.normals is not None
    shelf = np.random.default_rng(5).uniform([-0.5, -0.5, 0.2], [0.5, 0.5, 0.2], (60, 3))
    for normal, more in (([0.0, 0.0, 1.0], 1.0), ([0.0, 0.0, 0.0], 0.0)):
        furnished = PointCloud(np.vstack([cloud.points, shelf]), None, np.vstack([cloud.normals, np.tile(normal, (60, 1))]))
        assert agreeing_surfaces(furnished, np.ones(len(furnished), dtype=np.bool_)) == pytest.approx(6.0 + more, abs=0.1)
