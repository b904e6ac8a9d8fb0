"""May the robot's outline move like this? Answers for one pose on one costmap."""

import enum
import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from path_following.free_way import MOVES, free_way, headings
from path_following.interface import CostGrid
from path_following.outline import DEEPER_M, INSCRIBED, LETHAL, UNKNOWN, beneath, cost_under, deepest, is_no_more
from path_following.reference_path import Pose
from path_following.trail import Trail
from rigid_geometry import slide_per_rad

_STEP_M, _STEP_RAD = 0.05, 0.1
_BESIDE_M = 0.02  # of room beside an arc, where there is so much: none is driven exactly
_GRAZED = 0.02  # of the outline's points: a cell of 8 cm at its border, in which the edge of a ramp lies


class Unknown(enum.IntEnum):
    """How a motion treats cells of which nothing is known."""

    ALLOWED = 0
    NOT_UNDER_THE_CENTRE = 1
    NOT_UNDER_THE_FOOTPRINT = 2


def footprint_lattice(length: float, width: float, spacing: float) -> NDArray[np.float64]:
    """(P, 2) points of base_link that cover a rectangle and its border, at most `spacing` metres apart."""
    x, y = (np.linspace(-side / 2, side / 2, math.ceil(side / spacing) + 1) for side in (length, width))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def arc_poses(pose: Pose, v_sign: float, curvature: float, length: float) -> NDArray[np.float64]:
    """(K, 3) poses x, y, yaw in map along an arc of `length` metres, forward or, with `v_sign` -1, backward."""
    x, y, yaw = pose
    travelled = v_sign * np.linspace(0.0, length, max(2, math.ceil(length / _STEP_M) + 1))
    turned = curvature * travelled
    chord = travelled * np.sinc(turned / (2 * math.pi))
    middle = yaw + turned / 2
    return np.column_stack([x + chord * np.cos(middle), y + chord * np.sin(middle), yaw + turned])


def turn_poses(pose: Pose, angle: float) -> NDArray[np.float64]:
    """(K, 3) poses x, y, yaw in map of a turn in place by `angle` radians, left positive."""
    turned = np.linspace(0.0, angle, max(2, math.ceil(abs(angle) / _STEP_RAD) + 1))
    return np.column_stack([np.full_like(turned, pose[0]), np.full_like(turned, pose[1]), pose[2] + turned])


