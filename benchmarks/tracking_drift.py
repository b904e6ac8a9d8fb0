"""How well tracking holds odometry on the map: drift from stop to stop, bend within a sweep, truth of the covariance, and time.

Drives of the simulator (`driven_records.py`) go through tracker, sweep assembly and pose graph as in the nodes, in order, without ROS.

    python benchmarks/tracking_drift.py --worlds rooms,ramp,moon --seeds 1-3
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from driven_records import DrivenRecord, DriveRequest, Tick, driven_record
from numpy.typing import NDArray
from registration_scores import text_table, write_json

from explore_command.parameters import read_profile
from mapping_tools.bag_sweeps import gravity_of
from odometry_fusion import OdometryEstimate
from pose_graph_mapping.config import MappingConfig, RegistrationConfig
from pose_graph_mapping.graph.mapper import PoseGraphMapper
from pose_graph_mapping.registration.methods import create_registration
from pybullet_simulation import SimulationConfig, realistic
from rigid_geometry import interpolate_transforms, inverse
from scan_tracking import ScanTracker, ScanTrackingConfig, TrackedPose
from scan_tracking.pose_error import error_between
from stage_config import load_config
from sweep_assembly import LaserScans, Scan, SweepAssembler, SweepAssemblyConfig
from sweep_assembly.assembler import along_nodes
from sweep_assembly.beams import FreeBeams

Array = NDArray[np.float64]

AREA_M = 8.0  # of graph, whose clouds are the local map
PLANE = [0, 1, 5]  # of a pose's error: x, y and yaw
NODE_S = 0.005
ROTATION_LAST = [3, 4, 5, 0, 1, 2]  # from gtsam's order
FLOOR = np.repeat([0.005, 0.002], 3)  # sigmas of a match, at least: m and rad
HEADER = (
    "world",
    "mode",
    "legs",
    "drift cm",
    "worst",
    "odometry cm",
    "height cm",
    "worst",
    "yaw deg",
    "NEES",
    "refused",
    "bend cm",
    "worst",
    "odometry",
    "ms/s",
)


@dataclass(eq=False)
class Legs:
    """What is known of a drive afterwards: tracked poses with the pose in map and the true one, since the last vertex, and more."""

    drift: list[tuple[float, float, float, float]] = field(default_factory=list)  # tracked and odometry, m in the plane; yaw rad, height m
    nees: list[float] = field(default_factory=list)
    bend: list[tuple[float, float]] = field(default_factory=list)  # tracked m, odometry m
    counts: dict[str, int] = field(default_factory=dict)
    cpu_s: float = 0.0
    driven_s: float = 0.0


class Drive:
    """A record through tracker, assembler and mapper; `track` False leaves odometry as it is."""

    def __init__(self, record: DrivenRecord, config: ScanTrackingConfig) -> None:
        self._record, self._tracker = record, ScanTracker(config, LaserScans(), record.mount)
        self._assembler = SweepAssembler(SweepAssemblyConfig(), LaserScans(), record.mount)
        self._mapper = PoseGraphMapper(MappingConfig(), create_registration(RegistrationConfig()).match)
        self._estimates: dict[float, OdometryEstimate] = {}
        self._poses: list[TrackedPose] = []
        self.legs = Legs()

    def run(self) -> Legs:
        """Stop and go: every sweep is mapped, and the way since the last one looked at."""
        for tick in self._record.ticks:
            self._take(tick)
            while (sweep := self._assembler.poll()) is not None:
                self._mapped(sweep.stamp_s, sweep.points, sweep.origins)
        self.legs.counts = self._tracker.counts
        return self.legs

    def run_nodding(self, half_period_s: float) -> Legs:
        """Every half-period becomes a sweep, de-skewed by the tracked poses."""
        self.run_until_first_sweep()
        begin = self._poses[-1].stamp_s
        scans: list[tuple[float, Scan]] = []
        for tick in self._rest:
            self._take(tick)
            scans += tick.scans
            if self._poses and self._poses[-1].stamp_s > begin + half_period_s + 0.05:
                end = begin + half_period_s
                self._bent(begin, end)
                self._mapped(end, *self._assembled(scans, begin, end))
                scans = [one for one in scans if one[0] > end - 0.05]
                begin = end
        self.legs.counts = self._tracker.counts
        return self.legs

    def run_until_first_sweep(self) -> None:
        self._rest = iter(self._record.ticks)
        for tick in self._rest:
            self._take(tick)
            if (sweep := self._assembler.poll()) is not None:
                self._mapped(sweep.stamp_s, sweep.points, sweep.origins)
                return

    def _take(self, tick: Tick) -> None:
        begin_s = time.process_time()
        for stamp_s, tilt in tick.tilts:
            self._tracker.add_tilt(stamp_s, tilt)
        for estimate in tick.odometry:
            self._tracker.add_odometry(estimate.stamp_s, estimate.T_odom_base, speed=(estimate.twist[0], estimate.twist[5]))
        for stamp_s, scan in tick.scans:
            self._tracker.add_scan(stamp_s, scan)
        poses = self._tracker.advance(tick.stamp_s)
        if any(not estimate.standing for estimate in tick.odometry):
            self.legs.cpu_s += time.process_time() - begin_s
            self.legs.driven_s += 0.05
        self._estimates |= {estimate.stamp_s: estimate for estimate in tick.odometry}
        self._poses += poses
        for stamp_s, tilt in tick.tilts:
            self._assembler.add_joint(stamp_s, tilt)
        for pose in poses:
            self._assembler.add_odometry(pose.stamp_s, pose.T_odom_base)
        for stamp_s, scan in tick.scans:
            self._assembler.add_scan(stamp_s, scan)

    def _mapped(self, stamp_s: float, points: NDArray[np.floating], origins: NDArray[np.floating]) -> None:
        """The sweep becomes a vertex, and the area around it the tracker's map."""
        T_odom_base = _at(self._poses, stamp_s)
        if len(self._mapper.graph):
            self._looked_at(stamp_s)
        near = self._estimates[min(self._estimates, key=lambda at: abs(at - stamp_s))]
        gravity = gravity_of(near.T_odom_base, near.pose_covariance.ravel()) or ()
        update = self._mapper.add_sweep(stamp_s, points, origins, T_odom_base, *gravity)
        area = self._mapper.area_cloud(AREA_M)
        covariance = None
        T_map_base = self._mapper.graph.pose(update.vertex_id)
        if update.result is None:
            covariance = np.diag(FLOOR**2)
        elif update.match_used:
            turn = np.kron(np.eye(2), T_map_base[:3, :3])
            covariance = turn @ update.result.covariance[np.ix_(ROTATION_LAST, ROTATION_LAST)] @ turn.T + np.diag(FLOOR**2)
        assert area.normals is not None
        begin_s = time.process_time()
        self._tracker.set_map(area.points, area.normals, update.T_map_odom, covariance)
        self.legs.cpu_s += time.process_time() - begin_s
        self._last_s, self._T_map_vertex, self._T_map_odom = stamp_s, T_map_base, update.T_map_odom

    def _looked_at(self, stamp_s: float) -> None:
        """The drive since the last vertex, against the truth from there on."""
        poses = [pose for pose in self._poses if self._last_s < pose.stamp_s <= stamp_s]
        moving = [pose for pose in poses if not self._estimates[pose.stamp_s].standing]
        vertex, stamps = np.array([self._last_s]), np.array([pose.stamp_s for pose in poses])
        truth = inverse(self._record.truth_at(vertex)[0]) @ self._record.truth_at(stamps)
        by_stamp = {pose.stamp_s: T for pose, T in zip(poses, truth, strict=True)}
        for pose in moving[::2]:
            T_map_base, T_true = self._T_map_odom @ pose.T_odom_base, self._T_map_vertex @ by_stamp[pose.stamp_s]
            error = error_between(T_map_base, T_true)
            turn = np.kron(np.eye(2), self._T_map_odom[:3, :3])
            covariance = turn @ pose.covariance @ turn.T
            self.legs.nees.append(float(error[PLANE] @ np.linalg.solve(covariance[np.ix_(PLANE, PLANE)], error[PLANE])))
        if not moving:
            return
        last = poses[-1]
        T_true = self._T_map_vertex @ by_stamp[last.stamp_s]
        error = error_between(self._T_map_odom @ last.T_odom_base, T_true)
        begin = self._estimates[min(self._estimates, key=lambda at: abs(at - self._last_s))].T_odom_base
        plain = inverse(begin) @ self._estimates[last.stamp_s].T_odom_base
        plain_xy = float(np.linalg.norm((plain[:3, 3] - by_stamp[last.stamp_s][:3, 3])[:2]))
        self.legs.drift.append((float(np.linalg.norm(error[:2])), plain_xy, abs(float(error[5])), abs(float(error[2]))))

    def _bent(self, begin_s: float, end_s: float) -> None:
        """How far the tracked poses of a sweep are off, as seen from its middle: RMS over the sweep."""
        stamps = np.linspace(begin_s, end_s, 21)
        truth = self._record.truth_at(stamps)
        known = sorted(self._estimates)
        odometry = interpolate_transforms(known, np.array([self._estimates[at].T_odom_base for at in known]), stamps)
        tracked = np.array([_at(self._poses, at) for at in stamps])
        if np.linalg.norm(truth[0, :3, 3] - truth[-1, :3, 3]) > 0.2:
            self.legs.bend.append((_bend(tracked, truth), _bend(odometry, truth)))

    def _assembled(self, scans: list[tuple[float, Scan]], begin_s: float, end_s: float) -> tuple[Array, Array]:
        stamps = np.array([stamp for stamp, _ in scans])
        beams = LaserScans().beams(stamps, [scan for _, scan in scans], (begin_s, end_s), FreeBeams(1.0, 1 << 40))
        nodes = np.linspace(begin_s, end_s, round((end_s - begin_s) / NODE_S) + 1)
        poses = [pose for pose in self._poses if begin_s - 1.0 < pose.stamp_s < end_s + 1.0]
        T_odom_base = interpolate_transforms([pose.stamp_s for pose in poses], np.array([pose.T_odom_base for pose in poses]), nodes)
        tilts = [one for tick in self._record.ticks for one in tick.tilts if begin_s - 1.0 < one[0] < end_s + 1.0]
        laser = self._record.mount.base_from_laser(np.interp(nodes, *np.array(tilts).T))
        points, origins = along_nodes(nodes, inverse(T_odom_base[-1]) @ T_odom_base @ laser, beams.times_s, beams.hits)
        return points.astype(np.float64), origins.astype(np.float64)


