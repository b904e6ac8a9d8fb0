"""Random small maps with measured heights: classes turn, mirror and move with the world, and do not depend on where the flood began."""

import numpy as np
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from terrain_worlds import FREE, OCCUPIED, UNKNOWN, label_set, pose

from octomap_server_3dnav.octree.column_runs import ColumnRuns
from octomap_server_3dnav.octree.surface_heights import HitHeights, SurfaceHeights
from octomap_server_3dnav.terrain.classify import Terrain, TerrainClass, TerrainConfig, classify
from robot_body import RobotBody

SIDE, LAYERS, GROUND, RESOLUTION = 40, 40, 14, 1 / 16  # a power of two: nothing is rounded when the world turns or moves
PARTS = np.array([1, 5, 11, 15]) / 16  # of a voxel, where its beams ended; the same from both sides
ROBOT = RobotBody(length_m=0.3, width_m=0.3, height_m=0.5, wheel_radius_m=0.11, wheel_width_m=0.05, track_m=0.2, wheelbase_m=0.05)
SMALL = TerrainConfig(min_ground_voxels=1)
seeds = st.integers(0, 2**32 - 1)
checked = settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
Labels = set[tuple[int, int, int, int]]


def ground(seed: int) -> NDArray[np.float64]:
    """(4 * SIDE, 4 * SIDE) heights of the ground in voxels: slopes up to the limit and beyond, kerbs, trenches, roughness."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(4 * SIDE) / 4 - SIDE / 2, np.arange(4 * SIDE) / 4 - SIDE / 2, indexing="ij")
    height = np.zeros(x.shape)
    for _ in range(rng.integers(0, 3)):
        a, b, c = rng.uniform(-1, 1, 3)
        height += np.clip(rng.choice([0.3, 0.44, 0.47, 0.6]) * (a * x + b * y) / np.hypot(a, b) + 4 * c, 0, rng.uniform(1, 6))
    for _ in range(rng.integers(0, 4)):
        cx, cy = rng.integers(0, SIDE, 2) * 4
        height[cx : cx + rng.integers(4, 80), cy : cy + rng.integers(4, 80)] += rng.choice([-2.4, -1.2, 0.8, 1.4, 1.58, 1.62, 1.8, 2.5])
    height += rng.choice([0.0, 0.02, 0.15]) * rng.standard_normal(height.shape)
    return np.asarray(GROUND + 0.4 + np.clip(height, -GROUND, LAYERS - GROUND - 12))


def classified(height: NDArray[np.float64], robot: tuple[int, int], moved: tuple[int, int, int] = (0, 0, 0)) -> Terrain:
    """The terrain of a ground around a robot in the middle of a column, all of it `moved` by voxels."""
    at = (np.arange(4 * SIDE) // 4 + np.tile(PARTS, SIDE))[:, None]
    points = np.stack([np.broadcast_to(at, height.shape), np.broadcast_to(at.T, height.shape), height], axis=-1).reshape(-1, 3)
    heights = SurfaceHeights(RESOLUTION)
    heights.add(HitHeights.of((points + moved) * RESOLUTION, RESOLUTION))
    ix, iy, iz = np.floor(points).astype(int).T
    top = np.zeros((SIDE, SIDE), dtype=int)
    np.maximum.at(top, (ix, iy), iz)
    states = np.where(np.arange(LAYERS) > top[:, :, None], FREE, UNKNOWN).astype(np.uint8)
    states[ix, iy, iz] = OCCUPIED
    under = height[4 * robot[0] + 1, 4 * robot[1] + 1]
    x, y, z = ((n + shift) * RESOLUTION for n, shift in zip((robot[0] + 0.5, robot[1] + 0.5, under), moved, strict=True))
    return classify(ColumnRuns.from_dense(states, moved, RESOLUTION), pose(x, y, z), SMALL, ROBOT, None, heights)


MIDDLE = (SIDE // 2, SIDE // 2)


def in_the_open(terrain: Terrain) -> bool:
    """Whether the robot stands where it can turn: else the nearest such place counts, of two as far away either one."""
    return terrain.start is not None and bool(terrain.label[terrain.start] == TerrainClass.TRAVERSABLE)


def mapped(terrain: Terrain, to: object) -> Labels:
    """The labels of a terrain with x and y put elsewhere."""
    return {(*to(x, y), z, label) for x, y, z, label in label_set(terrain)}  # type: ignore[operator]


@checked
@given(seeds)
def test_classes_turn_and_mirror_with_the_world(seed: int) -> None:
    height, last = ground(seed), SIDE - 1
    terrain = classified(height, MIDDLE)
    assume(in_the_open(terrain))
    expected = label_set(terrain)
    mirrored = classified(height[::-1].copy(), (last - MIDDLE[0], MIDDLE[1]))
    assert mapped(mirrored, lambda x, y: (last - x, y)) == expected
    turned = classified(np.rot90(height).copy(), (last - MIDDLE[1], MIDDLE[0]))
    assert mapped(turned, lambda x, y: (y, last - x)) == expected


@checked
@given(seeds, st.integers(-300, 300), st.integers(-300, 300), st.integers(-50, 50))
def test_classes_move_with_the_world(seed: int, dx: int, dy: int, dz: int) -> None:
    height = ground(seed)
    moved = label_set(classified(height, MIDDLE, (dx, dy, dz)))
    assert {(x - dx, y - dy, z - dz, label) for x, y, z, label in moved} == label_set(classified(height, MIDDLE))


@checked
@given(seeds, st.randoms(use_true_random=False))
def test_classes_do_not_depend_on_where_the_flood_began(seed: int, random: object) -> None:
    height = ground(seed)
    terrain = classified(height, MIDDLE)
    assume(in_the_open(terrain))
    open_ground = np.flatnonzero(terrain.reached & (terrain.label == TerrainClass.TRAVERSABLE))
    node = random.choice(open_ground.tolist())  # type: ignore[attr-defined]
    assert label_set(classified(height, (int(terrain.ix[node]), int(terrain.iy[node])))) == label_set(terrain)
