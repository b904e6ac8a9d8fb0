"""Odometry, tilts, readings and the map in, tracked poses out: bundle by bundle, each matched once all of it is there.

The tracked odometry frame goes on where odometry's would jump or drift: T_tracked_base = T_tracked_odom @ T_odom_base, and each bundle
moves T_tracked_odom a little. Inputs come in order within a topic and in any order between topics.
"""

import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mount_calibration import TiltDirection
from rigid_geometry import STAMP_TOLERANCE_S, StampedBuffer, as_covariance, as_transform, inverse, rotation_angle
from scan_tracking.alignment import MIN_POINTS
from scan_tracking.bundle import Bundle, Bundler, Motion, Samples
from scan_tracking.config import ScanTrackingConfig
from scan_tracking.estimate import Estimate
from scan_tracking.held_odometry import HeldOdometry
from scan_tracking.looks import Looks
from scan_tracking.pose_error import orthonormal, rotated_covariance
from scan_tracking.surroundings import Surroundings
from sweep_assembly import TiltGeometry
from sweep_assembly.beams import Sensor

Array = NDArray[np.float64]

_NOT_TOLD = math.nan, math.nan  # m/s and rad/s
_DISPLACED = "the robot was moved, and no sweep has told yet where it is"
_MOST_CONTRADICTED = 10  # bundles in a row that the map contradicts, a second of driving: nobody knows where the robot is
_DISPLACED_SIGMA_M = 5.0  # of the position where odometry knows nothing of the way, until a sweep tells
_DISPLACED_SIGMA_RAD = 1.8  # and of the heading: that of all headings


@dataclass(frozen=True, eq=False)
class TrackedPose:
    """Where base_link was at an odometry stamp, in the tracked odometry frame.

    `covariance` (6, 6) of its error against the map: x, y, z, rotation x, y, z, about the axes of the tracked frame, as in
    nav_msgs/Odometry. `refused`: why the last bundle was not believed, "" when it was, or there was nothing to match.
    """

    stamp_s: float
    T_odom_base: Array
    covariance: Array
    refused: str


@dataclass(frozen=True, eq=False)
class _Track:
    """The end of the last bundle: its stamp, odometry there, what is known of the tracked pose, and why it was refused."""

    stamp_s: float
    T_odom_base: Array
    estimate: Estimate
    refused: str = ""


