"""Where robot.yaml and the robot description contradict each other."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import rotation_angles, transform_from_rpy, translation_distance
from robot_body.body import RobotBody
from robot_body.mounts import SensorMount
from robot_body.urdf import BASE, Description, read_description
from robot_body.wheels import casters, driven_wheels

Array = NDArray[np.float64]

_SAME_M, _SAME_RAD = 1e-3, 1e-3
_MOST_AROUND_M = 0.05  # by so much an outline may be larger than the shapes: cables, and a laser that tilts up


def contradictions(robot: RobotBody, text: str, folder: Path | None = None) -> list[str]:
    """Where robot.yaml and a URDF, which lies in a folder, say different things, a sentence each; what the URDF has not contradicts
    nothing."""
    try:
        description = read_description(text, folder)
        return [*_of_wheels(robot, description), *_of_outline(robot, description), *_of_mounts(robot, description)]
    except ValueError as error:
        return [str(error)]


def _differing(name: str, ours_m: float, theirs_m: float) -> Iterator[str]:
    if abs(ours_m - theirs_m) > _SAME_M:
        yield f"{name} = {ours_m:.4g}, and the URDF has {theirs_m:.4g}"


def _of_wheels(robot: RobotBody, description: Description) -> Iterator[str]:
    wheels = driven_wheels(description)
    if not wheels:
        return
    places = np.array([wheel.xyz_m for wheel in wheels])
    yield from _differing("wheel_radius_m", robot.wheel_radius_m, wheels[0].radius_m)
    yield from _differing("wheel_width_m", robot.wheel_width_m, wheels[0].width_m)
    yield from _differing("track_m", robot.track_m, float(np.ptp(places[:, 1])))
    yield from _differing("wheelbase_m", robot.wheelbase_m, float(np.ptp(places[:, 0])))
    yield from _differing("base_height_m", robot.base_height_m, -min(wheel.lowest_m for wheel in wheels))


def _of_outline(robot: RobotBody, description: Description) -> Iterator[str]:
    if any(shape.is_missing for shapes in description.shapes.values() for shape in shapes):
        return
    reached = {link: reach for link in description.shapes if description.hangs_on_base(link) and (reach := description.reach(link))}
    if not reached:
        return
    low, high = np.min([r[0] for r in reached.values()], axis=0), np.max([r[1] for r in reached.values()], axis=0)
    half = np.maximum(-low, high)
    yield from _too_small_or_large("length_m", robot.length_m, 2 * float(half[0]))
    yield from _too_small_or_large("width_m", robot.width_m, 2 * float(half[1]))
    yield from _too_small_or_large("height_m", robot.height_m, robot.base_height_m + float(high[2]))
    standing = {wheel.link for wheel in driven_wheels(description)} | {caster.link for caster in casters(description)}
    belly = [float(reach[0][2]) for link, reach in reached.items() if link not in standing]
    if belly and robot.ground_clearance_m > robot.base_height_m + min(belly) + _SAME_M:
        yield f"ground_clearance_m = {robot.ground_clearance_m:.4g}, and the URDF has {robot.base_height_m + min(belly):.4g}"


def _too_small_or_large(name: str, ours_m: float, theirs_m: float) -> Iterator[str]:
    if not -_SAME_M <= ours_m - theirs_m <= _MOST_AROUND_M:
        yield f"{name} = {ours_m:.4g}, and the shapes of the URDF take {theirs_m:.4g}; it may be more by up to {_MOST_AROUND_M:g}"


def _of_mounts(robot: RobotBody, description: Description) -> Iterator[str]:
    for mount in robot.mounts:
        joint = description.joints.get(mount.frame)
        if mount.xyz_m is None or mount.rpy_rad is None:
            if joint is None and mount.frame != BASE:
                yield f"mounts/{mount.sensor}: the URDF has no frame {mount.frame}"
        elif joint is None:
            if mount.parent != BASE and mount.parent not in description.joints:
                yield f"mounts/{mount.sensor}: the URDF has no frame {mount.parent}"
        elif joint.parent != mount.parent:
            yield f"mounts/{mount.sensor}: {mount.frame} is mounted on {mount.parent}, and in the URDF on {joint.parent}"
        else:
            yield from _pose_differing(mount, transform_from_rpy(mount.xyz_m, mount.rpy_rad), joint.T_parent_child)


def _pose_differing(mount: SensorMount, ours: Array, theirs: Array) -> Iterator[str]:
    off_m = translation_distance(ours, theirs)
    off_rad = float(rotation_angles((ours[:3, :3].T @ theirs[:3, :3])[None])[0])
    if off_m > _SAME_M or off_rad > _SAME_RAD:
        yield f"mounts/{mount.sensor}: {mount.frame} is {off_m:.4g} m and {off_rad:.4g} rad from where the URDF has it"
