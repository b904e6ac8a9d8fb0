"""What the costmap hands to the collision monitor: the newest marks that the terrain does not explain."""

import numpy as np
import pytest
from costs import cost_at

from local_terrain_costmap import CostmapConfig, LocalCostmap
from robot_body import RobotBody

CELL = 0.08
NOTHING = np.empty((0, 3))


def costmap(lethal=()):
    """Level ground 8 m wide around the origin, the top of its voxels at 4 cm, with lethal cells at some places."""
    found = LocalCostmap(CostmapConfig(), RobotBody())
    cost, height = np.zeros((100, 100), np.int8), np.full((100, 100), 0.04)
    for x, y in lethal:
        cost[int((y + 4.0) / CELL), int((x + 4.0) / CELL)] = 100
    found.set_terrain(cost, (-4.0, -4.0), CELL, height)
    return found


def post(x, y, z=0.8):
    """Three hits beside each other."""
    return np.array([[x, y, z], [x + 0.01, y, z], [x + 0.02, y, z]])


def add(found, stamp_s, hits):
    found.add_line(stamp_s, hits, NOTHING, np.array([0.0, 0.0, 0.9]))


def test_what_a_line_meets_over_known_ground_is_a_stranger_at_once():
    found = costmap()
    add(found, 1.0, post(1.02, 0.5))
    assert found.strangers(0.3) == pytest.approx(np.array([[1.0, 0.52]]), abs=0.05)


def test_what_the_map_knows_is_no_stranger():
    found = costmap(lethal=[(1.02, 0.5)])
    add(found, 1.0, post(1.02, 0.5))
    assert not len(found.strangers(0.3))


def test_stranger_is_forgotten_after_its_time_though_the_costmap_still_keeps_it():
    found = costmap()
    add(found, 1.0, post(1.02, 0.5))
    add(found, 1.25, post(-1.0, -1.0))
    assert len(found.strangers(0.3)) == 2
    add(found, 1.35, post(-1.0, -1.0))
    assert len(found.strangers(0.3)) == 1 and cost_at(found.master(), 1.02, 0.52) == 254


def test_person_whom_the_level_scan_meets_is_a_stranger_and_a_known_wall_is_none():
    found = costmap(lethal=[(1.5, 0.0)])
    hits = np.concatenate([post(1.5, 0.0), post(0.99, 0.5)])
    found.add_scan(hits[:, :2], np.empty((0, 2)), (0.0, 0.0), hits[:, 2])
    assert found.strangers(0.3) == pytest.approx(np.array([[1.0, 0.52]]), abs=0.05)


def test_what_has_stood_at_its_place_for_long_is_left_to_the_follower_and_a_stranger_again_when_it_moves():
    found = costmap()
    for stamp_s in np.arange(1.0, 7.0, 0.5):
        add(found, stamp_s, post(1.02, 0.5))
    assert len(found.strangers(1.3)) == 1 and not len(found.strangers(1.3, 5.0))
    assert cost_at(found.master(), 1.02, 0.52) == 254
    add(found, 7.0, post(0.7, 0.5))
    assert found.strangers(1.3, 5.0) == pytest.approx(np.array([[0.68, 0.52]]), abs=0.05)


@pytest.mark.parametrize(("unmarked_s", "stands"), [(0.2, True), (0.5, False)])
def test_mark_that_is_taken_back_and_met_again_by_one_of_the_next_lines_has_stood_there_before(unmarked_s, stands):
    found, stamp_s = costmap(), 1.0
    for _ in range(6):
        add(found, stamp_s, post(1.02, 0.5, 0.82))
        add(found, stamp_s + 1.2, post(3.06, 1.5, 0.66))  # through its place
        assert cost_at(found.master(), 1.02, 0.52) < 254
        stamp_s += 1.2 + unmarked_s
    add(found, stamp_s, post(1.02, 0.5, 0.82))
    assert len(found.strangers(1.0)) == 1 and len(found.strangers(1.0, 5.0)) == (not stands)


@pytest.mark.parametrize("period_s", [4.0, 6.0])
def test_somebody_who_walks_where_another_has_walked_before_does_not_stand_there(period_s):
    found = costmap()
    for stamp_s in np.arange(1.0, 40.0, 0.1):
        walked_m, back = 1.4 * (stamp_s % period_s), np.column_stack([np.full(401, 3.0), np.linspace(-4.0, 4.0, 401)])
        walker = np.array([1.5, walked_m - 2.0])
        is_hidden = np.abs(back[:, 1] * walker[0] / 3.0 - walker[1]) < 0.2
        front = np.column_stack([np.full(401, walker[0]), back[:, 1] * walker[0] / 3.0])
        add(found, stamp_s, np.column_stack([np.where(is_hidden[:, None], front, back), np.full(401, 0.8)]))
        if is_hidden.any():
            assert len(found.strangers(0.05, 5.0)) == len(found.strangers(0.05)) > 0


def test_what_stands_in_a_window_that_moves_has_stood_there_before():
    found = costmap()
    for stamp_s in np.arange(1.0, 7.0, 0.5):
        found.recenter(0.3 * stamp_s, 0.0)
        add(found, stamp_s, post(1.02, 0.5))
    assert len(found.strangers(1.3)) == 1 and not len(found.strangers(1.3, 5.0))