def _at(poses: Sequence[TrackedPose], stamp_s: float) -> Array:
    near = [pose for pose in poses if abs(pose.stamp_s - stamp_s) < 0.3]
    stamps = np.array([pose.stamp_s for pose in near])
    found = interpolate_transforms(stamps, np.array([pose.T_odom_base for pose in near]), np.clip(stamp_s, stamps[0], stamps[-1]))
    return np.asarray(found[0])


def _bend(poses: Array, truth: Array) -> float:
    middle = len(poses) // 2
    off = (inverse(truth[middle]) @ truth)[:, :3, 3] - (inverse(poses[middle]) @ poses)[:, :3, 3]
    return float(np.sqrt((off**2).sum(axis=1).mean()))


def measured(request: DriveRequest, cache: Path, config: ScanTrackingConfig) -> Legs:
    """One drive."""
    drive = Drive(driven_record(request, cache), config)
    return drive.run() if request.stop_every_m else drive.run_nodding(request.half_period_s)


def row(world: str, mode: str, legs: Sequence[Legs]) -> list[object]:
    """A line of the table for all drives of a kind."""
    drift = np.array([one for leg in legs for one in leg.drift])
    bend = np.array([one for leg in legs for one in leg.bend])
    nees, driven = np.concatenate([leg.nees for leg in legs]), sum(leg.driven_s for leg in legs)
    refused, matched = (sum(leg.counts.get(f"bundle_{kind}", 0) for leg in legs) for kind in ("refused", "matched"))
    bent = [f"{100 * bend[:, 0].mean():.1f}", f"{100 * bend[:, 0].max():.1f}", f"{100 * bend[:, 1].mean():.1f}"] if len(bend) else ["-"] * 3
    return [
        Path(world).stem,
        mode,
        len(drift),
        f"{100 * drift[:, 0].mean():.1f}",
        f"{100 * drift[:, 0].max():.1f}",
        f"{100 * drift[:, 1].mean():.0f}",
        f"{100 * drift[:, 3].mean():.1f}",
        f"{100 * drift[:, 3].max():.1f}",
        f"{np.degrees(drift[:, 2].mean()):.2f}",
        f"{nees.mean():.1f}",
        f"{refused}/{refused + matched}",
        *bent,
        f"{1000 * sum(leg.cpu_s for leg in legs) / driven:.0f}",
    ]


