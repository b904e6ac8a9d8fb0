"""Flat rays and the ground: what they may free that lies in the lower part of the voxels that they cross."""

from dataclasses import replace

import numpy as np
import pytest
from octree_planes import insert_plane

from octomap_server_3dnav.octree.column_runs import VoxelState
from octomap_server_3dnav.octree.octree import OctreeMap, SensorModel

RES = 0.1
OCTOMAP = SensorModel(miss=0.4, min=0.12)
FREE, OCCUPIED, UNKNOWN = VoxelState.FREE, VoxelState.OCCUPIED, VoxelState.UNKNOWN


def row(octree: OctreeMap, z: float, y: float = 0.05, n: int = 20) -> str:
    """States of n voxels along x, from x = 0, as text."""
    x = (np.arange(n) + 0.5) * RES
    return "".join(".1#"[s] for s in octree.states_at(np.stack([x, np.full(n, y), np.full(n, z)], axis=1)))


def rays(ends: list[tuple[float, float, float]], start: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    points = np.array(ends, np.float32)
    return points, np.broadcast_to(np.array(start, np.float32), points.shape)


@pytest.mark.parametrize(
    ("grazing_m", "ground"), [(0.0, "#########11111111#.."), (0.45, "#########11111####.."), (2.0, "##################..")]
)
def test_flat_ray_keeps_the_ground_it_skims_as_far_as_it_is_told_to(grazing_m, ground):
    octree = OctreeMap(RES, replace(OCTOMAP, grazing_m=grazing_m))
    insert_plane(octree, [0.85, 0.05, 0.05], 0.849)  # the ground that earlier sweeps saw, x = 0 .. 1.7
    for _ in range(3):
        octree.insert_sweep(*rays([(1.75, 0.05, 0.03), (1.75, 0.15, 0.03)], (0.05, 0.05, 0.18)))
    assert row(octree, 0.05) == ground


def test_ray_straight_onto_a_wall_frees_everything_in_front_of_it():
    octree = OctreeMap(RES)
    wall = [(1.55, y / 20, z / 20) for y in range(-10, 12) for z in range(-10, 12)]
    octree.insert_sweep(*rays(wall, (0.05, 0.05, 0.05)))
    assert row(octree, 0.05) == "1" * 15 + "#...."


def test_ray_down_onto_the_ground_frees_everything_above_it():
    octree = OctreeMap(RES)
    ground = [(x / 20, y / 20, -0.95) for x in range(-10, 12) for y in range(-10, 12)]
    octree.insert_sweep(*rays(ground, (0.05, 0.05, 0.55)))
    column = octree.states_at([[0.05, 0.05, -0.95 + 0.1 * k] for k in range(16)])
    assert column.tolist() == [OCCUPIED] + [FREE] * 15


def test_ray_under_a_ceiling_keeps_the_ceiling():
    octree = OctreeMap(RES)
    insert_plane(octree, [0.85, 0.05, 0.95], 0.849)
    before = row(octree, 0.95)
    for _ in range(5):
        octree.insert_sweep(*rays([(1.65, 0.05, 0.98), (1.65, 0.15, 0.98)], (0.75, 0.05, 0.89)))
    assert row(octree, 0.95) == before


def test_thing_that_moved_away_is_freed_by_rays_to_the_wall_behind_it():
    octree = OctreeMap(RES)
    thing = [(0.55, 0.05, z / 10 + 0.05) for z in range(3)]
    wall = [(1.85, y / 10 + 0.05, z / 10 + 0.05) for y in range(-8, 9) for z in range(-8, 11)]
    octree.insert_sweep(*rays(thing, (0.05, 0.05, 0.15)))
    for _ in range(3):
        octree.insert_sweep(*rays(wall, (0.05, 0.05, 0.15)))
    assert [row(octree, z)[5] for z in (0.05, 0.15, 0.25)] == ["1", "1", "1"]


def test_single_hit_tells_of_no_surface_and_frees_its_whole_ray():
    octree = OctreeMap(RES)
    octree.insert_sweep(*rays([(1.55, 0.05, 0.05)], (0.05, 0.05, 0.05)))
    assert row(octree, 0.05) == "1" * 15 + "#...."


def ground_sweep(x: float, height: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A tilting laser 0.9 m above level ground at z = height: lines every 0.35 deg, 270 beams over 135 deg, 1.5 cm noise."""
    tilt, beam = np.deg2rad(np.meshgrid(np.arange(4.0, 80.0, 0.35), np.arange(-67.5, 67.5, 0.5), indexing="ij"))
    direction = np.stack([np.cos(beam) * np.cos(tilt), np.sin(beam), -np.cos(beam) * np.sin(tilt)], axis=-1).reshape(-1, 3)
    origin = np.array([x, 0.0, height + 0.9])
    reach = -0.9 / direction[:, 2] + rng.normal(0, 0.015, len(direction))
    points = origin + direction * reach[:, None]
    return points.astype(np.float32), np.broadcast_to(origin, points.shape).astype(np.float32)


def ground_seen(octree: OctreeMap, height: float) -> float:
    """Share of the columns of a strip 4 m wide and 6 m long that have an occupied voxel at the ground."""
    x, y = np.meshgrid(np.arange(1.0, 7.0, RES) + RES / 2, np.arange(-2.0, 2.0, RES) + RES / 2, indexing="ij")
    layers = [octree.states_at(np.stack([x.ravel(), y.ravel(), np.full(x.size, height + dz)], 1)) for dz in (-RES, 0.0, RES)]
    return float((np.array(layers) == OCCUPIED).any(axis=0).mean())


@pytest.mark.parametrize("height", [0.02, 0.05])  # metres above the lower border of the voxel
def test_ground_seen_from_near_survives_sweeps_from_afar(height):
    """Why the rule is on by default: without it flat rays from 7 to 13 m away erase ground that was seen well before."""
    kept = {}
    for grazing_m in (0.0, SensorModel().grazing_m):
        rng = np.random.default_rng(5)
        octree = OctreeMap(RES, replace(OCTOMAP, grazing_m=grazing_m))
        for x in (0.0, 1.0):
            octree.insert_sweep(*ground_sweep(x, height, rng), max_range_m=15.0)
        near = ground_seen(octree, height)
        for _ in range(8):
            octree.insert_sweep(*ground_sweep(-6.0, height, rng), max_range_m=15.0)
        kept[grazing_m] = ground_seen(octree, height) / near
    assert kept[SensorModel().grazing_m] >= 1.0
    assert kept[0.0] < 0.5


DECK = [(0.55 + x / 10, y / 10 + 0.05, 0.02) for x in range(6) for y in range(-3, 4)], (0.05, 0.05, 1.0)
OVER_IT = [(9.0, y / 10 + 0.05, 0.35) for y in range(-9, 10)], (-0.95, 0.05, 0.0)


@pytest.mark.parametrize(("model", "kept"), [(SensorModel(), "######"), (OCTOMAP, "111111")])
@pytest.mark.parametrize("before, after", [(0, 5), (10, 1)])
def test_deck_is_known_although_rays_from_below_pass_over_its_edge(model, kept, before, after):
    """They cross the upper parts of the voxels that its floor lies in, and end at no surface there."""
    octree = OctreeMap(RES, model)
    for _ in range(before):
        octree.insert_sweep(*rays(*OVER_IT), max_range_m=5.0)
    octree.insert_sweep(*rays(*DECK))
    for _ in range(after):
        octree.insert_sweep(*rays(*OVER_IT), max_range_m=5.0)
    assert row(octree, 0.05)[5:11] == kept
