"""What is put away is given again bit by bit, also where the disk takes nothing, and leaves nothing behind; a map is the same without."""

from pathlib import Path

import numpy as np
import pytest
from test_map_builder import builder, pose, wall

from octomap_server_3dnav.octree.map_builder import Beams, MapBuilder
from octomap_server_3dnav.octree.shelf import Shelf


def beams(seed: int) -> Beams:
    rng = np.random.default_rng(seed)
    return Beams(*(rng.normal(size=(n, 3)).astype(np.float32) for n in (200, 200, 0, 30)))


def assert_same(one: Beams, other: Beams) -> None:
    for name, array in vars(one).items():
        np.testing.assert_array_equal(array, getattr(other, name))


@pytest.mark.parametrize("where", ["disk", "memory", "no such folder"])
def test_what_is_put_away_is_given_again(where: str, tmp_path: Path) -> None:
    shelf = Shelf({"disk": tmp_path, "memory": None, "no such folder": tmp_path / "gone"}[where])
    given = [shelf.put(beams(seed)) for seed in range(5)]
    for seed in (3, 0, 4, 3):
        assert_same(given[seed](), beams(seed))
    assert not list(tmp_path.iterdir())


def test_what_the_disk_does_not_take_stays_in_memory(tmp_path: Path, files_of_at_most) -> None:
    shelf = Shelf(tmp_path)
    first = shelf.put(beams(1))
    with files_of_at_most(8000):
        second = shelf.put(beams(2))
    third = shelf.put(beams(3))
    for seed, given in ((1, first), (2, second), (3, third)):
        assert_same(given(), beams(seed))


def test_value_takes_the_place_of_another_where_it_fits(tmp_path: Path) -> None:
    shelf = Shelf(tmp_path)
    first, beside = shelf.put(beams(1)), shelf.put(beams(2))
    again = shelf.put(beams(3), instead_of=first)
    assert again.begin == first.begin
    larger = shelf.put(Beams(*(np.tile(array, (3, 1)) for array in vars(beams(4)).values())), instead_of=again)
    assert larger.begin not in (again.begin, beside.begin)
    assert_same(beside(), beams(2))
    assert len(larger().points) == 600


def test_map_is_the_same_with_beams_on_a_shelf_and_in_memory(tmp_path: Path) -> None:
    maps = builder(), builder()
    shelved = MapBuilder(maps[1].config, maps[1].tree.sensor_model, maps[1].robot, Shelf(tmp_path))
    for built in (maps[0], shelved):
        poses = [pose(), pose(0.3), pose(0.6)]
        for k in range(3):
            built.add_sweep(wall(), k, poses[: k + 1])
        built.add_sweep(wall(), 3, [pose(), pose(0.35), pose(0.7), pose(0.9)])  # moves two of them
    assert maps[0].tree.to_full() == shelved.tree.to_full()
