"""The world `moon` (thesis 5.2, 7.3): rolling ground with craters and a few boulders inside four walls, all of it from the seed."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

from pybullet_simulation.solids import Solid, hull, walls_around
from world_files import HeightField, Surface, surface_from_heights

Array = NDArray[np.float64]

SIDE_M, STEP_M = 20.0, 0.125
WALL_M = 0.2
FLAT_RADIUS_M, BLEND_M = 1.3, 2.5  # level around the start, and the width over which it fades into the terrain
CLEAR_OF_START_M = 4.0
GENTLE, STEEP = (0.10, 0.20), (0.42, 0.55)  # depth of a crater over its radius


def moon(rng: np.random.Generator, start_xy: tuple[float, float] | None) -> tuple[HeightField, Surface, list[Solid], tuple[float, float]]:
    """Terrain, its triangles, walls and boulders, and the middle of the level spot: `start_xy`, or one of the seed's choice."""
    chosen = rng.uniform(-6.5, 6.5, 2)
    spot = (float(chosen[0]), float(chosen[1])) if start_xy is None else start_xy
    axis = np.arange(round(SIDE_M / STEP_M) + 1) * STEP_M - SIDE_M / 2
    x, y = np.meshgrid(axis, axis)
    heights = _levelled(_rolling(rng, x.shape) + _craters(rng, x, y, spot), x, y, spot)
    field = HeightField(heights, float(axis[0]), float(axis[0]), STEP_M)
    low, high = (-SIDE_M / 2, -SIDE_M / 2), (SIDE_M / 2, SIDE_M / 2)
    walls = walls_around(low, high, float(heights.min()) - 0.5, float(heights.max()) + 1.4, WALL_M)
    return field, surface_from_heights(field), [*walls, *_boulders(rng, field, spot)], spot


def _rolling(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Hills of some 6 m, hummocks of 1.5 m and a little roughness, none steeper than some 15 deg."""
    total = np.zeros(shape)
    for width_m, height_m in ((1.8, 0.20), (0.6, 0.03), (0.2, 0.006)):
        noise = gaussian_filter(rng.standard_normal(shape), width_m / STEP_M, mode="reflect")
        total += height_m * noise / noise.std()
    return total


def _craters(rng: np.random.Generator, x: Array, y: Array, spot: tuple[float, float]) -> Array:
    """Bowls with raised rims; three of them too steep to drive, and those keep off the start."""
    total = np.zeros_like(x)
    for i in range(int(rng.integers(9, 13))):
        steep = i < 3
        radius = rng.uniform(0.8, 1.3) if steep else rng.uniform(0.6, 2.4)
        depth = radius * rng.uniform(*(STEEP if steep else GENTLE))
        total += _crater(np.hypot(x - (c := _place(rng, spot, steep))[0], y - c[1]) / radius, depth)
    return total


def _place(rng: np.random.Generator, spot: tuple[float, float], clear: bool) -> Array:
    while True:
        centre = rng.uniform(-8.5, 8.5, 2)
        if not clear or math.dist(centre, spot) > CLEAR_OF_START_M:
            return np.asarray(centre)


def _crater(r: Array, depth: float) -> Array:
    """A paraboloid bowl up to the rim at r = 1, then ejecta that fall off; the rim stands 0.2 of the depth above the plain."""
    rim = 0.2 * depth
    bowl = -depth + (depth + rim) * r**2
    return np.where(r < 1.0, bowl, rim * np.exp(-4.0 * (np.maximum(r, 1.0) - 1.0)))


def _levelled(heights: Array, x: Array, y: Array, spot: tuple[float, float]) -> Array:
    distance = np.hypot(x - spot[0], y - spot[1])
    level = float(heights[distance < FLAT_RADIUS_M].mean())
    u = np.clip((distance - FLAT_RADIUS_M) / BLEND_M, 0.0, 1.0)
    keep = u * u * (3.0 - 2.0 * u)
    return np.asarray(level + keep * (gaussian_filter(heights, 1.0) - level))


def _boulders(rng: np.random.Generator, field: HeightField, spot: tuple[float, float]) -> list[Solid]:
    boulders = []
    for i in range(int(rng.integers(4, 7))):
        centre, size = _place(rng, spot, True), rng.uniform(0.25, 0.5)
        points = rng.standard_normal((40, 3))
        points *= size * rng.uniform(0.8, 1.1, (40, 1)) / np.linalg.norm(points, axis=1, keepdims=True)
        row, column = (centre[1] - field.y0) / field.step, (centre[0] - field.x0) / field.step
        ground = float(map_coordinates(field.heights, [[row], [column]], order=1)[0])
        boulders.append(hull(f"boulder_{i}", points + [*centre, ground + 0.4 * size]))
    return boulders
