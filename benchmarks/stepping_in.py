"""A mean person steps into the way of a robot that drives straight: how far it still goes, and whether it touches.

The robot of `pybullet_simulation` (`realism:=hardware`) drives over a level hall at --speed. Its lines, filtered and placed by its true
pose, feed the costmap, and the collision monitor limits the command: no planner, no follower. Trial by trial the person starts elsewhere
and the mount's nod has another phase. The way counts from when the person's outline is in the robot's way, no more than --ahead before it,
until the robot stands.

    python benchmarks/stepping_in.py --trials 100 [--mount level] [--speed 0.5] [--ahead 1.2] [--unguarded]
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from collision_monitor import CollisionMonitor, CollisionMonitorConfig
from local_terrain_costmap import CostmapConfig, LocalCostmap
from pybullet_simulation import Simulation, SimulationConfig, TickData, TimingConfig
from pybullet_simulation.robot_model import read_robot_model
from pybullet_simulation.solids import box, walls_around
from pybullet_simulation.world import World, joined
from rigid_geometry import inverse, transform_points, yaw_of
from robot_body import RobotBody
from simulated_movers import MoverSpec
from simulated_movers.shapes import RADIUS_M
from sweep_assembly import LaserScans, LineSource, Scan, ScanFilter, ScanFilterConfig, ScanGeometry, SweepAssemblyConfig, TiltGeometry

Array = NDArray[np.float64]
ROBOT = RobotBody()
MODEL = read_robot_model(ROBOT)
MOUNT = TiltGeometry(MODEL.T_base_mount, MODEL.T_tilt_laser)
START = (-8.0, 0.0, 0.0)
EVERY_S = 0.05
LONGEST_S = 20.0


def hall() -> World:
    """16 by 4 m of level floor between walls."""
    low, high = np.array([-10.0, -2.0]), np.array([6.0, 2.0])
    solids = [box("floor", (*(low - 0.2), -0.5), (*(high + 0.2), 0.0)), *walls_around(low, high, -0.1, 2.5)]
    vertices, triangles = joined(solids)
    return World("hall", tuple(solids), (), vertices, triangles, np.array([vertices.min(0), vertices.max(0)]), START, 0.0)


def person(rng: np.random.Generator) -> MoverSpec:
    """Beside the way, where it will see the robot come."""
    place = (float(rng.uniform(-5.2, -4.2)), float(rng.choice([-1.0, 1.0]) * rng.uniform(0.9, 1.6)))
    return MoverSpec(name="mean", walk="steps_in", start=place, speed_mps=float(rng.uniform(0.8, 1.4)), pause_s=6.0)


@dataclass
class Trial:
    """What a trial showed; NaN where the person never stepped in or the robot never stood."""

    way_m: float = np.nan
    gap_m: float = np.nan
    ahead_m: float = np.nan
    touch_mps: float = 0.0
    marked_s: float = np.nan


class Robot:
    """The simulated robot with costmap and monitor, driven straight on."""

    def __init__(self, spec: MoverSpec, seed: int, *, nods: bool, guarded: bool) -> None:
        world = replace(hall(), movers=(spec,))
        self.simulation = Simulation(SimulationConfig(), world, seed, ROBOT, None, TimingConfig())
        self._filter = ScanFilter(ScanFilterConfig(), MOUNT, ROBOT)
        self._lines = LineSource(SweepAssemblyConfig(), MOUNT, LaserScans())
        self.costmap, self.config = LocalCostmap(CostmapConfig(), ROBOT), CollisionMonitorConfig()
        self._monitor, self._guarded = CollisionMonitor(self.config, ROBOT), guarded
        self._tilts: list[tuple[float, float]] = []
        side = 400
        self.costmap.set_terrain(np.zeros((side, side), np.int8), (-16.0, -16.0), 0.08, np.full((side, side), 0.04))
        self.simulation.nod(nods)

    def tick(self, speed: float) -> tuple[Array, float]:
        """A tick at a wanted speed: true pose, and speed commanded."""
        T = self.simulation.T_world_base
        strangers = self.costmap.strangers(self.config.memory_s) - T[:2, 3]
        c, s = np.cos(yaw_of(T)), np.sin(yaw_of(T))
        limited = self._monitor.limited(self.simulation.stamp_s, speed, 0.0, strangers @ np.array([[c, -s], [s, c]]))
        v = limited.v if self._guarded else speed
        data = self.simulation.tick(v, 0.0)
        self.speed_mps = float(np.linalg.norm(data.truth.linear[:2]))
        self.touches = [c.speed_mps for c in data.contacts if c.other]
        self._see(data)
        return self.simulation.T_world_base, v

    def _see(self, data: TickData) -> None:
        T = self.simulation.T_world_base
        self.costmap.recenter(T[0, 3], T[1, 3])
        for joint in data.joints:
            self._lines.add_joint(joint.stamp_s, joint.positions[0])
            self._tilts.append((joint.stamp_s, joint.positions[0]))
        self._lines.add_odometry(data.stamp_s, T)
        layout = self.simulation.scan_geometry
        geometry = ScanGeometry(layout.angle_min, layout.angle_increment, layout.time_increment, layout.beams)
        at, tilts = np.array(self._tilts[-40:]).T if self._tilts else (np.zeros(1), np.zeros(1))
        for one in data.scans:
            scan = Scan(geometry, one.ranges, layout.range_min, layout.range_max)
            beams = np.interp(one.stamp_s + geometry.beam_times, at, tilts)
            self._lines.add_reading(one.stamp_s, replace(scan, ranges=self._filter.filter(scan, beams)))
        for line in self._lines.poll():
            self.costmap.add_line(line.stamp_s, line.hits, line.free_ends, line.origin)


def trial(seed: int, speed: float, ahead_m: float, *, nods: bool, guarded: bool) -> Trial:
    """One drive, until the robot stands before the person."""
    rng = np.random.default_rng([seed, 40])
    robot, found = Robot(person(rng), seed, nods=nods, guarded=guarded), Trial()
    for _ in range(int(rng.integers(0, 80))):  # phase of the nod
        robot.tick(0.0)
    began: Array | None = None
    began_s = 0.0
    for _ in range(round(LONGEST_S / EVERY_S)):
        T, _ = robot.tick(speed)
        assert robot.simulation.crowd is not None
        place = robot.simulation.crowd.places()[0, :2]
        local = transform_points(inverse(T), np.array([[*place, T[2, 3]]]))[0]
        found.touch_mps = max([found.touch_mps, *robot.touches])
        in_way = (
            abs(local[1]) < ROBOT.half_width_m + RADIUS_M["person"] and 0.0 < local[0] <= ahead_m + ROBOT.half_length_m + RADIUS_M["person"]
        )
        if began is None and in_way:
            began, began_s = T[:2, 3].copy(), robot.simulation.stamp_s
            found.ahead_m = local[0] - ROBOT.half_length_m - RADIUS_M["person"]
        near = robot.costmap.strangers(0.3)
        if began is not None and np.isnan(found.marked_s) and len(near) and np.linalg.norm(near - place, axis=1).min() < 0.4:
            found.marked_s = robot.simulation.stamp_s - began_s
        v_now = robot.speed_mps
        if began is not None and abs(v_now) < 0.02 and robot.simulation.stamp_s > began_s + 0.1:
            found.way_m = float(np.linalg.norm(T[:2, 3] - began))
            found.gap_m = local[0] - ROBOT.half_length_m - RADIUS_M["person"]
            break
    robot.simulation.close()
    return found


def main() -> None:
    """Trials and their sum."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--speed", type=float, default=0.5)
    parser.add_argument("--ahead", type=float, default=1.2, help="m between robot and person from which on the way counts")
    parser.add_argument("--mount", choices=("nods", "level"), default="nods")
    parser.add_argument("--unguarded", action="store_true")
    a = parser.parse_args()
    found = [trial(seed, a.speed, a.ahead, nods=a.mount == "nods", guarded=not a.unguarded) for seed in range(a.first, a.first + a.trials)]
    way, gap, ahead, marked = (np.array([getattr(one, name) for one in found]) for name in ("way_m", "gap_m", "ahead_m", "marked_s"))
    stepped = ~np.isnan(ahead)
    touched = sum(one.touch_mps > 0.05 for one in found)
    print(f"{a.mount} {a.speed} m/s: stepped in {stepped.sum()} of {len(found)}, touched {touched}, stood {np.isfinite(way).sum()}")
    print(f"  stood within 0.4 m: {(way <= 0.4).sum()}; way m {_told(way)}; gap left m {_told(gap)}")
    print(f"  person ahead m when it stepped in {_told(ahead)}; marked after s {_told(marked)}")


def _told(values: Array) -> str:
    known = values[np.isfinite(values)]
    return f"{known.min():.2f} to {known.max():.2f}, mean {known.mean():.2f}" if len(known) else "-"


if __name__ == "__main__":
    main()
