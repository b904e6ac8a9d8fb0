"""From placed sweeps to an octree that follows the pose graph (thesis 5.5, 6.2.2); or from clouds that stay where they are.

Between pose_graph_mapping and the terrain analysis: each sweep is cropped to the dense cuboid around the robot and inserted; what the
graph moves by more than an eighth of a voxel is drawn anew. Clouds whose place somebody else knows are inserted and forgotten.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from octomap_server_3dnav.octree.beams import Beams as Beams
from octomap_server_3dnav.octree.beams import Bounds, inside
from octomap_server_3dnav.octree.column_runs import ColumnRuns
from octomap_server_3dnav.octree.map_config import MapConfig as MapConfig  # the map is made with one
from octomap_server_3dnav.octree.octree import OctreeMap, SensorModel, SweepVoxels
from octomap_server_3dnav.octree.shelf import Shelf, Shelved
from octomap_server_3dnav.octree.surface_heights import HitHeights, SurfaceHeights
from rigid_geometry import as_transforms, rotation_angles, transform_points
from rigid_geometry.transforms import Transform
from robot_body import RobotBody

_MOVED = 0.125  # voxels: of what is kept off things 1 cm is for errors, so sweeps must not lie farther off than that
_LEVER_M = 4.0  # a turned sweep counts as moved by what its points at this distance move

_SUNK = 0.25  # voxels by which the ground under the robot is put lower: it must not stand out of what was seen beside it
_UPRIGHT = 0.5  # of a robot that leans farther nobody knows what it stands on: 60 degrees

RUNS_MARGIN_M = 2.25  # columns beyond a classified radius that inflation and the look for cliffs read


@dataclass(frozen=True, eq=False)
class _Seen:
    """What a sweep adds to tree and heights."""

    voxels: list[SweepVoxels]
    hits: HitHeights


@dataclass(eq=False)
class _PlacedSweep:
    vertex_id: int
    beams: Shelved[Beams]
    T_map_base: Transform  # where the tree has it
    voxels: list[SweepVoxels]  # seen from there
    hits: Shelved[HitHeights]  # the same
    cleared: list[SweepVoxels] = field(default_factory=list)  # by hand, after it and before the next


class MapBuilder:
    """Owns the octree, the surface heights beside it, and the sweeps they were made of.

    A sweep whose vertex has moved by more than `_MOVED` voxels is drawn anew, and tree and heights become, bit by bit, those that it was
    given to there. That is done when what it touches is asked for: a robot that decides by its surroundings does not wait for the rest
    of a large map, and no answer depends on how far the work has come. `heights` are true wherever the tree was asked for.
    """

    def __init__(self, config: MapConfig, sensor_model: SensorModel, robot: RobotBody, shelf: Shelf | None = None) -> None:
        """`shelf`: for the sweeps' beams and hits, else they stay in memory. ValueError lists what is wrong with the configuration."""
        if problems := config.validate():
            raise ValueError("; ".join(problems))
        self.config, self.robot, self.shelf = config, robot, shelf or Shelf(None)
        self.heights = SurfaceHeights(config.resolution)
        self._tree = OctreeMap(config.resolution, sensor_model)
        self._sweeps: list[_PlacedSweep] = []
        self._moved: dict[int, tuple[_PlacedSweep, Transform]] = {}  # by vertex: what the tree has elsewhere than it is now
        self._stays = ""  # what is in the tree and can not be drawn anew: clouds, or a file
        self._knows_ground = False  # that under the robot

    @classmethod
    def of_tree(cls, config: MapConfig, tree: OctreeMap, robot: RobotBody) -> "MapBuilder":
        """A map that begins with a tree, as of a file. ValueError where its voxels are of another size than `config` says."""
        if tree.resolution != config.resolution:
            raise ValueError(f"its voxels are {tree.resolution:g} m, those of the map {config.resolution:g} m: set resolution to the same")
        new = cls(config, tree.sensor_model, robot)
        new._tree, new._stays, new._knows_ground = tree, "a file", True
        return new

    def __len__(self) -> int:
        return len(self._sweeps)

    def holds(self, vertex_id: int) -> bool:
        """Whether a vertex's sweep is in the map."""
        return any(sweep.vertex_id == vertex_id for sweep in self._sweeps)

    @property
    def content(self) -> str:
        """What the map is of, in words; empty while it is of nothing."""
        return f"{len(self)} sweeps of a pose graph" if self._sweeps else self._stays

    def add_sweep(self, beams: Beams, vertex_id: int, vertex_poses: ArrayLike) -> bool:
        """Adds the newest vertex's sweep, given the (V, 4, 4) poses of all; True when older ones have to be drawn anew.

        Vertices whose sweep was lost on the way are no trouble. ValueError when `vertex_id` is not V - 1, its sweep is there already,
        a pose is not rigid, or the map is of clouds or a file; nothing is changed then.
        """
        if self._stays:
            raise ValueError(f"the map is of {self.content}, and no sweep of a pose graph can be added: call ~reset before")
        poses = as_transforms(vertex_poses)  # a copy: they are kept
        if vertex_id != len(poses) - 1 or any(s.vertex_id >= vertex_id for s in self._sweeps):
            raise ValueError(
                f"sweep of vertex {vertex_id} with {len(poses)} poses, after that of {[s.vertex_id for s in self._sweeps[-1:]]}"
            )
        self._moved = self._moved_by(poses)
        seen = self._trace(beams, poses[vertex_id], first=not self._sweeps)
        self._sweeps.append(_PlacedSweep(vertex_id, self.shelf.put(beams), poses[vertex_id], seen.voxels, self.shelf.put(seen.hits)))
        self._insert(seen)
        return bool(self._moved)

    def add_cloud(self, points_map: NDArray[np.float32], origins_map: NDArray[np.float32], T_map_base: Transform | None) -> None:
        """Adds (N, 3) hits and where their beams started, which stay where they are, and the robot's pose where that is known.

        What is far is cropped as of a sweep, around the robot or, where nobody knows it, around the sensor. ValueError for a cloud without
        points, or where the map is of a pose graph's sweeps; nothing is changed then.
        """
        if self._sweeps:
            raise ValueError(f"the map is of {self.content}, and no cloud can be added: call ~reset before")
        if not len(points_map):
            raise ValueError("a cloud without points")
        stands = None if self._knows_ground or T_map_base is None else T_map_base
        centre = origins_map.mean(axis=0) if T_map_base is None else T_map_base[:3, 3]
        self._insert(self._seen(points_map, origins_map, len(points_map), centre, stands))
        self._stays, self._knows_ground = self._stays or "clouds", self._knows_ground or stands is not None

    def configure(self, config: MapConfig, sensor_model: SensorModel) -> None:
        """Counts all beams so from now on, also those of the sweeps that are in the map: it becomes as if it had always been so.

        What clouds and files have left stays as it is. ValueError lists what is wrong with the configuration; nothing is changed then.
        """
        if problems := config.validate() + sensor_model.validate():
            raise ValueError("; ".join(problems))
        self._redraw(list(self._moved))
        before, self.config = self.config, replace(config, resolution=self.config.resolution)
        if sensor_model == self._tree.sensor_model and _is_same(before, self.config):
            return
        if self._stays:
            self._tree = OctreeMap.from_full(self._tree.to_full(), self.config.resolution, sensor_model)
            return
        self._tree, self.heights = OctreeMap(self.config.resolution, sensor_model), SurfaceHeights(self.config.resolution)
        for sweep in self._sweeps:
            self._insert(self._traced(sweep))
            for voxels in sweep.cleared:
                self._tree.insert(voxels)

    def fix(self, what: str) -> None:
        """Takes the sweeps as they lie for good: clouds may be added from now on, and sweeps no more. `what` the map is of is told."""
        self._redraw(list(self._moved))
        self._sweeps, self._stays, self._knows_ground = [], what, True

    def _insert(self, seen: _Seen) -> None:
        for voxels in seen.voxels:
            self._tree.insert(voxels)
        self.heights.add(seen.hits)

    def clear_box(self, lo: ArrayLike, hi: ArrayLike) -> None:
        """Make all that is known in a box (corners (3,) in map) free; what sweeps see there later counts, what they saw before does not.

        ValueError for corners that are none. Redrawing keeps it as it stands in the map, whatever sweeps move.
        """
        cleared = self.tree.trace_clearing(lo, hi)
        for voxels in cleared:
            self._tree.insert(voxels)
        if self._sweeps:
            self._sweeps[-1].cleared += cleared

    @property
    def tree(self) -> OctreeMap:
        """The octree, with every sweep where it is now; the same object until `configure`."""
        self._redraw(list(self._moved))
        return self._tree

    def draw_moved(self, T_map_base: Transform, radius_m: float | None) -> None:
        """Draws the moved sweeps anew that touch the square of half side `radius_m` around the robot, or all; whoever asks for that square
        finds it done."""
        self._redraw(list(self._moved) if radius_m is None else self._moved_within(T_map_base, radius_m))

    def runs_around(self, T_map_base: Transform, radius_m: float | None) -> ColumnRuns:
        """The known columns within a square of half side `radius_m` around the robot, or of the whole map."""
        self.draw_moved(T_map_base, radius_m)
        if radius_m is None:
            return self._tree.column_runs()
        x, y = T_map_base[:2, 3]
        return self._tree.column_runs((x - radius_m, y - radius_m, -np.inf), (x + radius_m, y + radius_m, np.inf))

    def _moved_by(self, poses: NDArray[np.float64]) -> dict[int, tuple[_PlacedSweep, Transform]]:
        """The sweeps that the tree has more than `_MOVED` voxels from where the (V, 4, 4) poses have them, by vertex."""
        if not self._sweeps:
            return {}
        old, new = np.array([s.T_map_base for s in self._sweeps]), poses[[s.vertex_id for s in self._sweeps]]
        turned = rotation_angles(old[:, :3, :3].transpose(0, 2, 1) @ new[:, :3, :3])
        by_m = np.linalg.norm(old[:, :3, 3] - new[:, :3, 3], axis=1) + _LEVER_M * turned
        moved = (self._sweeps[i] for i in np.flatnonzero(by_m > _MOVED * self.config.resolution))
        return {s.vertex_id: (s, poses[s.vertex_id]) for s in moved}

    def _moved_within(self, T_map_base: Transform, radius_m: float) -> list[int]:
        """Vertices whose sweep touches the square around the robot, where it was drawn or where it is now."""
        c = self.config
        # The plane of the first sweep lies up to base_height_m beside a tilted robot; a voxel more is what boxes are rounded by.
        reach = radius_m + max(c.crop_half_m, c.start_plane_most_m + self.robot.base_height_m) + c.resolution
        return [
            vertex
            for vertex, (sweep, T_now) in self._moved.items()
            if any((np.abs(T[:2, 3] - T_map_base[:2, 3]) <= reach).all() for T in (sweep.T_map_base, T_now))
        ]

    def _redraw(self, vertices: Iterable[int]) -> None:
        due = [self._moved.pop(vertex) for vertex in vertices]
        if not due:
            return
        changed, before = [voxels for sweep, _ in due for voxels in sweep.voxels], [sweep.hits() for sweep, _ in due]
        for sweep, T_now in due:
            sweep.T_map_base = T_now
        after = [self._traced(sweep) for sweep, _ in due]
        changed += [voxels for seen in after for voxels in seen.voxels]
        self._tree.redraw(changed, [voxels for sweep in self._sweeps for voxels in (*sweep.voxels, *sweep.cleared)])
        self.heights.remove(HitHeights.together(before))
        self.heights.add(HitHeights.together([seen.hits for seen in after]))

    def _traced(self, sweep: _PlacedSweep) -> _Seen:
        """What a sweep saw from where it is now, which it keeps."""
        seen = self._trace(sweep.beams(), sweep.T_map_base, first=sweep is self._sweeps[0])
        sweep.voxels, sweep.hits = seen.voxels, self.shelf.put(seen.hits, instead_of=sweep.hits)
        return seen

    def _trace(self, b: Beams, T: Transform, *, first: bool) -> _Seen:
        """What a sweep at T_map_base saw; of the first one also the ground under the robot, where it saw nothing."""
        origins = transform_points(T, np.concatenate([b.origins, b.free_origins]))
        return self._seen(self._ends(b, T), origins, len(b.points), T[:3, 3], T if first else None)

    def _ends(self, b: Beams, T: Transform) -> NDArray[np.float32]:
        """In map, first of the beams that met something."""
        return transform_points(T, np.concatenate([b.points, b.free_ends]))

    def _bounds(self, centre: NDArray[np.floating]) -> Bounds:
        """Lowest and highest corner of what is drawn of a sweep."""
        c = self.config
        x, y, z = centre
        return (x - c.crop_half_m, y - c.crop_half_m, z - c.crop_below_m), (x + c.crop_half_m, y + c.crop_half_m, z + c.crop_above_m)

    def _seen(
        self,
        ends: NDArray[np.float32],
        origins: NDArray[np.float32],
        hit_count: int,
        centre: NDArray[np.floating],
        stands: Transform | None,
    ) -> _Seen:
        """What beams in map saw around `centre`; the first `hit_count` met something. And the ground under a robot that `stands` there.

        That lies as the robot lies, whose roll and pitch gravity tells: on a slope a level plane would stand in its way.
        """
        c = self.config
        bounds, stood_on = self._bounds(centre), np.zeros((0, 3), dtype=np.float32)
        voxels = [self._tree.trace_sweep(ends, origins, c.max_range_m, bounds, hit_count)]
        hits = inside(ends[:hit_count], bounds)
        if stands is not None and c.start_plane_half_m > 0 and stands[2, 2] > _UPRIGHT:
            middles, stood_on = self._ground_under(stands, voxels[0], self._blind_m(stands, hits))
            voxels.append(self._tree.trace_sweep(middles, middles))  # beams that end where they begin
        return _Seen(voxels, HitHeights.of(np.concatenate([hits, stood_on]), c.resolution))

    def _blind_m(self, T: Transform, hits: NDArray[np.floating]) -> float:
        """How far around a robot at T_map_base its first sweep shows no ground: a lidar that is fixed looks over what is near."""
        c, from_robot = self.config, hits - (T[:3, 3] - self.robot.base_height_m * T[:3, 2])
        away_m = np.linalg.norm(from_robot, axis=1)[np.abs(from_robot @ T[:3, 2]) <= c.resolution]
        nearest_m = away_m.min() if away_m.size else 0.0  # of no ground nobody knows where it begins
        return float(np.clip(nearest_m + c.resolution, c.start_plane_half_m, c.start_plane_most_m))

    def _ground_under(self, T: Transform, seen: SweepVoxels, half_m: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Voxels of the plane that a robot at T_map_base stands on, where a sweep saw nothing: their middles, and where in them it is."""
        c, up = self.config, T[:3, 2]
        alone = OctreeMap(c.resolution, self._tree.sensor_model)
        alone.insert(seen)
        below = T[:3, 3] - self.robot.base_height_m * up
        middles = alone.unknown_on_plane(below - (0, 0, _SUNK * c.resolution), half_m, up)
        height = below[2] - (middles[:, :2] - below[:2]) @ up[:2] / up[2]
        top = middles[:, 2] + 0.499 * c.resolution
        return middles, np.column_stack([middles[:, :2], np.minimum(height, top)]).astype(np.float32)


def _is_same(a: MapConfig, b: MapConfig) -> bool:
    return all(getattr(a, f.name) == getattr(b, f.name) for f in fields(MapConfig))
