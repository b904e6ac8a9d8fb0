"""Grids to messages and back: terrain grids, checked before they are believed, and occupancy grids."""

import numpy as np
from explore_3dnav.msg import TerrainGrid as TerrainGridMessage
from nav_msgs.msg import MapMetaData, OccupancyGrid
from numpy.typing import NDArray

from octomap_server_3dnav.navigation.local_grid import TerrainGrid
from rigid_geometry import FARTHEST_M, transform_from_rpy
from ros_adapters.conversions import Singles, header, pose_message
from ros_adapters.frames import frames


def _grid_info(shape: tuple[int, ...], origin_xy: tuple[float, float], resolution: float) -> MapMetaData:
    info = MapMetaData(resolution=resolution, height=shape[0], width=shape[1])
    info.origin = pose_message(transform_from_rpy((*origin_xy, 0.0)))
    return info


def terrain_grid_message(
    stamp_s: float,
    frame: str,
    cost: NDArray[np.int8],
    height: Singles,
    origin_xy: tuple[float, float],
    resolution: float,
    distance: Singles | None = None,
) -> TerrainGridMessage:
    """(ny, nx) costs, heights and distances to what is not traversable, where those are known; cell (0, 0) starts at `origin_xy`."""
    distance = np.full(cost.shape, np.nan, np.float32) if distance is None else distance
    layers = (values.ravel().tolist() for values in (cost, height, distance))
    return TerrainGridMessage(header(stamp_s, frame), _grid_info(cost.shape, origin_xy, resolution), *layers)


def message_of_grid(stamp_s: float, frame: str, grid: TerrainGrid) -> TerrainGridMessage:
    """The same of a grid."""
    return terrain_grid_message(stamp_s, frame, grid.cost, grid.height, grid.origin_xy, grid.resolution, grid.distance)


def terrain_grid(message: TerrainGridMessage) -> TerrainGrid:
    """The grid of a message in the frame map; ValueError for another, or when the sizes do not agree."""
    if message.header.frame_id != frames().map:
        raise ValueError(f"terrain grid in frame {message.header.frame_id!r}, expected 'map'")
    shape = (message.info.height, message.info.width)
    layers = message.cost, message.height, message.distance
    if any(len(layer) != shape[0] * shape[1] for layer in layers) or not message.info.resolution > 0:
        raise ValueError(
            f"terrain grid of {shape} cells with {', '.join(str(len(layer)) for layer in layers)} costs, heights and distances, "
            f"resolution {message.info.resolution}"
        )
    cost, height, distance = (np.asarray(layer).reshape(shape) for layer in layers)
    origin = message.info.origin.position
    if not (abs(origin.x) < FARTHEST_M and abs(origin.y) < FARTHEST_M and 1e-3 < message.info.resolution < 10.0):
        raise ValueError(f"terrain grid at {origin.x:g} {origin.y:g} m with cells of {message.info.resolution:g} m")
    return TerrainGrid(
        cost.astype(np.int8), height.astype(np.float32), distance.astype(np.float32), (origin.x, origin.y), float(message.info.resolution)
    )


def occupancy_grid_message(
    stamp_s: float, frame: str, cost: NDArray[np.int8], origin_xy: tuple[float, float], resolution: float
) -> OccupancyGrid:
    """(ny, nx) occupancies of -1 or 0..100; cell (0, 0) starts at `origin_xy`."""
    grid = OccupancyGrid(header=header(stamp_s, frame), info=_grid_info(cost.shape, origin_xy, resolution))
    grid.data = cost.ravel().tolist()
    return grid
