"""Draws cubes into an image: parallel projection, depth buffer, shading that makes steps and edges readable.

Made for the pictures of a run; needs neither a display nor a graphics library. A view's right, up and toward (the
viewer) are unit vectors of the map frame; one picture's scale holds for all of it, so that a scale bar means something.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

Floats = NDArray[np.float64]
Image = NDArray[np.float32]
Depth = NDArray[np.float32]

_FACE_LIGHT = np.array([0.80, 0.66, 1.0], dtype=np.float32)  # faces across x, across y, and tops
_SOFT_SHADOW_M = 0.35
_EDGE_SHADOW_M = 0.16


@dataclass(frozen=True)
class View:
    """A parallel projection: axes (3, 3) with the rows right, up and toward the viewer, all in the map frame."""

    axes: Floats

    @classmethod
    def from_above(cls) -> "View":
        """x to the right, y up, as on a map."""
        return cls(np.eye(3))

    @classmethod
    def at_angle(cls, azimuth_rad: float, elevation_rad: float) -> "View":
        """From a direction (azimuth counted from x towards y) and so far above the horizon."""
        ca, sa, ce, se = math.cos(azimuth_rad), math.sin(azimuth_rad), math.cos(elevation_rad), math.sin(elevation_rad)
        return cls(np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]]))

    def project(self, points: Floats) -> Floats:
        """(N, 3) right, up and toward of (N, 3) points, in metres."""
        return np.asarray(points @ self.axes.T)


@dataclass(frozen=True)
class Canvas:
    """Pixels over the projected plane: `low` (2,) is its lower left corner in metres."""

    low: Floats
    pixels_per_m: float
    width: int
    height: int

    @classmethod
    def around(cls, projected: Floats, max_width: int, max_height: int, margin_m: float) -> "Canvas":
        """The largest picture of (N, 2+) projected points that fits."""
        low, high = projected[:, :2].min(axis=0) - margin_m, projected[:, :2].max(axis=0) + margin_m
        scale = float(min(max_width / (high[0] - low[0]), max_height / (high[1] - low[1])))
        return cls(low, scale, math.ceil((high[0] - low[0]) * scale), math.ceil((high[1] - low[1]) * scale))

    def pixels(self, projected: Floats) -> Floats:
        """(N, 2) column and row (downwards) of (N, 2+) projected points."""
        right_up = (projected[:, :2] - self.low) * self.pixels_per_m
        return np.column_stack([right_up[:, 0], self.height - right_up[:, 1]])

    def enlarged(self, factor: int) -> "Canvas":
        """The same plane with more pixels."""
        return Canvas(self.low, self.pixels_per_m * factor, self.width * factor, self.height * factor)


def render_cubes(
    centres: Floats, sizes: Floats, colours: Image, bias_m: Floats, view: View, canvas: Canvas, background: tuple[float, float, float]
) -> tuple[Image, Depth]:
    """(H, W, 3) colours in 0..1 and (H, W) depth (metres toward the viewer, -inf where nothing is) of (N, 3) cubes.

    Sizes (N,) are edge lengths; bias (N,) brings a cube forward in the depth test, where two share a face.
    """
    depth = np.full((canvas.height, canvas.width), -np.inf, dtype=np.float32)
    image = np.empty((canvas.height, canvas.width, 3), dtype=np.float32)
    image[:] = background
    projected = view.project(centres)
    projected[:, :2] = canvas.pixels(projected)
    # Pixel steps of one metre along x, y and z, and how much nearer that metre is.
    steps = np.column_stack([view.axes[0] * canvas.pixels_per_m, -view.axes[1] * canvas.pixels_per_m, view.axes[2]])
    _draw(projected, 0.5 * sizes, colours.astype(np.float32), bias_m, steps, _FACE_LIGHT, image, depth)
    return _shaded(image, depth, canvas.pixels_per_m), depth


@njit(cache=True)
def _draw(projected: Floats, halves: Floats, colours: Image, bias: Floats, steps: Floats, light: Image, image: Image, depth: Depth) -> None:
    for n in range(projected.shape[0]):
        for axis in range(3):
            toward = steps[axis, 2]
            if abs(toward) < 1e-6:
                continue
            h = halves[n]
            side = h if toward > 0 else -h
            a, b = (axis + 1) % 3, (axis + 2) % 3
            _draw_face(
                projected[n, 0] + side * steps[axis, 0],
                projected[n, 1] + side * steps[axis, 1],
                projected[n, 2] + side * toward + bias[n],
                h * steps[a],
                h * steps[b],
                colours[n] * light[axis],
                image,
                depth,
            )


@njit(cache=True)
def _draw_face(x: float, y: float, z: float, u: Floats, v: Floats, colour: Image, image: Image, depth: Depth) -> None:
    area = u[0] * v[1] - u[1] * v[0]
    if abs(area) < 1e-9:
        return
    reach_x, reach_y = abs(u[0]) + abs(v[0]), abs(u[1]) + abs(v[1])
    for row in range(max(0, int(y - reach_y)), min(depth.shape[0], int(y + reach_y) + 2)):
        for column in range(max(0, int(x - reach_x)), min(depth.shape[1], int(x + reach_x) + 2)):
            dx, dy = column + 0.5 - x, row + 0.5 - y
            s, t = (dx * v[1] - dy * v[0]) / area, (u[0] * dy - u[1] * dx) / area
            if abs(s) <= 1.0001 and abs(t) <= 1.0001:
                here = z + s * u[2] + t * v[2]
                if here > depth[row, column]:
                    depth[row, column] = here
                    image[row, column] = colour


def _shaded(image: Image, depth: Depth, pixels_per_m: float) -> Image:
    """Darkened where something nearer stands beside a pixel: a wide soft shadow and a narrow line at edges."""
    seen = np.isfinite(depth)
    if not seen.any():
        return image
    wide = _nearer_around(depth, _SOFT_SHADOW_M * pixels_per_m)
    narrow = _nearer_around(depth, max(1.0, 0.02 * pixels_per_m))
    light = 1.0 - 0.22 * np.clip(wide / (2.0 * _SOFT_SHADOW_M), 0, 1) - 0.34 * np.clip(narrow / _EDGE_SHADOW_M, 0, 1)
    light[~seen] = 1.0
    image *= light[..., None]
    return image


def _nearer_around(depth: Depth, sigma: float) -> Depth:
    """How much nearer to the viewer the mean of the surroundings is (metres, 0 where it is farther)."""
    # A wide mean needs few pixels: it is taken of every n-th and magnified.
    step = max(1, int(sigma / 4))
    few = depth[::step, ::step]
    seen = np.isfinite(few).astype(np.float32)
    weight = gaussian_filter(seen, sigma / step, truncate=2.5)
    mean = gaussian_filter(np.where(seen > 0, few, np.float32(0)), sigma / step, truncate=2.5)
    around = np.divide(mean, weight, out=np.full_like(mean, -np.inf), where=weight > 1e-3)
    around = np.repeat(np.repeat(around, step, axis=0), step, axis=1)[: depth.shape[0], : depth.shape[1]]
    nearer = np.subtract(around, depth, out=np.zeros_like(depth), where=np.isfinite(depth) & np.isfinite(around))
    return np.asarray(np.maximum(nearer, np.float32(0)))
