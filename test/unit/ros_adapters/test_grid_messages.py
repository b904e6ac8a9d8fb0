"""Grids to messages and back, without a master: round trips, and what is refused."""

import numpy as np
import pytest

from octomap_server_3dnav.navigation.local_grid import TerrainGrid
from ros_adapters.grid_messages import message_of_grid, terrain_grid, terrain_grid_message


def grid_of(cost: list[list[int]]) -> TerrainGrid:
    values = np.array(cost, dtype=np.int8)
    height = np.where(values == 0, np.arange(values.size).reshape(values.shape) / 10, np.nan).astype(np.float32)
    distance = np.where(values == 0, np.inf, 0.0).astype(np.float32)
    return TerrainGrid(values, height, distance, (-1.0, 2.0), 0.5)


def test_terrain_grid_comes_back_row_by_row() -> None:
    grid = grid_of([[0, 100, -1], [0, 0, 100]])
    got = terrain_grid(message_of_grid(1.0, "map", grid))
    for name in ("cost", "height", "distance"):
        np.testing.assert_array_equal(getattr(got, name), getattr(grid, name))
    assert (got.origin_xy, got.resolution) == ((-1.0, 2.0), 0.5)


@pytest.mark.parametrize("what", ["cost", "height", "distance", "resolution", "frame"])
def test_terrain_grid_whose_sizes_do_not_agree_or_whose_frame_is_another_is_refused(what: str) -> None:
    message = message_of_grid(1.0, "odom" if what == "frame" else "map", grid_of([[0, 100, -1]]))
    if what == "resolution":
        message.info.resolution = 0.0
    elif what != "frame":
        setattr(message, what, [1, 2])
    with pytest.raises(ValueError, match="terrain grid"):
        terrain_grid(message)


@pytest.mark.parametrize("x, resolution", [(1e30, 0.1), (float("nan"), 0.1), (0.0, 1e30), (0.0, 1e-30)])
def test_terrain_grid_that_is_nowhere_is_refused(x, resolution):
    flat = np.zeros((2, 2), np.float32)
    message = terrain_grid_message(1.0, "map", flat.astype(np.int8), flat, (0.0, 0.0), 0.1, flat)
    message.info.origin.position.x, message.info.resolution = x, resolution
    with pytest.raises(ValueError, match="terrain grid"):
        terrain_grid(message)
