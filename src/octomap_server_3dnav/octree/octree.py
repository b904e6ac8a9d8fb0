"""The occupancy octree of the map: sweeps go in, column runs, voxels and octomap's own bytes come out (thesis 4.4, 5.5).

The first box of the terrain stage: `octomap_server_3dnav_node` keeps one and hands `column_runs()` to the terrain analysis. The tree
itself is octomap's, in `_octree_binding`.
"""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import _octree_binding
import numpy as np
from _octree_binding import SweepVoxels as SweepVoxels  # given out by trace_sweep, taken by insert and redraw
from numpy.typing import ArrayLike, NDArray

from octomap_server_3dnav.octree.column_runs import KEY_OFFSET, ColumnRuns, VoxelState
from octomap_server_3dnav.octree.octree_files import file_header, parsed_file
from octomap_server_3dnav.octree.sensor_model import SensorModel as SensorModel  # the map is made with one
from whole_files import write_whole

_UP = (0.0, 0.0, 1.0)

Corner = tuple[int, int, int]
Bounds = tuple[ArrayLike, ArrayLike]


@dataclass(frozen=True)
class InsertionReport:
    """What one sweep did: voxels seen free and occupied, and points dropped because they or their origin were not finite."""

    free: int
    occupied: int
    dropped: int


