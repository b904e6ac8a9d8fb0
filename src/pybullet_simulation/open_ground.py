"""Where movers can go in a world: the ground that the robot's start leads to, on a grid, and how much room there is on it."""

import numba
import numpy as np
import open3d as o3d
from numpy.typing import NDArray
from scipy import ndimage

from pybullet_simulation.config import SimulationConfig
from pybullet_simulation.disturbances import Hands, disturbances_of
from pybullet_simulation.world import World, raycasting_scene
from robot_body import RobotBody
from simulated_movers import Crowd, OpenGround, RobotSeen

Array = NDArray[np.float64]

STEP_M = 0.1
HEADROOM_M = 1.9
RISE_M = 0.06  # from cell to cell: nobody is pushed or walks up more than 31 degrees
BESIDE_M = (0.5, 1.0, 1.6)  # heights over the ground at which the room beside it counts

GROUND_APART = 0.85  # of such a height lies even a slope of 31 degrees away: what is nearer is not the ground itself


def crowd_in(world: World, robot: RobotBody, seed: int) -> Crowd | None:
    """The movers of a world around a robot at its start, None where there are none. ValueError in one line for one that cannot be there."""
    if not world.movers:
        return None
    x, y, yaw = world.start_xyyaw
    at_start = RobotSeen(x, y, yaw, 0.0, robot.half_length_m, robot.half_width_m)
    return Crowd([spec.relative_to(world.origin) for spec in world.movers], open_ground(world), at_start, seed)


def hands_in(world: World, config: SimulationConfig, robot: RobotBody, rng: np.random.Generator) -> Hands | None:
    """Who does to the robot what the script says, None where it is empty."""
    script = disturbances_of(config.disturbances)
    if not script:
        return None
    ground = open_ground(world) if any(one.kind in ("lift", "push") for one in script) else None
    return Hands(script, ground, robot, rng)


def open_ground(world: World) -> OpenGround:
    """The ground of a world that can be reached on foot from the robot's start: one level a cell, without steps and steep slopes."""
    low, high = world.extent[0, :2], world.extent[1, :2]
    columns, rows = (np.ceil((high - low) / STEP_M).astype(int) + 1).tolist()
    x, y = np.meshgrid(low[0] + STEP_M * np.arange(columns), low[1] + STEP_M * np.arange(rows))
    scene = raycasting_scene(world.vertices, world.triangles)
    first, levels = _levels(scene, np.column_stack([x.ravel(), y.ravel()]), float(world.extent[1, 2]) + 1.0)
    column, row = np.rint((np.array(world.start_xyyaw[:2]) - low) / STEP_M).astype(int)
    height = np.full((rows, columns), np.nan)
    _flood(height, first, levels, (int(row), int(column), world.start_z))
    return OpenGround(height, _clearance(scene, x, y, height), float(low[0]), float(low[1]), STEP_M)


def _levels(scene: o3d.t.geometry.RaycastingScene, xy: Array, top: float) -> tuple[NDArray[np.int64], Array]:
    """Heights with headroom, of all places one after the other, and (N + 1,) where each one's begin."""
    rays = np.hstack([xy, np.full((len(xy), 1), top), np.tile([0.0, 0.0, -1.0], (len(xy), 1))]).astype(np.float32)
    found = scene.list_intersections(o3d.core.Tensor.from_numpy(rays), nthreads=1)
    at, z = found["ray_ids"].numpy().astype(np.int64), top - found["t_hit"].numpy().astype(np.float64)
    order = np.lexsort((z, at))
    at, z = at[order], z[order]
    above = np.where(np.append(at[1:] == at[:-1], False), np.append(z[1:], np.inf), np.inf)
    kept = above > z + HEADROOM_M
    return np.searchsorted(at[kept], np.arange(len(xy) + 1)), z[kept]


@numba.njit(cache=True)
def _flood(height, first, levels, start):  # type: ignore[no-untyped-def]  # numba
    """Fill in the heights of cells that are reached from the start, four ways, over small rises."""
    rows, columns = height.shape
    queue = np.empty((rows * columns, 2), np.int64)
    height[start[0], start[1]] = start[2]
    queue[0, 0], queue[0, 1] = start[0], start[1]
    done, known = 0, 1
    while done < known:
        r, c = queue[done]
        done += 1
        for dr, dc in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            i, j = r + dr, c + dc
            if not (0 <= i < rows and 0 <= j < columns) or not np.isnan(height[i, j]):
                continue
            for k in range(first[i * columns + j], first[i * columns + j + 1]):
                if abs(levels[k] - height[r, c]) <= RISE_M:
                    height[i, j] = levels[k]
                    queue[known, 0], queue[known, 1] = i, j
                    known += 1
                    break


def _clearance(scene: o3d.t.geometry.RaycastingScene, x: Array, y: Array, height: Array) -> Array:
    """(rows, columns) distance to the nearest cell without ground, and to what stands or hangs beside."""
    is_ground = np.pad(~np.isnan(height) & ~_is_edge(height), 1)
    clear = ndimage.distance_transform_edt(is_ground, STEP_M)[1:-1, 1:-1]
    here = clear > 0.0
    for above in BESIDE_M:
        points = np.column_stack([x[here], y[here], height[here] + above]).astype(np.float32)
        apart = scene.compute_distance(o3d.core.Tensor.from_numpy(points), nthreads=1).numpy().astype(np.float64)
        clear[here] = np.minimum(clear[here], np.where(apart < GROUND_APART * above, apart, np.inf))
    return np.asarray(clear)


def _is_edge(height: Array) -> NDArray[np.bool_]:
    """(rows, columns) whether a neighbour's ground lies a step higher or lower."""
    found = np.zeros(height.shape, bool)
    for axis in (0, 1):
        jump = np.abs(np.diff(height, axis=axis)) > RISE_M
        one, other = ((slice(None),) * axis + (s,) for s in (slice(None, -1), slice(1, None)))
        found[one] |= jump
        found[other] |= jump
    return found
