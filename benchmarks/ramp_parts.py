"""How much of each part of the world `ramp` finished runs know as ground: a coverage that counts the narrow ramp and the block, too.

    python benchmarks/ramp_parts.py RUN_DIR ..

With PYTHONPATH as benchmarks/README.md sets it. The score of a run counts places where the robot can turn; of the ramp of 1 m and the
block behind it that is next to nothing. Here a place of a floor counts if the classified map that the run left has a surface there. Also:
how high up the narrow ramp the robot was.
"""

import argparse
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from exploration_evaluation import read_trajectory, trajectory_errors
from exploration_evaluation.run_files import read_arrays
from pybullet_simulation import ramp_world
from rigid_geometry import transform_points
from robot_body import RobotBody

Array = NDArray[np.float64]

PLACE_M = 0.08
NEAR_M = 0.1  # a surface voxel's middle from a place of a floor that it is part of
HEAD = "| run | plateau | under it | its ramp | narrow ramp | block | highest on the narrow ramp |\n|---|---|---|---|---|---|---|"


def level(height: float) -> Callable[[Array], Array]:
    """A floor at one height."""
    return lambda x: np.full_like(x, height)


def rising_to(x_top: float, top: float, towards: float) -> Callable[[Array], Array]:
    """A ramp whose head is at `x_top`; `towards`: 1 if it rises along x, -1 if against it."""
    return lambda x: top - towards * (x_top - x) * math.tan(ramp_world.SLOPE_RAD)


def places(low: tuple[float, float], high: tuple[float, float], height: Callable[[Array], Array]) -> Array:
    """(N, 3) places of a floor in the world, all over it but for half a voxel at its rim."""
    x, y = (np.arange(a + PLACE_M / 2, b - PLACE_M / 2, PLACE_M) for a, b in zip(low, high, strict=True))
    at = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.column_stack([at, height(at[:, 0])])


def parts() -> dict[str, Array]:
    """The floors of the world, in the order of the columns."""
    w = ramp_world
    (x0, y0), (x1, y1), top = *w.PLATEAU, w.PLATEAU_HEIGHT_M
    (bx0, by0), (bx1, by1), block = *w.BLOCK, w.BLOCK_HEIGHT_M
    run, narrow_run = top / math.tan(w.SLOPE_RAD), block / math.tan(w.SLOPE_RAD)
    middle, half = (by0 + by1) / 2, w.NARROW_M / 2
    return {
        "plateau": places((x0, y0), (x1, y1), level(top)),
        "under it": places((x0 + 0.3, y0 + 0.4), (x1 - 0.4, y1 - 0.4), level(0.0)),
        "its ramp": places((x0 - run, w.RAMP_Y[0]), (x0, w.RAMP_Y[1]), rising_to(x0, top, 1.0)),
        "narrow ramp": places((bx1, middle - half), (bx1 + narrow_run, middle + half), rising_to(bx1, block, -1.0)),
        "block": places((bx0, by0), (bx1, by1), level(block)),
    }


def known_of(run: Path) -> tuple[list[float], float | None]:
    """The share of each part that is known, and the height of the ground under the robot where it was highest on the narrow ramp, None if
    it was never there."""
    truth, estimate = read_trajectory(run / "trajectory_truth.txt"), read_trajectory(run / "trajectory.txt")
    terrain, T_world_map = read_arrays(run / "terrain.npz", ("x", "y", "z")), trajectory_errors(*estimate, *truth).T_world_map
    tree = cKDTree(transform_points(T_world_map, np.stack([terrain[axis] for axis in "xyz"], axis=1).astype(np.float64)))
    floors = parts()
    shares = [float(np.isfinite(tree.query(floor, distance_upper_bound=NEAR_M)[0]).mean()) for floor in floors.values()]
    low, high = floors["narrow ramp"][:, :2].min(axis=0), floors["narrow ramp"][:, :2].max(axis=0)
    at = truth[1][:, :3, 3]
    on_it = ((at[:, :2] >= low) & (at[:, :2] <= high)).all(axis=1)
    return shares, float(at[on_it, 2].max()) - RobotBody().base_height_m if on_it.any() else None


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=Path)
    print(HEAD)
    for run in parser.parse_args().runs:
        shares, highest = known_of(run)
        height = "never there" if highest is None else f"{highest:.2f} m"
        print(f"| {run.name} | {' | '.join(f'{100 * share:.1f} %' for share in shares)} | {height} |", flush=True)


if __name__ == "__main__":
    main()
