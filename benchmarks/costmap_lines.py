"""What single lines of a nodding laser mark on the costmap of a robot that drives: false stops, and how near a box is when it is marked.

No physics: the robot stands on its wheels along a seeded drive, at 0.5 m/s; noise, mixed pixels, play and offset of the mount are those
of `realism:=hardware`, and its pose errs slowly as a tracked one does. The map is made of its own half-sweeps, each known half a second
after its end. A stop is false where the way ahead is free without the lines' marks and not with them. Boxes of 0.3 m are put in the way
2.3 m ahead wherever it drives straight so far; what they do to the map is left out.

    python benchmarks/costmap_lines.py --worlds rooms,ramp,moon --seeds 1-3 [--set least_hits=3 ..]
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import yaml
from numpy.typing import NDArray
from registration_worlds import Ground, drive_poses, world_of

from local_terrain_costmap import LETHAL, CostmapConfig, LocalCostmap
from octomap_server_3dnav.exploration.config import ExplorationConfig
from octomap_server_3dnav.navigation.local_grid import TerrainGrid, project
from octomap_server_3dnav.octree.map_builder import RUNS_MARGIN_M, Beams, MapBuilder, MapConfig
from octomap_server_3dnav.octree.octree import SensorModel
from octomap_server_3dnav.terrain.classify import TerrainConfig, classify
from path_following import FollowerConfig
from path_following.surroundings import Surroundings, Unknown, arc_poses, footprint_lattice
from pybullet_simulation.config import SimulationConfig
from pybullet_simulation.laser import Laser, Motion
from pybullet_simulation.robot_model import read_robot_model
from pybullet_simulation.solids import box
from pybullet_simulation.tilt_mount import TiltMount
from pybullet_simulation.world import World, joined
from rigid_geometry import inverse, transform_from_rpy, transform_points, yaw_of
from robot_body import RobotBody
from stage_config import load_config
from sweep_assembly import LaserScans, LineSource, Scan, ScanFilter, ScanFilterConfig, ScanGeometry, SweepAssemblyConfig, TiltGeometry
from sweep_assembly.line_source import Line

Array = NDArray[np.float64]
SPEED_MPS, TURN_RADPS = 0.5, 0.6
STEP_S, SCAN_S, POSE_S = 0.005, 0.025, 0.05
HALF_PERIOD_S, LATE_S = 2.75, 0.5
HIGHEST_RAD, LOWEST_RAD = -0.61, 1.75
ERROR_M, ERROR_RAD, ERROR_S = (0.01, 0.01, 0.006), (0.002, 0.002, 0.002), 2.0
BOX_M, BOX_AHEAD_M = 0.3, 2.3
ROBOT = RobotBody()
MODEL = read_robot_model(ROBOT)
MOUNT = TiltGeometry(MODEL.T_base_mount, MODEL.T_tilt_laser)
FOOTPRINT = footprint_lattice(ROBOT.length_m, ROBOT.width_m, 0.05)


def true_poses(world: World, spots: Array) -> Array:
    """(K, 4, 4) poses every POSE_S of a robot that turns on the spot at every corner and drives straight between."""
    ground, poses = Ground(world), []
    z, yaw = float(spots[0][2, 3]) - ROBOT.base_height_m, yaw_of(spots[0])
    for a, b in zip(spots, spots[1:], strict=False):
        way = b[:2, 3] - a[:2, 3]
        heading = math.atan2(way[1], way[0])
        turn = math.remainder(heading - yaw, 2 * math.pi)
        turns = [(*a[:2, 3], yaw + t) for t in np.arange(0.0, abs(turn), TURN_RADPS * POSE_S) * np.sign(turn)]
        length = float(np.hypot(*way))
        drives = [(*(a[:2, 3] + g / length * way), heading) for g in np.arange(0.0, length, SPEED_MPS * POSE_S)]
        yaw = heading
        for x, y, psi in turns + drives:
            T = ground.pose(x, y, z, psi)
            z = float(T[2, 3] - ROBOT.base_height_m * T[2, 2])
            poses.append(T)
    return np.array(poses)


def pose_errors(count: int, rng: np.random.Generator) -> Array:
    """(K, 4, 4) errors that wander: what tracking leaves."""
    keep = math.exp(-POSE_S / ERROR_S)
    sigma, errors = np.array([*ERROR_M, *ERROR_RAD]), np.zeros(6)
    out = []
    for _ in range(count):
        errors = keep * errors + math.sqrt(1 - keep * keep) * sigma * rng.standard_normal(6)
        out.append(transform_from_rpy(tuple(errors[:3]), tuple(errors[3:])))
    return np.array(out)


def nod(times_s: Array) -> Array:
    """Tilts of the mount: up and down for ever, with even lines on the ground."""
    grid = np.linspace(HIGHEST_RAD, LOWEST_RAD, 500)
    share = np.cumsum(1.0 / (0.3 + 2.1 * np.sin(grid) ** 2))
    phase = times_s / HALF_PERIOD_S % 2.0
    return np.interp(np.minimum(phase, 2.0 - phase), (share - share[0]) / (share[-1] - share[0]), grid)


class Drive:
    """The laser of a robot along a drive, and what it and its odometry say."""

    def __init__(self, world: World, poses: Array, seed: int) -> None:
        rng = np.random.default_rng([seed, 91])
        self.poses, self.errors = poses, pose_errors(len(poses), rng)
        self._config, self._world, self._rng = SimulationConfig(), world, rng
        self._mount = TiltMount(self._config, rng)
        self._laser = Laser(self._config, MODEL, world, rng)
        self._filter = ScanFilter(ScanFilterConfig(), MOUNT, ROBOT)

    def put(self, low: Array, high: Array) -> None:
        """A box into the world."""
        vertices, triangles = joined([*self._world.solids, *self._world.surfaces, box("new", tuple(low), tuple(high))])
        changed = World(self._world.name, self._world.solids, self._world.surfaces, vertices, triangles, self._world.extent, (0, 0, 0), 0.0)
        self._laser = Laser(self._config, MODEL, changed, self._rng)

    def take_away(self) -> None:
        """Every box that was put."""
        self._laser = Laser(self._config, MODEL, self._world, self._rng)

    def estimate(self, k: int) -> Array:
        """Where the robot believes to be."""
        return np.asarray(self.poses[k] @ self.errors[k])

    def feed(self, source: LineSource, k: int) -> Iterator[Line]:
        """What comes between pose k and the next: two scans, joints, odometry."""
        steps = round(POSE_S / STEP_S)
        share = np.arange(steps + 1) / steps
        a, b = self.poses[k], self.poses[k + 1]
        rotations = a[:3, :3] + share[:, None, None] * (b[:3, :3] - a[:3, :3])
        positions = a[:3, 3] + share[:, None] * (b[:3, 3] - a[:3, 3])
        begin_s = k * POSE_S
        tilts = nod(begin_s + np.arange(steps + 1, dtype=np.float64) * STEP_S)
        motion = Motion(rotations, positions, self._mount.true_tilts(tilts), STEP_S)
        layout = self._laser.geometry
        geometry = ScanGeometry(layout.angle_min, layout.angle_increment, layout.time_increment, layout.beams)
        for i in range(1 if k else 0, steps + 1):
            source.add_joint(begin_s + i * STEP_S, float(tilts[i] + 1e-4 * self._rng.standard_normal()))
        source.add_odometry(begin_s, self.estimate(k))
        for start_s, ranges in zip((0.0, SCAN_S), self._laser.scans(motion, np.array([0.0, SCAN_S])), strict=True):
            scan = Scan(geometry, ranges, layout.range_min, layout.range_max)
            at_beams = nod(begin_s + start_s + geometry.beam_times)
            source.add_reading(begin_s + start_s, replace(scan, ranges=self._filter.filter(scan, at_beams)))
        yield from source.poll()


@dataclass
class OwnMap:
    """The robot's map, made of half-sweeps."""

    builder: MapBuilder = field(default_factory=lambda: MapBuilder(MapConfig(), SensorModel(), ROBOT))
    vertices: list[Array] = field(default_factory=list)

    def add(self, lines: list[Line], T_map_base: Array) -> TerrainGrid:
        """The terrain with one more half-sweep, around the robot."""
        T_base_map = inverse(T_map_base)

        def joined_in_base(parts: Sequence[NDArray[np.floating]]) -> NDArray[np.float32]:
            return transform_points(T_base_map, np.concatenate(parts).astype(np.float64)).astype(np.float32)

        points, free = joined_in_base([one.hits for one in lines]), joined_in_base([one.free_ends for one in lines])
        origins, free_origins = (
            joined_in_base([np.tile(one.origin, (len(part(one)), 1)) for one in lines])
            for part in (lambda one: one.hits, lambda one: one.free_ends)
        )
        self.vertices.append(T_map_base)
        self.builder.add_sweep(Beams(points, origins, free, free_origins), len(self.vertices) - 1, np.array(self.vertices))
        radius_m = ExplorationConfig().local_radius_m
        runs = self.builder.runs_around(T_map_base, radius_m + RUNS_MARGIN_M)
        return project(classify(runs, T_map_base, TerrainConfig(), ROBOT, radius_m, self.builder.heights), tuple(T_map_base[:2, 3]), 8.0)


