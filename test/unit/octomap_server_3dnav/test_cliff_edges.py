"""Where ground ends at cliffs: along straight edges and in inner corners of them."""

import numpy as np
import pytest
from terrain_worlds import RESOLUTION, grid_of_heights, pose, runs_of

from octomap_server_3dnav.octree.surface_heights import HitHeights, SurfaceHeights
from octomap_server_3dnav.terrain import kernels as kernels
from octomap_server_3dnav.terrain.classify import TerrainClass, TerrainConfig
from octomap_server_3dnav.terrain.cliff_edges import BEFORE, _gets_steep, cliff_edges
from octomap_server_3dnav.terrain.config import Limits
from octomap_server_3dnav.terrain.judgement import start_candidates
from octomap_server_3dnav.terrain.scene import scene_around

SIZE = 50
TOP, BOTTOM = 0.5, -6.0  # of the ground in voxels


def edges_of(is_ground, hits_a_column=25):
    """(M, 2) places in voxels at which the ground ends that `is_ground(x, y)` tells of, met by random beams, and (M, 2) their reach."""
    points = np.random.default_rng(3).uniform(0.0, SIZE, (hits_a_column * SIZE**2, 2))
    on_top = is_ground(*points.T)
    heights = SurfaceHeights(RESOLUTION)
    heights.add(HitHeights.of(np.column_stack([points, np.where(on_top, TOP, BOTTOM)]) * RESOLUTION, RESOLUTION))
    has_ground = np.zeros((SIZE, SIZE), dtype=bool)
    has_ground[tuple(np.floor(points[on_top]).astype(int).T)] = True
    states = grid_of_heights(lambda x, y: np.where(has_ground, TOP, BOTTOM) * RESOLUTION, SIZE, SIZE)
    T_map_base, config = pose(0.8, 0.8), TerrainConfig()
    limits = Limits.of(config, RESOLUTION, True)
    scene = scene_around(runs_of(states), heights, T_map_base[:3, 3], None, config, limits)
    first = start_candidates(scene, T_map_base, config, limits)[0]
    inside = np.ones(scene.columns.start.size - 1, dtype=bool)
    label, _, _ = kernels.flood(scene.columns, scene.surfaces, scene.links, first, inside, limits)
    edges = cliff_edges(heights, scene, np.flatnonzero(label == TerrainClass.CLIFF), limits)
    return edges.sharp[:, :2] + scene.key, edges.reach[:, :2]


@pytest.mark.parametrize(("x", "y"), [(30.0, 30.0), (30.2, 30.3), (30.4, 30.4), (30.5, 30.7), (30.3, 30.8)])
def test_inner_corner_is_no_farther_off_than_what_is_kept_from_edges_makes_up_for(x, y):
    places, reach = edges_of(lambda px, py: ~((px > x) & (py > y)), hits_a_column=60)
    off = np.concatenate([places - reach, places, places + reach]) - [x, y]
    beyond = off[np.abs(off).max(axis=1) < 1.5].sum(axis=1) / np.sqrt(2.0)
    assert -0.75 < beyond.min() < TerrainConfig().cliff_margin_m / RESOLUTION


def test_turned_inner_corner_is_nearer_by_what_its_edges_extend():
    """The middle of the robot 7.5 voxels before the tip of a drop of a right angle, turned by 31 degrees, at 16 places in the grid."""
    ways, lacks = np.array([[np.cos(a), np.sin(a)] for a in np.radians([31.0, 121.0])]), []
    for tip in 30.0 + 0.25 * np.stack(np.meshgrid(np.arange(4), np.arange(4)), axis=-1).reshape(-1, 2):
        places, reach = edges_of(lambda x, y, tip=tip: (ways @ [x - tip[0], y - tip[1]] <= 0.0).any(axis=0), hits_a_column=60)
        off = tip - 7.5 * ways.sum(axis=0) / np.sqrt(2.0) - places
        along = np.clip((off * reach).sum(axis=1) / np.maximum((reach**2).sum(axis=1), 1e-9), -1.0, 1.0)
        lacks.append(np.hypot(*(off - along[:, None] * reach).T).min() - 7.5)
    assert np.mean(lacks) < 0.05 and max(lacks) < 0.55


def test_edge_is_nearer_where_few_beams_met_what_is_left_of_the_ground():
    places, _ = edges_of(lambda x, y: x < 35.3, hits_a_column=12)
    assert (35.3 - places[:, 0]).min() > 0.12


@pytest.mark.parametrize("degrees", [0.0, 20.0, 27.0, 45.0])
def test_straight_edge_has_no_corners_in_it(degrees):
    way = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    before = 35.0 - edges_of(lambda x, y: way[0] * x + way[1] * y < 35.0)[0] @ way
    assert before.min() > -0.1
    assert before.mean() < 0.55
    assert np.percentile(before, 95) < 1.1


def test_rounded_edge_gets_steep_where_its_falls_say_so():
    fall, before = np.array([0.4, 0.6, 0.6, 0.6]), np.array([0.1, 0.3, 0.5, 0.7])
    assert _gets_steep(fall, before, 0.45) == pytest.approx([BEFORE, 1.0, 1.5, 1.5])
