"""The classification of random small maps is that of the oracle, which is slow and in plain Python."""

from functools import partial

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from terrain_oracle import Node, Oracle
from terrain_worlds import FREE, OCCUPIED, RESOLUTION, UNKNOWN, label_set, pose

from octomap_server_3dnav.octree.column_runs import ColumnRuns
from octomap_server_3dnav.terrain.classify import TerrainClass, TerrainConfig, classify
from octomap_server_3dnav.terrain.config import Limits
from octomap_server_3dnav.terrain.flood import _is_too_steep
from octomap_server_3dnav.terrain.scene import Scene, scene_around
from robot_body import RobotBody

SIDE, LAYERS, GROUND = 22, 16, 4
ROBOT = RobotBody(length_m=0.25, width_m=0.2, height_m=0.3, wheel_radius_m=0.11, wheel_width_m=0.02, track_m=0.1, wheelbase_m=0.02)


def rough_map(rng: np.random.Generator) -> np.ndarray:
    """(SIDE, SIDE, LAYERS) states: uneven ground with steps, pits, things on it, holes, ceilings, and parts that were not seen."""
    x, y = np.meshgrid(np.arange(SIDE), np.arange(SIDE), indexing="ij")
    slope = rng.uniform(-0.5, 0.5, 2)
    height = GROUND + slope[0] * (x - SIDE / 2) * (rng.random() < 0.5) + slope[1] * (y - SIDE / 2) * (rng.random() < 0.3)
    for _ in range(rng.integers(0, 5)):
        cx, cy, size = *rng.integers(0, SIDE, 2), rng.integers(2, 12)
        height[cx : cx + size, cy : cy + size] += rng.integers(-3, 4)
    pits = rng.integers(0, SIDE, (2, rng.integers(0, 8)))
    height[pits[0], pits[1]] -= rng.integers(1, 4)
    height[pits[0], np.minimum(pits[1] + rng.integers(0, 2), SIDE - 1)] -= rng.integers(1, 4)
    z = np.clip(np.round(height + rng.uniform(-0.4, 0.4, height.shape) * (rng.random() < 0.5)).astype(int), 0, LAYERS - 3)
    k = np.arange(LAYERS)
    states = np.where(k > z[:, :, None], FREE, np.where(k == z[:, :, None], OCCUPIED, UNKNOWN))
    for state in rng.choice([FREE, OCCUPIED, UNKNOWN], rng.integers(0, 12), p=[0.25, 0.35, 0.4]):
        low = rng.integers(0, [SIDE, SIDE, LAYERS])
        high = low + rng.integers(1, [6, 6, 9])
        states[low[0] : high[0], low[1] : high[1], low[2] : high[2]] = state
    for _ in range(rng.integers(0, 4)):
        _stand_in_own_shadow(states, z, rng)
    if rng.random() < 0.4:
        _hide_strip_before_edge(states, rng)
    speckled = rng.random(states.shape) < rng.choice([0.0, 0.02])
    return np.where(speckled, UNKNOWN, states).astype(np.uint8)


def _stand_in_own_shadow(states: np.ndarray, ground: np.ndarray, rng: np.random.Generator) -> None:
    """A thing on the ground, and a column or two beside it of which nothing was seen up to a step or two."""
    x, y = rng.integers(2, SIDE - 4, 2)
    states[x, y : y + 3, ground[x, y] : ground[x, y] + rng.integers(4, 7)] = OCCUPIED
    for i in range(x + 1, x + 1 + rng.integers(1, 3)):
        states[i, y : y + 3, : ground[i, y] + rng.integers(1, 4)] = UNKNOWN


def _hide_strip_before_edge(states: np.ndarray, rng: np.random.Generator) -> None:
    """A strip that nobody has seen, ground beyond it, and air where that ends."""
    x, width = rng.integers(SIDE // 2 + 1, SIDE - 4), rng.integers(1, 4)
    states[x : x + rng.integers(2, 4)] = UNKNOWN
    states[x + 2 + width :] = FREE


def nodes_of(scene: Scene) -> list[Node]:
    """Its surfaces in their order."""
    found = scene.surfaces
    x, y = np.divmod(found.column, scene.columns.ny)
    return [Node(*voxel) for voxel in zip((x + scene.key[0]).tolist(), (y + scene.key[1]).tolist(), found.z.tolist(), strict=True)]


@settings(max_examples=100, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(
    seed=st.integers(0, 2**32 - 1),
    fill=st.integers(0, 3),
    margin_m=st.sampled_from([0.0, 0.1]),
    evidence=st.sampled_from(["seen", "seen", "assumed"]),
)
def test_classes_are_those_of_the_oracle(seed, fill, margin_m, evidence):
    states = rough_map(np.random.default_rng(seed))
    config = TerrainConfig(
        clearance_margin_m=0.02, min_ground_voxels=1, look_m=0.4, fill_columns=fill, margin_m=margin_m, cliff_evidence=evidence
    )
    middle = SIDE / 2 * RESOLUTION
    runs, here = ColumnRuns.from_dense(states, (0, 0, 0), RESOLUTION), pose(middle, middle, GROUND * RESOLUTION)
    limits = Limits.of(config, ROBOT, RESOLUTION)
    scene = scene_around(runs, None, here[:3, 3], None, limits)
    nodes = nodes_of(scene)
    number = {node: i for i, node in enumerate(nodes)}
    oracle = Oracle({(int(x), int(y), int(z)): int(states[x, y, z]) for x, y, z in np.argwhere(states != UNKNOWN)}, limits)

    assert set(nodes) == set(oracle.height)
    assert {n for n, is_filled in zip(nodes, scene.surfaces.filled, strict=True) if is_filled} == oracle.filled
    assert scene.surfaces.height.tolist() == pytest.approx([oracle.height[n] for n in nodes], abs=1e-5)
    assert scene.links.graph.tolist() == [[number.get(oracle.edge(n, k), -1) for k in range(4)] for n in nodes]

    terrain = classify(runs, here, config, ROBOT, None)
    if terrain.start is None:
        return
    start = Node(int(terrain.ix[terrain.start]), int(terrain.iy[terrain.start]), int(terrain.z[terrain.start]))
    found = {(x, y, z, TerrainClass.TRAVERSABLE if c == TerrainClass.INFLATION else c) for x, y, z, c in label_set(terrain)}
    is_too_steep = partial(_is_too_steep, scene.surfaces, scene.links, scene.columns.ny)
    assert found == oracle.classes(start, lambda node: bool(is_too_steep(number[node], limits)))

    ground = np.isin(terrain.label[: terrain.surface_count], (TerrainClass.TRAVERSABLE, TerrainClass.INFLATION))
    kept_off = terrain.distance_m[: terrain.surface_count] <= (limits.keep_off + 1e-6) * RESOLUTION
    assert np.array_equal(terrain.label[: terrain.surface_count][ground] == TerrainClass.INFLATION, kept_off[ground])