def seeds_of(text: str) -> list[int]:
    """1-3,7 as [1, 2, 3, 7]."""
    return [s for part in text.split(",") for s in range(int(part.split("-")[0]), int(part.split("-")[-1]) + 1)]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", default="rooms,ramp,moon", help="names of worlds, or mesh files")
    parser.add_argument("--seeds", default="1-2")
    parser.add_argument("--modes", default="stop,nod", help="stop: level between standing sweeps; nod: sweeps while driving")
    parser.add_argument("--profile", default="", help="of the simulator, such as worse_odometry")
    parser.add_argument("--metres", type=float, default=30.0, help="length of a drive")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="a parameter of ScanTrackingConfig")
    parser.add_argument("--cache", type=Path, default=Path(tempfile.gettempdir()) / "driven_records")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    changes = {name: type(getattr(ScanTrackingConfig(), name))(float(value)) for name, _, value in (s.partition("=") for s in options.set)}
    config = load_config(ScanTrackingConfig, changes)
    overrides = read_profile(options.profile).get("pybullet_sim_node", {}) if options.profile else {}
    simulation = realistic(SimulationConfig, "hardware", overrides)
    rows = []
    for mode in options.modes.split(","):
        for world in options.worlds.split(","):
            requests = [
                DriveRequest(world, seed, options.metres, stop_every_m=10.0 if mode == "stop" else 0.0, simulation=simulation)
                for seed in seeds_of(options.seeds)
            ]
            rows.append(row(world, f"{mode} {options.profile}".strip(), [measured(one, options.cache, config) for one in requests]))
            print(*rows[-1], file=sys.stderr, flush=True)
    print(text_table(HEADER, rows))
    write_json(options.json, {"rows": [dict(zip(HEADER, r, strict=True)) for r in rows]})
    return 0


if __name__ == "__main__":
    sys.exit(main())