class OctreeMap:
    """An octomap OcTree in the map frame; voxel index i spans [i * resolution, (i + 1) * resolution) metres.

    Boxes are (lo, hi) corners of three metres each, -inf and inf allowed, and stand for all voxels that they overlap. Calls
    release the GIL and exclude each other, so threads may share a map. The same calls give the same tree, bit by bit.
    """

    def __init__(self, resolution: float, sensor_model: SensorModel | None = None) -> None:
        """An empty map of `resolution` metres; ValueError for a resolution or sensor model that cannot be."""
        if not (math.isfinite(resolution) and resolution > 0):
            raise ValueError(f"resolution must be positive metres, not {resolution!r}")
        self._model = sensor_model or SensorModel()
        if problems := self._model.validate():
            raise ValueError("; ".join(problems))
        self._resolution = float(resolution)
        m = self._model
        self._tree = _octree_binding.Tree(self._resolution, m.hit, m.miss, m.through, m.min, m.min_through, m.max)

    @property
    def resolution(self) -> float:
        """Edge of a voxel in metres."""
        return self._resolution

    @property
    def sensor_model(self) -> SensorModel:
        """The probabilities with which sweeps are inserted."""
        return self._model

    @property
    def node_count(self) -> int:
        """Nodes of the tree, inner ones and leaves."""
        return int(self._tree.node_count())

    @property
    def leaf_count(self) -> int:
        """Leaves of the tree; a pruned one stands for 8 to the n voxels. Walks the tree."""
        return int(self._tree.leaf_count())

    @property
    def memory_bytes(self) -> int:
        """What octomap reckons that the tree takes, which it walks, and 64 KiB for every 64 cubed voxels that are not all alike."""
        return int(self._tree.memory_bytes())

    # -- changing it

    def insert_sweep(
        self, points_map: NDArray[np.float32], origins_map: NDArray[np.float32], max_range_m: float = math.inf, bounds: Bounds | None = None
    ) -> InsertionReport:
        """Count a sweep as one observation of every voxel it saw: occupied where a beam ended, else free where one passed.

        `points_map`, `origins_map` (N, 3) float32 metres: where each beam ended and started. One ray is cast for each end
        voxel, that of its first point. Points beyond `max_range_m` free their ray up to it; with `bounds` (lo, hi) nothing
        outside that box changes and rays are cut to it (the cropping of thesis 5.5). A voxel with a hit is occupied whatever
        passes through it, and the layer of the surface just before a hit is not freed (`SensorModel.grazing_m`): a flat ray
        crosses the upper part of several ground voxels that the ground lies in. ValueError for wrong shapes.
        """
        return self.insert(self.trace_sweep(points_map, origins_map, max_range_m, bounds))

    def trace_sweep(
        self,
        points_map: NDArray[np.float32],
        origins_map: NDArray[np.float32],
        max_range_m: float = math.inf,
        bounds: Bounds | None = None,
        met: int | None = None,
    ) -> SweepVoxels:
        """What `insert_sweep` would insert. Neither asks the map nor changes it. Only the first `met` beams met something, or all of them:
        the others free their way up to where they end."""
        points, origins = _rows_of_three("points_map", points_map), _rows_of_three("origins_map", origins_map)
        if points.shape != origins.shape:
            raise ValueError(f"points_map and origins_map must have one row a beam each, not {points.shape} and {origins.shape}")
        if not max_range_m > 0:
            raise ValueError(f"max_range_m must be positive, not {max_range_m!r}")
        lo, hi = self._box(*(bounds or (None, None)))
        return _octree_binding.trace_sweep(
            points, origins, len(points) if met is None else met, self._resolution, max_range_m, self._model.grazing_m, lo, hi
        )

    def insert(self, voxels: SweepVoxels) -> InsertionReport:
        """Count one observation of every voxel of a sweep or plane that was traced for a map like this one."""
        self._tree.apply(voxels)
        return InsertionReport(voxels.free, voxels.occupied, voxels.dropped)

    def unknown_on_plane(self, center_xyz: ArrayLike, half_size: float, up: ArrayLike = _UP) -> NDArray[np.float32]:
        """(N, 3) middles of the unknown voxels of a plane over a square, for the blind spot under the robot (thesis 5.5, Alg. 3 line 2).

        `center_xyz` (3,) and `half_size` in metres, along the axes of map; `up` (3,) its normal, upwards. Inserted as beams that end where
        they begin, each is one hit: what beams have seen stays as it is, and later beams overrule the guess.
        """
        center, normal = _corner("center_xyz", center_xyz), _corner("up", up)
        if not (np.isfinite(center).all() and half_size > 0 and math.isfinite(half_size)):
            raise ValueError(f"center_xyz must be finite and half_size positive, not {center_xyz!r}, {half_size!r}")
        if not (np.isfinite(normal).all() and normal[2] > 0):
            raise ValueError(f"up must be finite and point upwards, not {up!r}")
        reach = np.array([half_size, half_size, 0.0])
        first, last = self._box(center - reach, center + reach)
        columns = np.indices((last[0] - first[0] + 1, last[1] - first[1] + 1)).reshape(2, -1).T + first[:2]
        off = (columns + 0.5) * self._resolution - center[:2]
        layer = np.floor((center[2] - off @ normal[:2] / normal[2]) / self._resolution + 1e-6)
        points = ((np.column_stack([columns, layer]) + 0.5) * self._resolution).astype(np.float32)
        return np.asarray(points[self.states_at(points) == VoxelState.UNKNOWN])

    def redraw(self, changed: Sequence[SweepVoxels], inserted: Sequence[SweepVoxels]) -> None:
        """Make the map what inserting `inserted`, in this order, into an empty one gives, bit by bit.

        `changed` is what was inserted and is not in `inserted` any more, and what is in it now and was not: only blocks of 8
        cubed voxels that these touch are made anew. All else has to be in the map as `inserted` has it.
        """
        self._tree.redraw(changed, inserted)

    def trace_clearing(self, lo: ArrayLike, hi: ArrayLike) -> list[SweepVoxels]:
        """Sweeps that see all known voxels in the box free, as many as make the surest free; unknown ones stay unknown.

        Inserted, they do what octomap_server's `~clear_bbx` does. ValueError for no box, or a miss of 0.5.
        """
        model = self._model
        if model.miss == 0.5:
            raise ValueError("sensor_model/miss is 0.5: nothing is ever seen free, so nothing can be cleared")
        low, high, miss = (math.log(p / (1.0 - p)) for p in (model.min, model.max, model.miss))
        return [self._tree.known_free(*self._box(lo, hi))] * math.ceil((high - low) / -miss)

    # -- asking it

    def states_at(self, points: ArrayLike) -> NDArray[np.uint8]:
        """(N,) VoxelState values at (N, 3) points in metres; unknown where a point is not finite or outside the tree."""
        rows = np.asarray(points, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != 3:
            raise ValueError(f"points must be (N, 3), not {rows.shape}")
        indices = np.floor(rows * (1.0 / self._resolution))
        inside = ((indices >= -KEY_OFFSET) & (indices < KEY_OFFSET)).all(axis=1)
        states = np.zeros(len(rows), dtype=np.uint8)
        states[inside] = self._tree.states(np.ascontiguousarray(indices[inside].astype(np.int32)))
        return states

    def column_runs(self, lo: ArrayLike | None = None, hi: ArrayLike | None = None) -> ColumnRuns:
        """The known voxels, of the box if there is one, as sorted vertical runs, from bits kept beside the tree.

        The block of columns is the smallest that holds them, so it may be smaller than the box; nx = ny = 0 if there are none.
        ValueError for a block of more than 2^28 columns.
        """
        origin, nx, ny, start, z_lo, z_hi, occupied = self._tree.column_runs(*self._box(lo, hi))
        return ColumnRuns(self._resolution, origin, nx, ny, start, z_lo, z_hi, occupied.view(np.bool_))

    def occupied_voxels(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Centres (N, 3) and edges (N,) in metres of the fewest octree cubes that hold all occupied voxels, in the octree's order."""
        return self._voxels(occupied=True)

    def free_voxels(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The same of the free ones."""
        return self._voxels(occupied=False)

    def _voxels(self, *, occupied: bool) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        leaves = self._tree.leaves(occupied).reshape(-1, 4)
        centers = (leaves[:, :3] + leaves[:, 3:] / 2) * self._resolution
        return centers.astype(np.float32), (leaves[:, 3] * self._resolution).astype(np.float32)

    # -- octomap's formats

    def to_binary(self, lo: ArrayLike | None = None, hi: ArrayLike | None = None) -> bytes:
        """The data of an octomap_msgs/Octomap with binary = true: free and occupied of the maximum likelihood, pruned.

        With `lo`, `hi` (3,) in metres only what lies in that box.
        """
        return bytes(self._tree.to_binary(*self._box(lo, hi)))

    def to_full(self) -> bytes:
        """The data of an octomap_msgs/Octomap with binary = false: every node's log-odds."""
        return bytes(self._tree.to_full())

    @classmethod
    def from_binary(cls, data: bytes, resolution: float, sensor_model: SensorModel | None = None) -> "OctreeMap":
        """The map of `to_binary` bytes, values at the clamping thresholds; ValueError where they are no octree."""
        new = cls(resolution, sensor_model)
        new._tree.read_binary(data)
        return new

    @classmethod
    def from_full(cls, data: bytes, resolution: float, sensor_model: SensorModel | None = None) -> "OctreeMap":
        """The map of `to_full` bytes; ValueError where they are no octree."""
        new = cls(resolution, sensor_model)
        new._tree.read_full(data)
        return new

    def bt_bytes(self) -> bytes:
        """octomap's .bt file: free and occupied only, small."""
        data = self.to_binary()
        return file_header(".bt", _octree_binding.binary_nodes(data), self._resolution) + data

    def ot_bytes(self) -> bytes:
        """octomap's .ot file, with every log-odds."""
        data = self.to_full()
        return file_header(".ot", _octree_binding.full_nodes(data), self._resolution) + data

    def write_bt(self, path: str | os.PathLike[str]) -> None:
        """Write a .bt file. An older file is replaced when the new one is complete."""
        write_whole(Path(path), self.bt_bytes())

    def write_ot(self, path: str | os.PathLike[str]) -> None:
        """Write an .ot file. An older file is replaced when the new one is complete."""
        write_whole(Path(path), self.ot_bytes())

    @classmethod
    def read(cls, path: str | os.PathLike[str], sensor_model: SensorModel | None = None) -> "OctreeMap":
        """The map of a .bt or .ot file, told by its first line. ValueError names the file and what is wrong; OSError if unreadable."""
        try:
            return cls._parse(Path(path).read_bytes(), sensor_model)
        except ValueError as error:
            raise ValueError(f"{os.fspath(path)}: {error}") from error

    @classmethod
    def _parse(cls, content: bytes, sensor_model: SensorModel | None) -> "OctreeMap":
        fields, data = parsed_file(content)
        count, read = (
            (_octree_binding.binary_nodes, cls.from_binary) if fields.kind == ".bt" else (_octree_binding.full_nodes, cls.from_full)
        )
        nodes = count(data)
        if nodes != fields.nodes:
            raise ValueError(f"its header says {fields.nodes} nodes, its data holds {nodes}")
        return read(data, fields.resolution, sensor_model)

    def _box(self, lo: ArrayLike | None, hi: ArrayLike | None) -> tuple[Corner, Corner]:
        """Lowest and highest voxel index of a box in metres; a corner within 1e-6 voxels of a border lies on it."""
        low = np.full(3, -np.inf) if lo is None else _corner("lo", lo)
        high = np.full(3, np.inf) if hi is None else _corner("hi", hi)
        if np.isnan(low).any() or np.isnan(high).any() or (low > high).any():
            raise ValueError(f"a box needs lo <= hi on every axis, not {low.tolist()}, {high.tolist()}")
        first = np.clip(np.floor(low / self._resolution + 1e-6), -KEY_OFFSET, KEY_OFFSET - 1)
        last = np.clip(np.maximum(np.ceil(high / self._resolution - 1e-6) - 1, first), -KEY_OFFSET, KEY_OFFSET - 1)
        return _indices(first), _indices(last)


def _indices(values: NDArray[np.float64]) -> Corner:
    x, y, z = (int(v) for v in values)
    return x, y, z


def _rows_of_three(name: str, array: NDArray[np.float32]) -> NDArray[np.float32]:
    rows = np.asarray(array)
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise ValueError(f"{name} must be (N, 3), not {rows.shape}")
    return np.ascontiguousarray(rows, dtype=np.float32)


def _corner(name: str, value: ArrayLike) -> NDArray[np.float64]:
    corner = np.asarray(value, dtype=np.float64)
    if corner.shape != (3,):
        raise ValueError(f"{name} must be three metres x, y, z, not {value!r}")
    return corner