@dataclass(frozen=True)
class Slide:
    """What a skid steer slides on a slope while it turns (`rigid_geometry.slide_per_rad`).

    `downhill_xy`: the horizontal part of the unit normal of the plane that it stands on, in map; `at_one_in_ten_m` as there.
    """

    downhill_xy: tuple[float, float]
    at_one_in_ten_m: float

    def along(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """(K, 3) poses of a motion with what it slides from the first one on."""
        turned = (np.diff(poses[:, 2]) + math.pi) % (2 * math.pi) - math.pi
        middle = poses[:-1, 2] + 0.5 * turned
        left = np.stack([-np.sin(middle), np.cos(middle)], axis=1)
        slid = poses.copy()
        slid[1:, :2] += np.cumsum((self.per_rad(middle) * np.abs(turned))[:, None] * left, axis=0)
        return slid

    def per_rad(self, yaw: NDArray[np.float64]) -> NDArray[np.float64]:
        """(K,) metres that it slides to its left for every radian, by its heading (K,) rad in map."""
        left = np.stack([-np.sin(yaw), np.cos(yaw)], axis=1)
        return slide_per_rad(left @ np.asarray(self.downhill_xy), self.at_one_in_ten_m)


LEVEL = Slide((0.0, 0.0), 0.0)


class Surroundings:
    """The costmap around the robot, asked whether a motion keeps the footprint off lethal cells and the centre off inscribed ones."""

    def __init__(
        self,
        costmap: CostGrid,
        footprint: NDArray[np.float64],
        turning_footprint: NDArray[np.float64],
        slide: Slide = LEVEL,
        trail: Trail | None = None,
    ) -> None:
        """Both footprints (P, 2) are points of base_link; the second, for turns on the spot, is the larger by what the robot drifts.

        `trail`: where the robot came from.
        """
        self._cost, self._footprint, self._turning_footprint = costmap.cost, footprint, turning_footprint
        self._ground = costmap.cost.copy()  # lethal and unknown cells as they are, without what is near
        if costmap.unknown is not None:
            self._ground[costmap.unknown & (self._cost != LETHAL)] = UNKNOWN
        self.slide, self._trail = slide, trail
        self._corner = np.array([costmap.origin_xy[0], costmap.origin_xy[1], costmap.resolution], dtype=np.float64)

    def contains(self, pose: Pose) -> bool:
        """True when the pose's cell lies in the costmap."""
        column, row = (math.floor((p - o) / self._corner[2] + 1e-9) for p, o in zip(pose[:2], self._corner[:2], strict=True))
        rows, columns = self._cost.shape
        return bool(0 <= row < rows and 0 <= column < columns)

    def is_known(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(N,) whether anything is known of the ground at (N, 2) points in map."""
        column, row = np.floor((points - self._corner[:2]) / self._corner[2] + 1e-9).astype(np.int64).T
        rows, columns = self._cost.shape
        inside = (row >= 0) & (column >= 0) & (row < rows) & (column < columns)
        known: NDArray[np.bool_] = inside.copy()
        known[inside] = self._ground[row[inside], column[inside]] != UNKNOWN
        return known

    def is_free(self, poses: NDArray[np.float64], unknown: Unknown) -> bool:
        """True when the robot, standing at the first of (K, 3) poses, may go through all of them, and slide meanwhile.

        What it touches already it may leave, but not touch more or deeper; a centre in an inscribed cell may leave, but not enter again.
        """
        return self._is_free(self.slide.along(poses), unknown)

    def _is_free(self, slid: NDArray[np.float64], unknown: Unknown) -> bool:
        return bool(_is_free(self._cost, self._ground, self._corner, self._footprint, slid, int(unknown)))

    def is_clear(self, poses: NDArray[np.float64]) -> bool:
        """The same for (K, 3) poses where every centimetre counts: it may touch nothing more than now, not by a point of its outline.

        But back the way that it came it may, as much as it does where it was, if that is no more than a cell's breadth: along a slope the
        cells of its edge lie deeper and less deep in the outline, and a robot that stands there must get out again.
        """
        poses = self.slide.along(poses)
        touched = self._touched(poses)
        if self._is_free(poses, Unknown.NOT_UNDER_THE_CENTRE) and touched.max() <= touched[0]:
            return True
        if self._trail is None or touched.max() > _GRAZED * len(self._footprint):
            return False
        had = self._trail.like(poses)
        if any(count and count > self._touched(there).max(initial=0) for count, there in zip(touched, had, strict=True)):
            return False
        new = poses[[not len(there) for there in had]]
        return not len(new) or self._is_free(new, Unknown.NOT_UNDER_THE_CENTRE)

    def _touched(self, poses: NDArray[np.float64]) -> NDArray[np.int64]:
        """(K,) points of the outline over lethal cells at (K, 3) poses."""
        return np.array([beneath(self._ground, self._corner, self._footprint, pose)[0] for pose in poses], dtype=np.int64)

    def is_free_turn(self, pose: Pose, angle: float, *, drifting: bool) -> bool:
        """True when the robot may turn on the spot by `angle` radians; `drifting`: with room around it for more than it slides."""
        poses = turn_poses(pose, angle)
        if drifting:
            return not any(beneath(self._ground, self._corner, self._turning_footprint, p)[0] for p in self.slide.along(poses))
        return self.is_free(poses, Unknown.ALLOWED)

    def has_room(self, pose: Pose) -> bool:
        """True when the robot may turn all around: nothing lethal and nothing unknown lies within its corners and a cell's breadth."""
        return max(beneath(self._ground, self._corner, self._room(), np.array(pose))) == 0

    def way_to_room(self, pose: Pose) -> list[tuple[float, float]]:
        """(metres, curvature 1/m) of arcs, backward where the metres are negative, to where it `has_room`; none where none lead there."""
        seen, start, aside, way = (self._ground, self._corner), np.array(pose), self.slide.per_rad(headings()), np.empty(0, np.int64)
        length, width = 2.0 * (self._footprint.max(axis=0) + _BESIDE_M)
        wide = footprint_lattice(float(length), float(width), _STEP_M)
        if beneath(*seen, wide, start)[0] == 0:
            way = free_way(*seen, wide, self._room(), start, aside)
        if not way.size:
            way = free_way(*seen, self._footprint, self._room(), start, aside)
        arcs: list[tuple[float, float]] = []
        for metres, curvature in MOVES[way].tolist():
            goes_on = bool(arcs) and arcs[-1][1] == curvature and arcs[-1][0] * metres > 0.0
            arcs.append((arcs.pop()[0] + metres, curvature) if goes_on else (metres, curvature))
        return arcs

    def _room(self) -> NDArray[np.float64]:
        """(P, 2) points of base_link within its corners and a cell's breadth."""
        radius = float(np.hypot(*self._footprint.T).max()) + 0.5 * self._corner[2]
        square = footprint_lattice(2.0 * radius, 2.0 * radius, _STEP_M)
        return np.ascontiguousarray(square[np.hypot(*square.T) <= radius])

    def mean_cost(self, poses: NDArray[np.float64]) -> float:
        """Mean cost under the centre along (K, 3) poses, 0..1, unknown counted as 1."""
        return float(_mean_cost(self._cost, self._corner, poses)) / UNKNOWN

    def cost_under(self, pose: Pose) -> int:
        """Cost under the centre; 255 outside."""
        return int(cost_under(self._cost, self._corner, pose[0], pose[1]))


@njit(cache=True)
def _is_free(
    cost: NDArray[np.uint8],
    ground: NDArray[np.uint8],
    corner: NDArray[np.float64],
    footprint: NDArray[np.float64],
    poses: NDArray[np.float64],
    unknown: int,
) -> bool:
    fewest, most_m = -1, deepest(ground, corner, footprint, poses[0]) + DEEPER_M
    may_stay_inside = True
    for k in range(poses.shape[0]):
        value = cost_under(cost, corner, poses[k, 0], poses[k, 1])
        if value == INSCRIBED or value == LETHAL or (value == UNKNOWN and unknown >= 1):
            if not may_stay_inside:
                return False
        else:
            may_stay_inside = False
        lethal, unseen = beneath(ground, corner, footprint, poses[k])
        count = lethal + (unseen if unknown >= 2 else 0)
        if fewest >= 0 and not is_no_more(count, fewest):
            return False
        if lethal > 0 and deepest(ground, corner, footprint, poses[k]) > most_m:
            return False
        fewest = count if fewest < 0 else min(fewest, count)
    return True


@njit(cache=True)
def _mean_cost(cost: NDArray[np.uint8], corner: NDArray[np.float64], poses: NDArray[np.float64]) -> float:
    total = 0
    for k in range(poses.shape[0]):
        total += cost_under(cost, corner, poses[k, 0], poses[k, 1])
    mean: float = total / poses.shape[0]
    return mean


@dataclass(frozen=True)
class _FreeFloor:
    """A costmap of one cell."""

    cost: NDArray[np.uint8]
    origin_xy: tuple[float, float] = (0.0, 0.0)
    resolution: float = 1.0
    unknown: NDArray[np.bool_] | None = None


def compile_kernels() -> None:
    """Compiles the kernels for the types that the follower passes, by asking once: a robot that drives does not wait for the compiler."""
    footprint, pose, cost = footprint_lattice(0.1, 0.1, 0.05), (0.5, 0.5, 0.0), np.zeros((1, 1), dtype=np.uint8)
    cost.setflags(write=False)  # as the costmap's are
    around = Surroundings(_FreeFloor(cost), footprint, footprint)
    around.is_clear(arc_poses(pose, 1.0, 0.0, 0.1))
    around.is_free_turn(pose, 0.1, drifting=True)
    around.mean_cost(turn_poses(pose, 0.1))
    around.cost_under(pose)
    around.way_to_room(pose)