class ScanTracker:
    """Keeps odometry on the map."""

    def __init__(self, config: ScanTrackingConfig, sensor: Sensor, mount: TiltGeometry) -> None:
        """For a sensor on a tilting mount; ValueError when the configuration is wrong."""
        problems = config.validate()
        if problems:
            raise ValueError("; ".join(problems))
        self._config, self._sensor, self._mount = config, sensor, mount
        self._bundler = Bundler(config, sensor, mount)
        self._backlash_rad = mount.calibration.backlash_rad
        self._counts: Counter[str] = Counter()
        self._held, self._looks = HeldOdometry(), Looks()
        self._around = Surroundings(config)
        self._T_tracked_odom: Array | None = None  # None: odometry as it is
        self._track: _Track | None = None
        self._newest: tuple[float, Array] | None = None
        self._displaced_s = -math.inf  # when odometry last knew nothing of the way
        self._contradicted = 0  # bundles in a row
        self._is_placed = True  # and whether a sweep has told since where the robot is
        self._longest_s = 0.0  # that a reading took so far
        self._reset()

    @property
    def counts(self) -> dict[str, int]:
        """How many bundles were matched or refused, and messages given up, by reason."""
        return dict(self._counts)

    @property
    def complete_until_s(self) -> float | None:
        """Up to here all has come that a bundle needs; None before that."""
        odometry, tilt, scan = self._odometry.last_stamp_s, self._tilts.last_stamp_s, self._scans.last_stamp_s
        if odometry is None or tilt is None or scan is None:
            return None
        return min(odometry, tilt, self._sensor.known_until(scan))

    def set_backlash(self, backlash_rad: float) -> None:
        """The mount's play from now on. ValueError when it can be none."""
        self._mount = self._mount.with_backlash(backlash_rad)
        self._bundler = Bundler(self._config, self._sensor, self._mount)
        self._backlash_rad, self._direction = backlash_rad, TiltDirection(backlash_rad)

    def set_map(
        self, points: ArrayLike, normals: ArrayLike, T_map_odom: ArrayLike, covariance: ArrayLike | None = None, swept_s: float = math.inf
    ) -> None:
        """Takes the surfaces around the robot, (N, 3) points and normals in map, and (4, 4) where the tracked odometry frame lies in it.

        `covariance`: (6, 6) of the match that has just placed the robot, about the axes of map: in directions that it leaves open, what
        was tracked stands. None: it stands in all. `swept_s`: when the sweep of that match ended; a robot that was displaced later is not
        placed by it, and is not matched to the map until one comes that does. ValueError for wrong shapes, what is not finite or rigid,
        and a map without normals; the old map stays then.
        """
        T = as_transform(T_map_odom)
        match = None if covariance is None else rotated_covariance(T[:3, :3].T, as_covariance(covariance))
        self._around.set_map(points, normals, T)
        if swept_s <= self._displaced_s:
            match = None
        self._is_placed = self._is_placed or match is not None
        if self._track is not None:
            self._track = replace(self._track, estimate=self._track.estimate.placed(match))

    def add_odometry(
        self, stamp_s: float, T_odom_base: ArrayLike, *, speed: tuple[float, float] = _NOT_TOLD, displaced: bool = False
    ) -> None:
        """Takes the (4, 4) pose of base_link at a time. What is not finite, not rigid, late or repeated is dropped and counted.

        A jump is no motion: the tracked pose stays where it was. Nor is what changes at a `speed` (m/s, rad/s) of 0 (`HeldOdometry`).
        `displaced`: odometry knows nothing of the way since the sample before.
        """
        try:
            pose = as_transform(T_odom_base)
        except ValueError:
            self._counts["odometry_not_rigid"] += 1
            return
        if not np.isfinite(stamp_s):
            self._counts["odometry_not_finite"] += 1
        elif self._odometry.takes(stamp_s, self._reset):
            pose = self._held.pose(stamp_s, pose, *speed)
            if self._track is None:
                self._begin(stamp_s, pose)
            elif self._jumped(stamp_s, pose):
                self._begin_again(stamp_s, pose)
            elif displaced:
                self._lose(_Track(stamp_s, pose, self._reached(pose)))
            self._newest = stamp_s, pose
            self._odometry.append(stamp_s, pose)
            self._due.append((stamp_s, pose))

    def add_tilt(self, stamp_s: float, tilt_rad: float) -> None:
        """Takes the mount's measured tilt. What is not finite, late or repeated is dropped and counted."""
        if not np.isfinite([stamp_s, tilt_rad]).all():
            self._counts["tilt_not_finite"] += 1
        elif self._tilts.takes(stamp_s, self._reset):
            self._tilts.append(stamp_s, (tilt_rad, self._direction.after(tilt_rad)))

    def add_scan(self, stamp_s: float, filtered: object) -> None:
        """Takes a filtered reading, of a laser a `Scan`, with the stamp of its first beam.

        ValueError for one of another sensor. What is not finite, late or repeated is dropped and counted.
        """
        reading = self._sensor.checked(filtered)
        if not np.isfinite(stamp_s):
            self._counts["scan_not_finite"] += 1
        elif self._scans.takes(stamp_s, self._reset):
            self._scans.append(stamp_s, reading)
            self._longest_s = max(self._longest_s, self._sensor.duration_of(reading))

    def advance(self, to_s: float) -> list[TrackedPose]:
        """A pose for every odometry sample up to `to_s` that has none yet, corrected by all bundles that are complete by now."""
        while (end := self._bundle_end()) is not None:
            self._finish_bundle(*end)
        poses = []
        while self._due and self._due[0][0] <= to_s + STAMP_TOLERANCE_S:
            poses.append(self._tracked(*self._due.pop(0)))
        return poses

    def _reset(self) -> None:
        config = self._config
        self._odometry: StampedBuffer[Array] = StampedBuffer("odometry", config.buffer_s, self._counts)
        self._tilts: StampedBuffer[tuple[float, float]] = StampedBuffer("tilt", config.buffer_s, self._counts)
        self._scans: StampedBuffer[Any] = StampedBuffer("scan", config.buffer_s, self._counts)
        self._direction = TiltDirection(self._backlash_rad)
        self._due: list[tuple[float, Array]] = []

    def _jumped(self, stamp_s: float, pose: Array) -> bool:
        """Whether odometry moved faster than the robot can, or time jumped back."""
        if self._newest is None:
            return False
        motion, passed_s = inverse(self._newest[1]) @ pose, max(stamp_s - self._newest[0], 0.0)
        too_far = float(np.linalg.norm(motion[:3, 3])) > self._config.most_speed_mps * passed_s
        return stamp_s < self._newest[0] or too_far or rotation_angle(motion) > self._config.most_turn_rps * passed_s

    def _begin(self, stamp_s: float, pose: Array) -> None:
        sigmas = np.repeat([self._config.start_sigma_m, self._config.start_sigma_rad], 3)
        self._track = _Track(stamp_s, pose, Estimate.of(pose, np.diag(sigmas**2)))
        self._looks.begin(pose)

    def _begin_again(self, stamp_s: float, pose: Array) -> None:
        """After a jump, at the tracked pose before it: the robot may have moved meanwhile."""
        assert self._newest is not None
        self._counts["odometry_jump"] += 1
        last_s, last = self._newest
        kept = self._reached(last)
        unseen_s = max(stamp_s - last_s, self._config.bundle_s)
        unseen = np.repeat([self._config.most_speed_mps, self._config.most_turn_rps], 3) * unseen_s
        to_new = pose @ inverse(last)
        self._due = [(at, to_new @ waiting) for at, waiting in self._due]
        self._odometry.clear()
        self._T_tracked_odom = orthonormal(kept.T @ inverse(pose))
        self._track = _Track(stamp_s, pose, kept.widened(unseen), "odometry jumped")

    def _lose(self, track: _Track) -> None:
        """The robot is anywhere from here on, as upright as odometry says."""
        sigmas = np.array([*[_DISPLACED_SIGMA_M] * 3, 0.0, 0.0, _DISPLACED_SIGMA_RAD])
        self._track = replace(track, estimate=track.estimate.widened(sigmas), refused=_DISPLACED)
        self._displaced_s, self._is_placed, self._contradicted = track.stamp_s, False, 0
        self._looks.renew()

    def _placed(self, T_odom_base: Array) -> Array:
        """(4, 4) the tracked pose of an odometry pose; odometry itself, to the bit, as long as nothing corrected it."""
        return T_odom_base if self._T_tracked_odom is None else orthonormal(self._T_tracked_odom @ T_odom_base)

    def _reached(self, T_odom_base: Array) -> Estimate:
        """What is known there, after what odometry adds since the last bundle."""
        assert self._track is not None
        return self._track.estimate.moved(self._placed(T_odom_base), self._config)

    def _tracked(self, stamp_s: float, T_odom_base: Array) -> TrackedPose:
        assert self._track is not None
        reached = self._reached(T_odom_base)
        return TrackedPose(stamp_s, reached.T, reached.covariance, self._track.refused)

    def _bundle_end(self) -> tuple[float, Array] | None:
        """Stamp and odometry at which the next bundle ends, once all of it is there or will not come."""
        newest_s = self._odometry.last_stamp_s
        if self._track is None or newest_s is None:
            return None
        stamps, poses = self._odometry.between(self._track.stamp_s + self._config.bundle_s - STAMP_TOLERANCE_S, newest_s)
        if not len(poses):
            return None
        complete_s = max(self.complete_until_s or -np.inf, newest_s - self._config.most_wait_s)
        return (float(stamps[0]), poses[0]) if stamps[0] <= complete_s + STAMP_TOLERANCE_S else None

    def _finish_bundle(self, end_s: float, T_odom_base: Array) -> None:
        track, prior = self._track, self._reached(T_odom_base)
        assert track is not None
        wanted = self._looks.wanted(T_odom_base, prior.covariance) and self._around.known and self._is_placed
        bundle = self._bundle(track, end_s) if wanted else None
        self._track = _Track(end_s, T_odom_base, prior, "" if self._is_placed else _DISPLACED)
        if isinstance(bundle, str):
            self._refuse(bundle)
        elif bundle is None:
            self._counts["bundle_nothing_to_match"] += 1
        else:
            self._match(bundle, self._track)
        self._odometry.forget_before(end_s)
        self._tilts.forget_before(end_s)
        self._scans.forget_before(end_s - self._longest_s)

    def _match(self, bundle: Bundle, track: _Track) -> None:
        found = self._around.match(bundle, track.estimate)
        self._track = replace(track, estimate=found.estimate)
        contradicts = bool(found.refused) and found.partners >= MIN_POINTS
        self._contradicted = self._contradicted + 1 if contradicts else 0
        if found.refused:
            self._refuse(found.refused)
            if self._contradicted >= _MOST_CONTRADICTED:
                self._counts["lost"] += 1
                self._lose(self._track)
            return
        self._counts["bundle_matched"] += 1
        self._looks.matched()
        self._T_tracked_odom = orthonormal(found.estimate.T @ inverse(track.T_odom_base))
        self._track = replace(track, estimate=replace(found.estimate, T=self._placed(track.T_odom_base)))

    def _refuse(self, reason: str) -> None:
        assert self._track is not None
        self._counts["bundle_refused"] += 1
        self._track = replace(self._track, refused=reason)

    def _bundle(self, track: _Track, end_s: float) -> Bundle | str | None:
        """None where there is nothing to match; a reason where it cannot be matched."""
        odometry, tilts = (Samples(s, np.array(v)) for s, v in (b.around(track.stamp_s, end_s) for b in (self._odometry, self._tilts)))
        stamps, readings = self._scans.between(track.stamp_s - self._longest_s, end_s)
        if not len(readings):
            return None
        if odometry.pause_s(track.stamp_s, end_s) > self._config.most_gap_s:
            return "odometry paused"
        if tilts.pause_s(track.stamp_s, end_s) > self._config.most_gap_s:
            return "no tilt of the mount"
        bundle = self._bundler.bundle(stamps, readings, (track.stamp_s, end_s), Motion(odometry, tilts))
        return bundle if len(bundle) else None
