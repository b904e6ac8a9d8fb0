"""The terrain node's files: written beside the run by one thread, so that the robot does not wait for the disk."""

import math
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.octree.octree import OctreeMap
from octomap_server_3dnav.terrain.classify import Terrain
from whole_files import refusal, written_whole

_REST_S = 5.0  # wall time between two writings: they take half a second of a core that the robot's next metres need


class MapFiles:
    """map.bt, map.ot, occupied.npz, terrain.npz and path.npz of the newest map; older requests that were not begun are skipped.

    What is on disk is at most a few seconds old; `wait` and `close` write what is newest at once.
    """

    def __init__(self, folder: Path | None, tell: Callable[[str], None] = lambda _: None) -> None:
        """`tell` hears after each writing why the map is not on disk; empty when it is."""
        self._folder, self._tell = folder, tell
        self._changed = threading.Condition()
        self._request: tuple[OctreeMap, Terrain | None, NDArray[np.float64] | None] | None = None
        self._is_empty = True
        self._written: list[str] = []
        self._busy = False
        self._waiting = 0
        self._error = ""
        if folder:
            threading.Thread(target=self._write_forever, daemon=True).start()

    def save(self, tree: OctreeMap, terrain: Terrain | None, path: NDArray[np.float64] | None) -> None:
        """Asks for the files to be written, without a terrain those of the octree; `tree` excludes its readers and writers itself."""
        if self._folder:
            with self._changed:
                self._request, self._is_empty = (tree, terrain, path), False
                self._changed.notify_all()

    def forget(self) -> None:
        """The map begins anew; what is on disk stays there until it is written again."""
        with self._changed:
            self._request, self._is_empty = None, True

    def wait(self, timeout_s: float = 20.0) -> tuple[bool, str]:
        """Until everything asked for is on disk: whether there is a map on disk that is the newest, and where, or why not."""
        if not self._folder:
            return False, "nothing is saved: ~out names no folder"
        with self._changed:
            if self._is_empty:
                return False, "nothing is saved: no sweep is in the map yet"
            self._waiting += 1
            self._changed.notify_all()
            done = self._changed.wait_for(lambda: self._request is None and not self._busy, timeout_s)
            self._waiting -= 1
            problem = f"map not saved: {self._error}" if self._error else ("" if done else "still writing")
            return not problem, problem or f"{', '.join(self._written)} saved in {self._folder}"

    def close(self) -> None:
        self.wait()

    def _write_forever(self) -> None:
        written_s = -math.inf
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._request is not None)
                self._changed.wait_for(lambda: self._waiting, max(0.0, written_s + _REST_S - time.monotonic()))
                if self._request is None:  # the map has begun anew meanwhile
                    continue
                tree, terrain, path = self._request
                self._request, self._busy = None, True
            error, self._written = "", []
            try:
                self._write(tree, terrain, path)
            except Exception as problem:  # this thread is the only one that writes: the next map may go well
                error = _why_not(problem, self._folder or Path())
            self._tell(error)
            with self._changed:
                self._busy, self._error, written_s = False, error, time.monotonic()
                self._changed.notify_all()

    def _write(self, tree: OctreeMap, terrain: Terrain | None, path: NDArray[np.float64] | None) -> None:
        assert self._folder is not None
        tree.write_bt(self._folder / "map.bt")
        tree.write_ot(self._folder / "map.ot")
        self._written += ["map.bt", "map.ot"]
        centers, sizes = tree.occupied_voxels()
        self._save_arrays("occupied.npz", centers=centers, sizes=sizes)
        if terrain is None:
            return
        x, y, z = terrain.centers().T
        self._save_arrays("terrain.npz", x=x, y=y, z=z, label=terrain.label)
        self._save_arrays("path.npz", points=np.zeros((0, 3)) if path is None else path)

    def _save_arrays(self, name: str, **arrays: NDArray[np.generic]) -> None:
        assert self._folder is not None
        with written_whole(self._folder / name) as unfinished, unfinished.open("wb") as file:
            np.savez(file, allow_pickle=False, **arrays)  # type: ignore[arg-type]
        self._written.append(name)


def _why_not(problem: Exception, folder: Path) -> str:
    """Why no files are in a folder, in one line."""
    if isinstance(problem, OSError):
        return refusal(problem, folder)
    kind = "no memory is left" if isinstance(problem, MemoryError) else type(problem).__name__
    return ": ".join(filter(None, (str(folder), kind, " ".join(str(problem).split()))))
