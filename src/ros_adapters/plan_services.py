"""make_plan and plan_path: paths over the ground of the newest terrain, for whoever asks."""

import math

import numpy as np
from explore_3dnav.srv import PlanPath, PlanPathRequest, PlanPathResponse
from geometry_msgs.msg import PoseStamped
from nav_msgs.srv import GetPlan, GetPlanRequest, GetPlanResponse

from octomap_server_3dnav.exploration.approach import Approach
from octomap_server_3dnav.exploration.decide import Explorer
from octomap_server_3dnav.navigation.passages import place_of
from octomap_server_3dnav.navigation.planner import Path, nearest_traversable, plan_path
from octomap_server_3dnav.terrain.classify import Terrain
from rigid_geometry import rotation_from_quat, yaw_of
from ros_adapters.conversions import path_message, transform_from_pose
from ros_adapters.frames import frames
from ros_adapters.node import Node
from ros_adapters.tf_lookup import TransformsWhenAsked

_NOT_MOVED_M = 0.3


class PlanServices:
    """Answers by the terrain that it was shown last, without the node's lock: who asks may be who the node waits for."""

    def __init__(self, node: Node, explorer: Explorer, transforms: TransformsWhenAsked) -> None:
        """Serves ~make_plan and ~plan_path, with the explorer's configurations."""
        self._explorer, self._transforms = explorer, transforms
        self._approach = Approach(explorer.config, explorer.planner_config.trim_m)  # how far the robot may drive before it is swept again
        node.serve("~make_plan", GetPlan, self.make_plan)
        node.serve("~plan_path", PlanPath, self.plan_path)
        self._newest: tuple[float, Terrain] | None = None
        self._why_none = "no sweep is in the map yet"

    def know(self, stamp_s: float, terrain: Terrain) -> None:
        """The terrain of a map from now on."""
        self._newest = stamp_s, terrain

    def forget(self, why: str) -> None:
        """No terrain is known any more, and why."""
        self._newest, self._why_none = None, why

    def make_plan(self, request: GetPlanRequest) -> GetPlanResponse:
        """A path to the ground nearest the goal, from the robot or from the ground nearest the start; empty when there is none.

        Start and goal may be in any frame that tf knows. A goal without a rotation is looked at along the path, as move_base lets one ask.
        """
        stamp_s, terrain = self._known()
        from_robot = not request.start.header.frame_id
        has_heading = any(getattr(request.goal.pose.orientation, axis) for axis in "xyzw")
        if not has_heading:
            request.goal.pose.orientation.w = 1.0
        request.goal = self._transforms.in_map(request.goal)
        request.start = request.start if from_robot else self._transforms.in_map(request.start)
        path = self._path(terrain, request, from_robot=from_robot)
        if path is None:
            return GetPlanResponse()
        yaw = _yaw_of(request.goal) if has_heading else _last_heading(path.points)
        return GetPlanResponse(path_message(stamp_s, frames().map, path.points, yaw))

    def plan_path(self, request: PlanPathRequest) -> PlanPathResponse:
        """The same up to the next passage that the robot has to be swept before, as in exploration, and where it leads through one."""
        self._explorer.overrule()  # somebody's goal comes first
        stamp_s, terrain = self._known()
        _check_in_map(request.start)
        T_map_base = transform_from_pose(request.start.pose)
        moved_m = math.dist(T_map_base[:3, 3], terrain.robot_xyz)
        path = self._path(terrain, request, from_robot=moved_m <= _NOT_MOVED_M)
        if path is None:
            return PlanPathResponse()
        self._approach.configure(self._explorer.config, self._explorer.planner_config.trim_m)
        part, yaw, is_whole = self._approach.towards(path, T_map_base, _yaw_of(request.goal))
        straight = [] if part.straight is None else part.straight.tolist()
        return PlanPathResponse(path_message(stamp_s, frames().map, part.points, yaw), straight, is_whole)

    def _known(self) -> tuple[float, Terrain]:
        if self._newest is None:
            raise ValueError(self._why_none)
        return self._newest

    def _path(self, terrain: Terrain, request: GetPlanRequest | PlanPathRequest, from_robot: bool) -> Path | None:
        """From where the robot was swept last, or from the ground nearest the start."""
        goal = _ground_at(terrain, request.goal, request.tolerance)
        if why := _why_closed(terrain, request.goal):
            raise ValueError(f"the goal at {why}")
        source = None if from_robot else _ground_at(terrain, request.start, request.tolerance)
        if goal is None or (source is None and not from_robot):
            return None
        return plan_path(terrain, goal, self._explorer.planner_config, source)


def _ground_at(terrain: Terrain, pose: PoseStamped, tolerance_m: float) -> int | None:
    """The node of reachable ground nearest to a pose. ValueError for a frame that is not the map's, and for what is no number."""
    _check_in_map(pose)
    xyz = pose.pose.position
    if not (math.isfinite(xyz.x) and math.isfinite(xyz.y)):
        raise ValueError(f"a pose at ({xyz.x}, {xyz.y}), which are no numbers")
    return nearest_traversable(terrain, (xyz.x, xyz.y, xyz.z), tolerance_m)


def _why_closed(terrain: Terrain, pose: PoseStamped) -> str:
    """Why the robot may not be there, as words; a height that is not known is its own."""
    at = pose.pose.position
    return terrain.zones.why_closed((at.x, at.y, place_of(terrain)[2] if math.isnan(at.z) else at.z))


def _check_in_map(pose: PoseStamped) -> None:
    if pose.header.frame_id.lstrip("/") != frames().map:
        raise ValueError(f"a pose in frame {pose.header.frame_id!r}, expected {frames().map!r}")


def _last_heading(points: np.ndarray) -> float:
    """Along the end of a path; 0 where it has no length."""
    dx, dy = points[-1, :2] - points[max(0, len(points) - 2), :2]
    return math.atan2(dy, dx)


def _yaw_of(pose: PoseStamped) -> float:
    q = pose.pose.orientation
    return yaw_of(rotation_from_quat(q.x, q.y, q.z, q.w))
