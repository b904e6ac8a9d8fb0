"""Whether what the messages say can be right: units, layout, frames, and a robot that stands while it is looked at."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_body import RobotBody
from sensor_checks.imu_units import ImuLimits, gravity_fault
from sensor_checks.limits import CheckLimits
from sensor_checks.rows import Level, Row, judged
from sensor_checks.wheel_twist import Pose, TwistWatch

FloatArray = NDArray[np.float64]
_REP_117 = "the driver should give inf where nothing is in range, and NaN where it does not know (REP 117)"
_FARTHEST_M = 1000.0  # no sensor ranges farther: more are millimetres
_RESTING_RAD = 0.05  # a mount that rests moves no more
_STANDING_RATE = 0.05  # [rad/s] a gyroscope that stands turns no faster: ten times a cheap one's bias, a tenth of it in degrees
_STANDING_MPS = 0.02  # wheels that stand turn no faster


@dataclass(frozen=True)
class ScanLayout:
    """Angles and times of a LaserScan as its message has them, and its range limits."""

    angle_min: float
    angle_increment: float
    time_increment: float
    count: int
    range_min: float
    range_max: float


def frame_row(topic: str, frames: set[str], expected: str) -> Row:
    """Whether all messages are of the one frame that robot.yaml names for the sensor."""
    found = ", ".join(sorted(repr(frame) for frame in frames))
    advice = f"robot.yaml has {expected!r}: set the driver's frame_id, or mounts/*/frame of robot.yaml"
    return judged(topic, "frame", found, ({frame.lstrip("/") for frame in frames} != {expected}, Level.ERROR, advice))


def imu_rows(topic: str, gyro_base: FloatArray, accel_base: FloatArray, frame: str, stands: bool, limits: ImuLimits) -> list[Row]:
    """Gravity and rates of (N, 3) samples that are turned into base_link; `stands`: by its wheels."""
    finite = np.isfinite(np.hstack([gyro_base, accel_base])).all(axis=1)
    if not finite.any():
        return [Row(Level.ERROR, topic, "values", "no sample is finite", "see the driver's output, and the cable")]
    gyro, accel = gyro_base[finite], accel_base[finite]
    rows = []
    if not finite.all():
        rows.append(Row(Level.WARN, topic, "values", f"{int((~finite).sum())} of {len(gyro_base)} are not finite", "these are dropped"))
    force = accel.mean(axis=0)
    fault = gravity_fault(force, frame, limits)
    rows.append(judged(topic, "gravity", f"{np.linalg.norm(force):.2f} m/s^2", (fault is not None, Level.ERROR, str(fault))))
    rate = float(np.linalg.norm(np.sqrt(np.mean(np.square(gyro), axis=0))))
    if stands:
        advice = "wheels stand: its rates are in deg/s, or its bias is large; let the driver publish rad/s and calibrate it"
        rows.append(judged(topic, "turning", f"{rate:.3f} rad/s", (rate > _STANDING_RATE, Level.ERROR, advice)))
    frozen = len(accel) > 20 and not np.ptp(np.hstack([gyro, accel]), axis=0).any()
    if frozen:
        rows.append(
            Row(Level.WARN, topic, "noise", "none: every sample is the same", "a real IMU has noise: see whether the driver still reads it")
        )
    return rows


def scan_rows(topic: str, layouts: Sequence[ScanLayout], ranges: Sequence[FloatArray], limits: CheckLimits) -> list[Row]:
    """Angles, times and ranges of scans; the fullest tells of the layout."""
    fullest = max(layouts, key=lambda layout: layout.count)
    counts = sorted({layout.count for layout in layouts})
    seen_rad = abs(fullest.angle_increment) * (fullest.count - 1)
    beams = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
    found = f"{beams} beams, {math.degrees(abs(fullest.angle_increment)):.3f} deg apart, over {math.degrees(seen_rad):.0f} deg"
    layout = judged(
        topic,
        "layout",
        found,
        (not math.isfinite(seen_rad) or seen_rad <= 0.0, Level.ERROR, "a scan needs two beams and an angle_increment"),
        (seen_rad > 2.01 * math.pi, Level.ERROR, "angle_increment is in degrees: let the driver publish radians (REP 103)"),
    )
    duration_s = fullest.time_increment * (fullest.count - 1)
    times = judged(
        topic,
        "beam times",
        f"{1000.0 * duration_s:.1f} ms a scan",
        (not duration_s >= 0.0, Level.ERROR, "time_increment must be zero or more seconds"),
        (duration_s > 1.0, Level.ERROR, "time_increment is not in seconds: see the driver"),
        (duration_s == 0.0, Level.WARN, "time_increment is 0: the tilt during a scan is not taken out; set it in the driver"),
    )
    return [layout, times, _ranges(topic, np.concatenate(ranges) if len(ranges) else np.zeros(0), fullest, limits)]


def _ranges(topic: str, ranges: FloatArray, layout: ScanLayout, limits: CheckLimits) -> Row:
    hits = ranges[np.isfinite(ranges) & (ranges > layout.range_min) & (ranges < layout.range_max)]
    share = len(hits) / max(len(ranges), 1)
    middle = f", half of them nearer than {np.median(hits):.2f} m" if len(hits) else ""
    finite = ranges[np.isfinite(ranges)]
    millimetres = layout.range_max > _FARTHEST_M or (len(finite) > 0 and float(np.median(finite)) > _FARTHEST_M)
    return judged(
        topic,
        "ranges",
        f"{100.0 * share:.0f} % hit something{middle}; limits {layout.range_min:g} to {layout.range_max:g} m",
        (millimetres, Level.ERROR, "ranges are in millimetres: let the driver publish metres (REP 103)"),
        (not layout.range_max > layout.range_min, Level.ERROR, "range_max must be above range_min: set both in the driver"),
        (
            1.0 - share > limits.blind_share,
            Level.ERROR,
            f"the laser sees nothing: is it covered, or are its range limits wrong? {_REP_117}",
        ),
    )


def points_rows(topic: str, points: Sequence[FloatArray], times_s: Sequence[FloatArray], rings: int, limits: CheckLimits) -> list[Row]:
    """Ranges and beam times of revolutions: (N, 3) points, (N,) seconds after the stamp. One without points tells nothing."""
    blind = "the lidar sees nothing: is it covered, or are its range limits wrong?"
    points, times_s = [p for p in points if len(p)], [t for t in times_s if len(t)]
    if not points:
        return [Row(Level.ERROR, topic, "ranges", "no revolution has a point", blind)]
    ranges = np.linalg.norm(np.vstack(points), axis=1)
    hits = ranges[np.isfinite(ranges) & (ranges > 0.0)]
    share = len(hits) / len(ranges)
    middle = float(np.median(hits)) if len(hits) else math.nan
    span_s = max(float(np.ptp(t)) for t in times_s)
    end_s = max(float(np.max(t)) for t in times_s)
    return [
        judged(
            topic,
            "ranges",
            f"{100.0 * share:.0f} % of {len(ranges) // len(points)} beams hit something, half of them nearer than {middle:.2f} m",
            (middle > _FARTHEST_M, Level.ERROR, "points are in millimetres: let the driver publish metres (REP 103)"),
            (1.0 - share > limits.blind_share, Level.ERROR, blind),
        ),
        judged(
            topic,
            "beam times",
            f"{1000.0 * span_s:.1f} ms a revolution, {rings} rings",
            (span_s > 1.0, Level.ERROR, "the points' times are not in seconds: see docs/sensors.md for the fields that are read"),
            (span_s == 0.0, Level.WARN, "all points have one time: motion during a revolution is not taken out; see docs/sensors.md"),
            (end_s <= 0.0, Level.WARN, "the stamp is that of the last beam: set the driver to that of the first (timestamp_first_packet)"),
        ),
    ]


def tilt_rows(topic: str, tilts: FloatArray, joint: str, limits: CheckLimits) -> list[Row]:
    """(N,) samples of the tilting joint; the mount rests while it is looked at."""
    if not len(tilts):
        return [
            Row(Level.ERROR, topic, "tilt", f"no joint {joint}", f"the mount's driver must publish {joint}, or the URDF must have its name")
        ]
    finite = tilts[np.isfinite(tilts)]
    if not len(finite):
        return [Row(Level.ERROR, topic, "tilt", "no position is finite", "see the mount's driver")]
    middle, moved = float(np.median(finite)), float(np.ptp(finite))
    return [
        judged(
            topic,
            "tilt",
            f"{joint} at {middle:.3f} rad, moves by {moved:.3f} rad",
            (abs(middle) > 2.0 * math.pi, Level.ERROR, "the joint is in degrees: let its driver publish radians (REP 103)"),
            (moved > _RESTING_RAD, Level.WARN, "the mount moves: look at a robot that stands, with no sweep under way"),
            (
                abs(middle) > limits.level_rad,
                Level.ERROR,
                f"no sweep ends unless the laser rests within {limits.level_rad:g} rad of 0: zero the joint, "
                "or raise horizontal_tolerance_rad of sweep_assembler_node and scan_filter_node",
            ),
        )
    ]


def senders_row(topic: str, senders: set[str], joint: str) -> Row:
    """Whether one node alone sends the tilting joint."""
    advice = "the tilts of both are mixed: end the others, or take the joint from them (source_list of a joint_state_publisher)"
    return judged(topic, "sender", f"{joint} by {', '.join(sorted(senders))}", (len(senders) > 1, Level.ERROR, advice))


def wheel_rows(topic: str, velocities: FloatArray, robot: RobotBody) -> list[Row]:
    """(N, 2) forward velocity and yaw rate by the wheels."""
    if not np.isfinite(velocities).all():
        return [Row(Level.ERROR, topic, "values", "not all velocities are finite", "see the base's driver")]
    forward, turning = np.abs(velocities).max(axis=0)
    too_fast = forward > 2.0 * robot.max_speed_mps or turning > 4.0 * robot.max_turn_rate_radps
    return [
        judged(
            topic,
            "velocity",
            f"up to {forward:.3f} m/s and {turning:.3f} rad/s",
            (too_fast, Level.ERROR, f"{robot.name} cannot drive so fast: publish m/s and rad/s, or correct max_speed_mps of robot.yaml"),
            (not stands(velocities), Level.WARN, "the robot moves: look at one that stands; units are judged by it"),
        )
    ]


def twist_rows(topic: str, messages: Sequence[tuple[float, Pose, tuple[float, float]]]) -> list[Row]:
    """The row of a twist that is not filled, of (stamp, pose, twist) as `TwistWatch` takes them; none where the pose shows no motion."""
    watch = TwistWatch()
    faults = [fault for message in messages if (fault := watch.fault(*message))]
    return [Row(Level.ERROR, topic, "twist", "0, and its pose moves", faults[0])] if faults else []


def stands(velocities: FloatArray) -> bool:
    """Whether the wheels stood all the time; without any it is not known, hence False."""
    return bool(len(velocities)) and bool((np.abs(velocities) <= [_STANDING_MPS, _STANDING_RATE]).all())
