"""The map's files: what is asked for is on disk when somebody waits, and whoever asks hears the truth."""

import time
from pathlib import Path

import numpy as np
import pytest

from octomap_server_3dnav.octree.octree import OctreeMap
from ros_adapters import map_files
from ros_adapters.map_files import MapFiles


def tree(half_m: float) -> OctreeMap:
    made = OctreeMap(0.1)
    middles = made.unknown_on_plane((0.0, 0.0, 0.0), half_m)
    made.insert_sweep(middles, middles)
    return made


def test_without_a_folder_or_a_map_nothing_is_said_to_be_saved(tmp_path: Path) -> None:
    assert MapFiles(None).wait() == (False, "nothing is saved: ~out names no folder")
    assert MapFiles(tmp_path).wait() == (False, "nothing is saved: no sweep is in the map yet")
    assert not list(tmp_path.iterdir())


def test_map_without_a_terrain_is_its_octree_and_is_named(tmp_path: Path) -> None:
    files = MapFiles(tmp_path)
    files.save(tree(1.0), None, None)
    done, said = files.wait()
    assert done and said == f"map.bt, map.ot, occupied.npz saved in {tmp_path}"
    assert OctreeMap.read(tmp_path / "map.ot").to_full() == tree(1.0).to_full()


def test_map_that_begins_anew_while_files_rest_is_written_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_files, "_REST_S", 0.2)
    files = MapFiles(tmp_path)
    files.save(tree(1.0), None, None)
    assert files.wait()[0]
    files.save(tree(2.0), None, None)
    time.sleep(0.05)  # the thread knows of it, and rests
    files.forget()
    assert not files.wait()[0]
    time.sleep(0.5)  # the rest is over, and nothing is to be written
    files.save(tree(0.5), None, None)
    assert files.wait(60.0)[0]
    assert len(np.load(tmp_path / "occupied.npz")["sizes"]) == len(tree(0.5).occupied_voxels()[1])


def test_folder_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    folder = tmp_path / "gone"
    files = MapFiles(folder)
    files.save(tree(1.0), None, None)
    done, said = files.wait()
    assert not done and "map not saved" in said and "\n" not in said


class _Unwritable(OctreeMap):
    """An octree whose file cannot be made."""

    def __init__(self, problem: Exception) -> None:
        super().__init__(0.1)
        self._problem = problem

    def write_bt(self, _path: Path) -> None:
        raise self._problem


@pytest.mark.parametrize(
    ("problem", "told"),
    [(MemoryError(), "no memory is left"), (RuntimeError("the tree is torn"), "RuntimeError: the tree is torn")],
    ids=["memory", "anything else"],
)
def test_map_that_cannot_be_made_is_told_and_the_next_one_is_written(tmp_path: Path, problem: Exception, told: str) -> None:
    heard: list[str] = []
    files = MapFiles(tmp_path, heard.append)
    files.save(_Unwritable(problem), None, None)
    done, said = files.wait(10.0)
    assert not done and said == f"map not saved: {tmp_path}: {told}" and heard == [f"{tmp_path}: {told}"]
    files.save(tree(1.0), None, None)
    assert files.wait(10.0) == (True, f"map.bt, map.ot, occupied.npz saved in {tmp_path}") and heard[1:] == [""]
