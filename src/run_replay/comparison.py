"""Two runs in one frame: their clouds and paths, the second brought to the first by what is true of both, where that is known.

Of two clouds drawn in one place one would hide the other. So where both have points, each shows its own in every other cell of space: they
agree where a chessboard is seen, and differ where one colour is.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from exploration_evaluation import read_cloud, read_json
from rigid_geometry import inverse, transform_points
from rigid_geometry.transforms import Transform
from run_replay.recorded_run import DrivenPath, driven_path

Floats = NDArray[np.float64]

_CELL_M = 0.15  # of the chessboard


@dataclass(frozen=True, eq=False)
class Shown:
    """A run's (N, 3) cloud, which of its points to draw, and its way as (P,) stamps and (P, 4, 4) poses; in the map frame of the first."""

    points: Floats
    drawn: NDArray[np.bool_]
    path_stamps_s: Floats
    path_poses: Floats


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two runs in the map frame of the first; `why_not_aligned` says why the second was left as it is, empty when it was aligned."""

    first: Shown
    second: Shown
    why_not_aligned: str

    @property
    def middle(self) -> Floats:
        """(3,) middle of both clouds."""
        return np.asarray(np.concatenate([self.first.points, self.second.points]).mean(axis=0))


def compare_runs(first: Path, second: Path) -> Comparison:
    """The maps of two run folders. ValueError when a cloud or trajectory cannot be read."""
    paths = driven_path(first), driven_path(second)
    T_first_second, why_not = _alignment((first, second), paths)
    clouds = read_cloud(first / "cloud.ply"), np.asarray(transform_points(T_first_second, read_cloud(second / "cloud.ply")))
    drawn = chessboard(*clouds)
    ways = paths[0].poses, T_first_second @ paths[1].poses
    shown = [Shown(clouds[k], drawn[k], paths[k].stamps_s, ways[k]) for k in (0, 1)]
    return Comparison(shown[0], shown[1], why_not)


def chessboard(first: Floats, second: Floats, cell_m: float = _CELL_M) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which of (N, 3) and of (M, 3) points to draw, so that neither cloud hides the other."""
    cells, place = np.unique(np.floor(np.concatenate([first, second]) / cell_m).astype(np.int64), axis=0, return_inverse=True)
    in_first, in_second = place[: len(first)], place[len(first) :]
    shared = np.zeros(len(cells), dtype=np.bool_)
    shared[np.intersect1d(in_first, in_second)] = True
    even = cells.sum(axis=1) % 2 == 0
    return (~shared | even)[in_first], (~shared | ~even)[in_second]


def _alignment(folders: tuple[Path, Path], paths: tuple[DrivenPath, DrivenPath]) -> tuple[Transform, str]:
    """T_mapA_mapB through the world; the identity, for lack of a better one, and the reason where it is not known."""
    for folder, path in zip(folders, paths, strict=True):
        if path.T_world_map is None:
            return np.eye(4), f"{folder.name} has no truth: {path.why_not_true}"
    try:
        worlds = [read_json(folder / "run.json").get("world") for folder in folders]
    except ValueError as error:
        return np.eye(4), f"the world is not known: {error}"
    if worlds[0] != worlds[1] or worlds[0] is None:
        return np.eye(4), f"their worlds are {worlds[0]} and {worlds[1]}"
    assert paths[0].T_world_map is not None and paths[1].T_world_map is not None
    return np.asarray(inverse(paths[0].T_world_map) @ paths[1].T_world_map), ""
