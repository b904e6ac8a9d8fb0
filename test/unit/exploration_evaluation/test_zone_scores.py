"""The judge of a run with bounds: ground beyond them does not count, and how far the robot came outside is measured."""

import numpy as np
import pytest
from hand_made_worlds import room

from exploration_evaluation import RobotShape, reachable_ground
from exploration_evaluation.zone_scores import closed_in_world, farthest_outside_m
from map_zones import NO_ZONES, Zone, Zones
from rigid_geometry import transform_from_rpy

ROBOT = RobotShape()
T_WORLD_MAP = transform_from_rpy((5.0, 5.0, 0.1), (0.0, 0.0, np.pi / 2))  # x of map is y of the world
BOUNDS = Zones(bounds=(Zone(np.array([[-2.0, -2.0], [3.0, -2.0], [3.0, 2.0], [-2.0, 2.0]])),))


def test_ground_that_can_be_reached_only_outside_the_bounds_does_not_count() -> None:
    whole = reachable_ground(*room(10, 10), (5, 5, 0.1))
    bounded = reachable_ground(*room(10, 10), (5, 5, 0.1), closed=closed_in_world(BOUNDS, T_WORLD_MAP))
    strip_m = ROBOT.circumscribed_radius_m - ROBOT.inscribed_radius_m  # beside what closes it, as beside a wall
    assert bounded.covered_area_m2 == pytest.approx((5.0 - 2 * strip_m) * (4.0 - 2 * strip_m), rel=0.05)
    assert bounded.covered_area_m2 < whole.covered_area_m2
    low, high = bounded.covered_points.min(axis=0), bounded.covered_points.max(axis=0)
    np.testing.assert_allclose((*low[:2], *high[:2]), (3.0 + strip_m, 3.0 + strip_m, 7.0 - strip_m, 8.0 - strip_m), atol=0.1)
    inside = bounded.points[:, :2]
    assert inside[:, 0].min() >= 3.0 + ROBOT.circumscribed_radius_m - 0.06


def test_zone_that_parts_the_ground_closes_what_lies_behind_it() -> None:
    wall = Zones(no_go=(Zone(np.array([[1.0, -9.0], [1.5, -9.0], [1.5, 9.0], [1.0, 9.0]])),))
    ground = reachable_ground(*room(10, 10), (5, 5, 0.1), closed=closed_in_world(wall, T_WORLD_MAP))
    assert ground.covered_points[:, 1].max() < 6.1


@pytest.mark.parametrize(("low_m", "high_m", "is_entered"), [(-0.7, -0.5, True), (-0.2, 0.2, False)])
def test_heights_of_zones_are_of_the_ground_below_the_robot(low_m: float, high_m: float, is_entered: bool) -> None:
    T_world_map, high = transform_from_rpy((5.0, 5.0, 0.6), (0.0, 0.0, 0.0)), RobotShape(base_height_m=0.6)
    ahead = Zones(no_go=(Zone(np.array([[2.0, -2.0], [4.0, -2.0], [4.0, 2.0], [2.0, 2.0]]), low_m, high_m),))
    poses = np.array([T_world_map, T_world_map @ transform_from_rpy((3.0, 0.0, 0.0), (0.0, 0.0, 0.0))])
    found = farthest_outside_m(ahead, T_world_map, (np.array([0.0, 0.15]), poses), high)
    assert found is not None and (found > 0.1) is is_entered


def test_outline_is_looked_at_by_the_true_poses() -> None:
    def driven(x: float, yaw: float) -> float | None:
        poses = np.array([T_WORLD_MAP, T_WORLD_MAP @ transform_from_rpy((x, 0.0, 0.0), (0.0, 0.0, yaw))])
        return farthest_outside_m(BOUNDS, T_WORLD_MAP, (np.array([0.0, 0.15]), poses), ROBOT)

    assert driven(2.0, 0.0) == 0.0
    assert driven(3.0 - ROBOT.length_m / 2 + 0.07, 0.0) == pytest.approx(0.07, abs=1e-6)
    assert driven(3.0 - ROBOT.width_m / 2 + 0.07, np.pi / 2) == pytest.approx(0.07, abs=1e-6)
    poses = np.array([T_WORLD_MAP, T_WORLD_MAP])
    assert farthest_outside_m(NO_ZONES, T_WORLD_MAP, (np.array([0.0, 0.15]), poses), ROBOT) is None
