"""Into which storeys a terrain falls, for its picture."""

import numpy as np
from terrain_maps import AIR, FREE, OCCUPIED, RESOLUTION, floor, octree_of, two_storeys

from octomap_server_3dnav.terrain.classify import Terrain, TerrainConfig, classify
from robot_body import RobotBody
from terrain_tools.ground import pose_on
from terrain_tools.storeys import storeys


def terrain_of(states, start) -> Terrain:
    return classify(octree_of(states).column_runs(), pose_on(start, RobotBody()), TerrainConfig(), RobotBody(), None)


def test_one_floor_is_one_storey_with_all_of_its_layers():
    terrain = terrain_of(floor(), (2, 2, 0))
    assert storeys(terrain) == [(terrain.z.min(), terrain.z.max())]


def test_two_floors_are_two_storeys_and_the_ramp_belongs_to_the_lower():
    found = storeys(terrain_of(two_storeys(), (4, 5, 0)))
    assert len(found) == 2
    (first, last), (low, high) = found
    assert first == 0 and last + 1 == low and 15 <= low <= 20 <= high


def test_hill_is_one_storey_however_high():
    x = np.arange(80)[:, None, None]
    z = np.arange(40 + AIR)[None, None, :]
    surface = np.minimum(x // 4, 20) + 0 * z
    states = np.where(z > surface, FREE, OCCUPIED).astype(np.uint8) * np.ones((1, 40, 1), dtype=np.uint8)
    assert len(storeys(terrain_of(states, (1.0, 2.0, 0.3)))) == 1


def test_terrain_without_ground_is_one_storey():
    assert len(storeys(terrain_of(floor(4), (0.2, 0.2, 5 * RESOLUTION)))) == 1
