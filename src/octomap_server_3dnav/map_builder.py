"""From placed sweeps to an octree that follows the pose graph (thesis 5.5, 6.2.2).

Between pose_graph_mapping and the terrain analysis: each sweep is cropped to the dense cuboid around the robot and inserted; when the
graph moves older sweeps by more than half a voxel, the tree is built anew from all of them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from octomap_server_3dnav.column_runs import ColumnRuns
from octomap_server_3dnav.octree import OctreeMap, SensorModel
from octomap_server_3dnav.surface_heights import HitHeights, SurfaceHeights
from rigid_geometry import as_transform, rotation_angle, transform_points
from stage_config import check_ranges, parameter

_LEVER_M = 4.0  # a turned sweep counts as moved by what its points at this distance move

RUNS_MARGIN_M = 2.25  # columns beyond a classified radius that inflation and the look for cliffs read


@dataclass(frozen=True)
class MapConfig:
    """Octree and cropping; `resolution` and `frame_id` are octomap_server's parameters."""

    resolution: float = parameter(0.08, "m", "edge of a voxel", low=0.01, high=1.0)
    frame_id: str = parameter("map", "-", "frame of the octree")
    max_range_m: float = parameter(12.0, "m", "rays free voxels up to this range", low=0.5, high=100.0)
    crop_half_m: float = parameter(
        7.0, "m", "half side of the cuboid around the robot in which a sweep is dense enough to be inserted", low=1.0, high=100.0
    )
    crop_below_m: float = parameter(4.0, "m", "how far below the robot the cuboid reaches", low=0.5, high=50.0)
    crop_above_m: float = parameter(4.0, "m", "how far above the robot the cuboid reaches", low=0.5, high=50.0)
    start_plane_half_m: float = parameter(
        0.8, "m", "half side of the plane put under the robot at the start, where the laser is blind", low=0.0, high=3.0
    )
    base_height_m: float = parameter(0.132, "m", "height of base_link above the ground", low=0.0, high=2.0)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self)


@dataclass(frozen=True, eq=False)
class Beams:
    """One sweep in base_link: hits and their origins (N, 3) float32, ends and origins of beams that met nothing (M, 3) float32."""

    points: NDArray[np.float32]
    origins: NDArray[np.float32]
    free_ends: NDArray[np.float32]
    free_origins: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class _PlacedSweep:
    vertex_id: int
    beams: Beams
    T_map_base: NDArray[np.float64]


class MapBuilder:
    """Owns the octree and the sweeps it was made of."""

    def __init__(self, config: MapConfig, sensor_model: SensorModel) -> None:
        """ValueError lists what is wrong with the configuration."""
        if problems := config.validate():
            raise ValueError("; ".join(problems))
        self.config = config
        self.tree = OctreeMap(config.resolution, sensor_model)
        self.heights = SurfaceHeights(config.resolution)
        self._sweeps: list[_PlacedSweep] = []

    def __len__(self) -> int:
        return len(self._sweeps)

    def add_sweep(self, beams: Beams, vertex_id: int, vertex_poses: ArrayLike) -> bool:
        """Adds the newest vertex's sweep, given the (V, 4, 4) poses of all; True when older ones had moved and the tree was built anew.

        Vertices whose sweep was lost on the way are no trouble. ValueError when `vertex_id` is not V - 1, its sweep is there already,
        or a pose is not rigid; nothing is changed then.
        """
        poses = [as_transform(T) for T in np.asarray(vertex_poses, dtype=np.float64)]
        if vertex_id != len(poses) - 1 or any(s.vertex_id >= vertex_id for s in self._sweeps):
            raise ValueError(
                f"sweep of vertex {vertex_id} with {len(poses)} poses, after that of {[s.vertex_id for s in self._sweeps[-1:]]}"
            )
        moved = any(self._moved(s.T_map_base, poses[s.vertex_id]) for s in self._sweeps)
        self._sweeps.append(_PlacedSweep(vertex_id, beams, poses[vertex_id]))
        if moved:
            self._rebuild(poses)
        else:
            self._insert(self._sweeps[-1], first=len(self._sweeps) == 1)
        return moved

    def runs_around(self, T_map_base: NDArray[np.float64], radius_m: float | None) -> ColumnRuns:
        """The known columns within a square of half side `radius_m` around the robot, or of the whole map."""
        if radius_m is None:
            return self.tree.column_runs()
        x, y = T_map_base[:2, 3]
        return self.tree.column_runs((x - radius_m, y - radius_m, -np.inf), (x + radius_m, y + radius_m, np.inf))

    def _moved(self, old: NDArray[np.float64], new: NDArray[np.float64]) -> bool:
        turned = rotation_angle(np.linalg.inv(old) @ new)
        return float(np.linalg.norm(old[:3, 3] - new[:3, 3])) + _LEVER_M * turned > 0.5 * self.config.resolution

    def _rebuild(self, poses: list[NDArray[np.float64]]) -> None:
        self.tree.reset()
        self.heights.reset()
        self._sweeps = [_PlacedSweep(s.vertex_id, s.beams, poses[s.vertex_id]) for s in self._sweeps]
        for i, sweep in enumerate(self._sweeps):
            self._insert(sweep, first=i == 0)

    def _insert(self, sweep: _PlacedSweep, *, first: bool) -> None:
        T, c = sweep.T_map_base, self.config
        x, y, z = T[:3, 3]
        bounds = ((x - c.crop_half_m, y - c.crop_half_m, z - c.crop_below_m), (x + c.crop_half_m, y + c.crop_half_m, z + c.crop_above_m))
        b = sweep.beams
        ends = np.concatenate([b.points, _beyond(b.free_ends, b.free_origins, c.max_range_m)])
        origins = np.concatenate([b.origins, b.free_origins])
        self.tree.insert_sweep(transform_points(T, ends), transform_points(T, origins), c.max_range_m, bounds)
        hits = transform_points(T, b.points)
        self.heights.add(HitHeights.of(hits[((hits >= bounds[0]) & (hits <= bounds[1])).all(axis=1)], c.resolution))
        if first and c.start_plane_half_m > 0:
            self.tree.insert_plane(T[:3, 3] - c.base_height_m * T[:3, 2] - (0, 0, 0.25 * c.resolution), c.start_plane_half_m)


def _beyond(ends: NDArray[np.float32], origins: NDArray[np.float32], max_range_m: float) -> NDArray[np.float32]:
    """`ends` moved out along their beams to beyond the range of insertion, so that they free their way and occupy nothing."""
    way = ends - origins
    length = np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-6)
    return np.asarray(origins + way * (2.0 * max_range_m / length), dtype=np.float32)