@dataclass
class Found:
    """What a drive showed; distances in metres from base_link."""

    driven_s: float = 0.0
    stops: int = 0
    stopped_s: float = 0.0
    marks: list[int] = field(default_factory=list)
    boxes_m: list[tuple[float, float, float]] = field(default_factory=list)
    """From the nearest side of a box: where it was put, first met by a line, and marked; NaN for never before the robot was there."""


@dataclass
class PlacedBox:
    """A box on the ground at `middle` (3,), and how far off its nearest side was when it was put and met."""

    middle: Array
    put_m: float = math.nan
    met_m: float = math.nan

    def from_m(self, T_map_base: Array) -> float:
        """How far off its side is."""
        return float(np.hypot(*(self.middle[:2] - T_map_base[:2, 3]))) - BOX_M / 2

    def is_met(self, line: Line) -> bool:
        """Whether beams end on it, higher than the robot's step."""
        off = line.hits - self.middle
        return int(((np.abs(off[:, :2]) < 0.2).all(axis=1) & (off[:, 2] > 0.4 * BOX_M) & (off[:, 2] < BOX_M + 0.05)).sum()) > 3

    def is_marked(self, costmap: LocalCostmap) -> bool:
        """Whether something is lethal on it or just beside."""
        view = costmap.master()
        lethal = view.origin_xy + view.resolution * (np.argwhere(view.cost == LETHAL)[:, ::-1] + 0.5)
        return bool((np.abs(lethal - self.middle[:2]) < 0.2 + 0.5 * view.resolution).all(axis=1).any())


