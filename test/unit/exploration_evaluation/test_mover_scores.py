"""Ghosts: what movers left in the map; and whose a touch was."""

import numpy as np
import pytest
import trimesh

from exploration_evaluation import read_contacts
from exploration_evaluation.mover_scores import ghosts_m2, read_mover_places

FLOOR = trimesh.creation.box((10.0, 10.0, 0.2))
FLOOR.apply_translation((0.0, 0.0, -0.1))
MESH = (FLOOR.vertices, FLOOR.faces)
CELL = 0.08


def column(x, y):
    """A mapped person: voxels from the floor to 1.7 m."""
    return np.array([[x, y, z] for z in np.arange(CELL / 2, 1.7, CELL)])


def test_person_in_the_map_is_a_ghost_of_the_ground_under_it_and_the_floor_is_none():
    floor = np.array([[x, y, -CELL / 2] for x in np.arange(-2, 2, CELL) for y in np.arange(-2, 2, CELL)])
    voxels = np.concatenate([floor, column(1.0, 1.0), column(1.0 + CELL, 1.0)])
    assert ghosts_m2(voxels, MESH, np.array([[1.0, 1.0]]), CELL) == pytest.approx(2 * CELL**2)


def test_what_lies_far_from_every_mover_or_on_a_surface_is_no_ghost():
    assert ghosts_m2(column(1.0, 1.0), MESH, np.array([[3.0, 1.0]]), CELL) == 0.0
    assert ghosts_m2(np.array([[1.0, 1.0, 0.1]]), MESH, np.array([[1.0, 1.0]]), CELL) == 0.0
    assert ghosts_m2(np.empty((0, 3)), MESH, np.array([[1.0, 1.0]]), CELL) == 0.0


def test_places_of_movers_are_read_without_half_a_last_line(tmp_path):
    (tmp_path / "movers.csv").write_text("stamp,name,kind,x,y,z,yaw\n1.0,Ann,person,1,2,0,0.5\n1.2,Ann,person,1.1,2,0,0.5\n1.4,Ann,per")
    names, places = read_mover_places(tmp_path / "movers.csv")
    assert names == ("Ann", "Ann") and places.tolist() == [[1.0, 2.0], [1.1, 2.0]]


def test_touch_by_a_mover_counts_only_above_the_speed_at_which_a_robot_stands(tmp_path):
    rows = "1.0,deck,0.04,5,Ann\n9.0,deck,0.06,5,Ann\n19.0,deck,0.01,5,\n"
    (tmp_path / "contacts.csv").write_text("stamp,link,speed_mps,force_n,other\n" + rows)
    assert [e.top_speed_mps for e in read_contacts(tmp_path / "contacts.csv")] == [0.06, 0.01]
