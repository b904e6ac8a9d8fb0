"""How well a vertex's pose is known, in the order and frame of nav_msgs/Odometry."""

from types import SimpleNamespace

import numpy as np

from rigid_geometry import transform_from_rpy
from ros_adapters.tracking import pose_covariance


def test_covariance_of_a_match_is_turned_into_map_with_translation_first() -> None:
    in_body = np.diag([1e-6, 1e-6, 4e-6, 0.04, 0.0001, 0.0001])  # rotation first; along the robot's x it is known to 20 cm
    update = SimpleNamespace(result=SimpleNamespace(covariance=in_body), vertex_poses=[transform_from_rpy((0, 0, 0), (0, 0, np.pi / 2))])
    found = pose_covariance(update)  # type: ignore[arg-type]
    assert np.allclose(np.sqrt(np.diag(found))[:3], [0.0112, 0.2001, 0.0112], atol=1e-3)
    assert np.isclose(np.sqrt(found[5, 5]), np.hypot(0.002, 0.002), atol=1e-4)


def test_first_vertex_defines_the_map() -> None:
    found = pose_covariance(SimpleNamespace(result=None, vertex_poses=[np.eye(4)]))  # type: ignore[arg-type]
    assert np.allclose(np.sqrt(np.diag(found)), [0.005] * 3 + [0.002] * 3)