def is_free(costmap: LocalCostmap, T_map_base: Array) -> bool:
    """Whether the follower would drive straight on."""
    around = Surroundings(costmap.master(), FOOTPRINT, FOOTPRINT)
    pose = (float(T_map_base[0, 3]), float(T_map_base[1, 3]), yaw_of(T_map_base))
    return around.is_free(arc_poses(pose, 1.0, 0.0, FollowerConfig().check_ahead_m), Unknown.ALLOWED)


def outcome(name: str, seed: int, config: CostmapConfig, count: int, *, with_boxes: bool) -> Found:
    """One drive."""
    world = world_of(name, seed)
    drive = Drive(world, true_poses(world, drive_poses(world, seed, count)), seed)
    source, own, found = LineSource(SweepAssemblyConfig(), MOUNT, LaserScans()), OwnMap(), Found()
    costmap, bare = LocalCostmap(config, ROBOT), LocalCostmap(config, ROBOT)
    half: list[Line] = []
    due: list[tuple[float, TerrainGrid]] = []
    placed: PlacedBox | None = None
    ran_into, passes = False, 0
    for k in range(len(drive.poses) - 1):
        now_s, here = k * POSE_S, drive.estimate(k)
        for one in (costmap, bare):
            one.recenter(here[0, 3], here[1, 3])
        for line in drive.feed(source, k):
            costmap.add_line(line.stamp_s, line.hits, line.free_ends, line.origin)
            half.append(line)
            if placed is not None and math.isnan(placed.met_m) and placed.is_met(line):
                placed.met_m = placed.from_m(drive.poses[k])
        if (now_s + POSE_S) // HALF_PERIOD_S > now_s // HALF_PERIOD_S and half:
            passes += 1
            if placed is None:
                due.append((now_s + LATE_S, own.add(half, here)))
            half = []
        while due and due[0][0] <= now_s:
            grid = due.pop(0)[1]
            for one in (costmap, bare):
                one.set_terrain(grid.cost, grid.origin_xy, grid.resolution, grid.height, grid.distance)
        is_turning = abs(math.remainder(yaw_of(drive.poses[k + 1]) - yaw_of(drive.poses[k]), 2 * math.pi)) > 1e-3
        if with_boxes:
            placed = _box(drive, k, placed, costmap, found, passes)
            continue
        if passes < 2 or is_turning:
            continue
        found.driven_s += POSE_S
        found.marks.append(int(costmap._lines.marked.sum()))
        stopped = is_free(bare, here) and not is_free(costmap, here)
        found.stops += stopped and not ran_into
        found.stopped_s += POSE_S * stopped
        ran_into = stopped
    return found


