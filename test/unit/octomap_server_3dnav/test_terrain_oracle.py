"""The classification of random small maps is that of the oracle, which is slow and in plain Python."""

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from terrain_oracle import Node, Oracle
from terrain_worlds import FREE, OCCUPIED, RESOLUTION, UNKNOWN, label_set, pose

from octomap_server_3dnav.octree.column_runs import ColumnRuns
from octomap_server_3dnav.terrain.classify import TerrainConfig, classify

SIDE, LAYERS, GROUND = 22, 16, 4
SMALL = {"robot_height_m": 0.3, "clearance_margin_m": 0.02, "min_traversable_voxels": 1, "cliff_look_m": 0.4}


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


@settings(max_examples=150, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(
    seed=st.integers(0, 2**32 - 1),
    inflation_m=st.sampled_from([0.0, 0.16, 0.25]),
    narrow_m=st.sampled_from([0.08, 0.16, 0.25]),
    hole=st.integers(0, 3),
    area=st.integers(0, 2),
    evidence=st.sampled_from(["seen", "seen", "assumed"]),
    shape=st.sampled_from(["circle", "square"]),
)
def test_classes_are_those_of_the_oracle(seed, inflation_m, narrow_m, hole, area, evidence, shape):
    states = rough_map(np.random.default_rng(seed))
    config = TerrainConfig(
        **SMALL,
        inflation_radius_m=inflation_m,
        cliff_inflation_radius_m=inflation_m,
        narrow_radius_m=narrow_m,
        narrow_cliff_radius_m=narrow_m,
        hole_bridge_voxels=hole,
        cliff_area_voxels=area,
        cliff_evidence=evidence,
        inflation_shape=shape,
    )
    middle = SIDE / 2 * RESOLUTION
    terrain = classify(ColumnRuns.from_dense(states, (0, 0, 0), RESOLUTION), pose(middle, middle, GROUND * RESOLUTION), config, None)
    if terrain.start is None:
        return
    start = Node(int(terrain.ix[terrain.start]), int(terrain.iy[terrain.start]), int(terrain.z[terrain.start]))
    voxels = {(int(x), int(y), int(z)): int(states[x, y, z]) for x, y, z in np.argwhere(states != UNKNOWN)}
    oracle = Oracle(voxels, config, RESOLUTION)
    assert label_set(terrain) == oracle.classes(start)
    at = np.stack([terrain.ix, terrain.iy, terrain.z], axis=1)[terrain.narrow]
    assert {Node(*map(int, voxel)) for voxel in at} == oracle.narrow
