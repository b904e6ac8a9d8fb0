"""A picture of a world from above and below its upper storey: `python -m pybullet_simulation.preview ramp --seed 1 --out ramp.png`."""

import argparse
from pathlib import Path

import matplotlib
import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.world import World, nearest_hits, raycasting_scene
from pybullet_simulation.worlds import load_world

Array = NDArray[np.float64]

HEAD_M = 1.7  # above the start's ground, for the lower picture


def heights_from_above(world: World, top_z: float, step_m: float = 0.05) -> Array:
    """(rows, columns) height of the first surface below `top_z`, NaN where there is none; first row at the lowest y."""
    (x0, y0, _), (x1, y1, _) = world.extent
    x, y = np.meshgrid(np.arange(x0, x1, step_m) + step_m / 2, np.arange(y0, y1, step_m) + step_m / 2)
    rays = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, top_z), np.tile((0.0, 0.0, -1.0), (x.size, 1))])
    hits = nearest_hits(raycasting_scene(world.vertices, world.triangles), rays.astype(np.float32)).astype(float)
    return np.where(np.isfinite(hits), top_z - hits, np.nan).reshape(x.shape)


def draw(world: World, path: Path) -> None:
    """Write the picture; the arrow is the start."""
    matplotlib.use("Agg")
    from matplotlib import pyplot

    (x0, y0, _), (x1, y1, z1) = world.extent
    figure, axes = pyplot.subplots(1, 2, figsize=(15, 7))
    for axis, top, title in ((axes[0], z1 + 1.0, "from above"), (axes[1], world.start_z + HEAD_M, f"below {HEAD_M} m over the start")):
        image = axis.imshow(heights_from_above(world, top), origin="lower", extent=(x0, x1, y0, y1), cmap="terrain")
        x, y, yaw = world.start_xyyaw
        axis.arrow(x, y, np.cos(yaw), np.sin(yaw), width=0.1, color="red")
        axis.set_title(f"{Path(world.name).name}, {title}")
        figure.colorbar(image, ax=axis, label="height in m")
    figure.savefig(path, dpi=80, bbox_inches="tight")
    pyplot.close(figure)


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("world")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--size", type=float, nargs=3, metavar=("X", "Y", "Z"))
    parser.add_argument("--area", type=float, nargs=2, metavar=("X", "Y"))
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    draw(load_world(given.world, given.seed, given.size, given.area), given.out)


if __name__ == "__main__":
    main()