def _box(drive: Drive, k: int, placed: PlacedBox | None, costmap: LocalCostmap, found: Found, passes: int) -> PlacedBox | None:
    """The box that is in the way now; none where the last one was marked or reached, and the way is not straight enough for another."""
    here = drive.poses[k]
    if placed is not None:
        marked = placed.is_marked(costmap)
        distance = placed.from_m(here)
        if not marked and distance > ROBOT.half_length_m:
            return placed
        found.boxes_m.append((placed.put_m, placed.met_m, distance if marked else math.nan))
        drive.take_away()
        return None
    ahead_k = k + round(BOX_AHEAD_M / SPEED_MPS / POSE_S)
    if passes < 2 or ahead_k >= len(drive.poses):
        return None
    there = drive.poses[ahead_k]
    placed = PlacedBox(there[:3, 3] - ROBOT.base_height_m * there[:3, 2])
    placed.put_m = placed.from_m(here)
    if placed.put_m < BOX_AHEAD_M - BOX_M / 2 - 0.05 or abs(math.remainder(yaw_of(there) - yaw_of(here), 2 * math.pi)) > 0.01:
        return None
    costmap.clear_obstacles()
    if placed.is_marked(costmap):  # by the terrain
        return None
    drive.put(placed.middle - [BOX_M / 2, BOX_M / 2, 0.1], placed.middle + [BOX_M / 2, BOX_M / 2, BOX_M])
    return placed


def main() -> None:
    """Drive and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", default="rooms,ramp,moon")
    parser.add_argument("--seeds", default="1-3")
    parser.add_argument("--count", type=int, default=10, help="corners of a drive")
    parser.add_argument("--boxes", action="store_true")
    parser.add_argument("--set", nargs="+", default=[], metavar="NAME=VALUE", help="other values of the costmap's parameters")
    arguments = parser.parse_args()
    config = load_config(CostmapConfig, {n: yaml.safe_load(t) for n, _, t in (item.partition("=") for item in arguments.set)})
    low, _, high = arguments.seeds.partition("-")
    for name in arguments.worlds.split(","):
        for seed in range(int(low), int(high or low) + 1):
            found = outcome(name, seed, config, arguments.count, with_boxes=arguments.boxes)
            if arguments.boxes:
                for put_m, met_m, marked_m in found.boxes_m:
                    print(f"{name} {seed}: put {put_m:.2f} m away, first met at {met_m:.2f}, marked at {marked_m:.2f}", flush=True)
            else:
                mean = np.mean(found.marks) if found.marks else math.nan
                print(
                    f"{name} {seed}: {found.driven_s:.0f} s, false stops {found.stops} ({found.stopped_s:.1f} s), {mean:.1f} marks",
                    flush=True,
                )


if __name__ == "__main__":
    main()
