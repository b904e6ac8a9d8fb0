"""The hand-made map's scores, found on paper: one missing square metre, one raised plate, one shifted wall."""

import math

import pytest
from hand_made import START, WORLD, hand_made_map

from exploration_evaluation import ReachableGround, coverage, map_error, reachable_ground

# The centre keeps 0.6 m from the walls: 48 x 28 cells. The body's circle of 0.335 m reaches 3 cells farther, and 8 at each corner.
CELLS = 48 * 28 + 2 * 3 * (48 + 28) + 4 * 8
# Of 10 x 10 cells without a voxel the outermost have a neighbour at 0.1 m, within the tolerance of 0.12 m; 8 x 8 have none.
UNCOVERED = 8 * 8


@pytest.fixture(scope="module")
def ground() -> ReachableGround:
    return reachable_ground(*WORLD, START)


def test_world_has_the_cells_counted_on_paper(ground):
    assert len(ground.covered_points) == CELLS == 1832


def test_hand_made_map_has_the_voxels_counted_on_paper():
    made = hand_made_map()
    assert (len(made.floor), len(made.plate), len(made.walls), len(made.shifted_wall)) == (2200, 100, 3200, 800)


def test_hole_and_raised_plate_are_what_the_coverage_lacks(ground):
    share = coverage(ground.covered_points, hand_made_map().voxels)
    assert share == pytest.approx(1 - 2 * UNCOVERED / CELLS, abs=1e-12)


def test_raised_plate_and_shifted_wall_are_what_the_accuracy_lacks_and_the_hole_is_not():
    error = map_error(hand_made_map().voxels, *WORLD)
    assert error.rms_m == pytest.approx(math.sqrt((100 * 0.3**2 + 800 * 0.05**2) / 6300), rel=1e-6)
    # The worst 315 voxels are the 100 of the plate and 215 of the wall's 800.
    assert error.p95_m == pytest.approx(0.05, rel=1e-5)
