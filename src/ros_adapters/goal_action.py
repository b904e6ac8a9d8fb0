"""move_base's goals: the action, and rviz's simple goal and clicked point, answered with a plan from make_plan."""

import math
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

import actionlib
import rospy
from geometry_msgs.msg import PointStamped, PoseStamped
from move_base_msgs.msg import MoveBaseAction, MoveBaseResult
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan

from rigid_geometry import transform_from_rpy
from ros_adapters.conversions import pose_message

if TYPE_CHECKING:
    from path_following import FollowerOutput
    from rigid_geometry.transforms import Transform

_MAKE_PLAN = "/octomap_server_3dnav_node/make_plan"
_TOLERANCE_M = 0.5


class GoalAction:
    """Action server move_base: asks for a plan, stores it, and reports what becomes of it. A new goal replaces the old one.

    It stands outside the lock-step chain: a goal by action comes from a person or another program, at any time.
    """

    def __init__(self, lock: threading.RLock, store: Callable[[Path], None]) -> None:
        self._lock = lock
        self._store = store
        self._active: actionlib.ServerGoalHandle | None = None
        self._make_plan = rospy.ServiceProxy(_MAKE_PLAN, GetPlan)
        self._server = actionlib.ActionServer("move_base", MoveBaseAction, self._on_goal, self._on_cancel, auto_start=False)
        self._server.start()

    def on_simple_goal(self, goal: PoseStamped) -> None:
        """A goal from rviz's tool, which knows no height: where the one given is no ground, the storey nearest to the robot is meant.

        ValueError when no plan leads there.
        """
        plan = self._plan_to(goal)
        if not plan.poses:
            goal.pose.position.z = math.nan
            plan = self._plan_to(goal)
        self._store(self._checked(plan, goal))

    def on_clicked_point(self, point: PointStamped, T_map_base: "Transform") -> None:
        """A point on the ground from rviz's tool, height and all; the robot is to look on the way it came. ValueError without a plan."""
        yaw = math.atan2(point.point.y - T_map_base[1, 3], point.point.x - T_map_base[0, 3])
        T = transform_from_rpy((point.point.x, point.point.y, point.point.z), (0.0, 0.0, yaw))
        goal = PoseStamped(point.header, pose_message(T))
        self._store(self._checked(self._plan_to(goal), goal))

    def _plan_to(self, goal: PoseStamped) -> Path:
        try:
            return self._make_plan(PoseStamped(), goal, _TOLERANCE_M).plan
        except rospy.ServiceException as error:
            raise ValueError(f"no plan to ({goal.pose.position.x:.2f}, {goal.pose.position.y:.2f}): {error}") from error

    def _checked(self, plan: Path, goal: PoseStamped) -> Path:
        if not plan.poses:
            at, frame = goal.pose.position, goal.header.frame_id
            raise ValueError(
                f"no plan to ({at.x:.2f}, {at.y:.2f}) in frame {frame!r}: no ground within {_TOLERANCE_M} m that the robot reaches"
            )
        return plan

    def _on_goal(self, handle: "actionlib.ServerGoalHandle") -> None:
        with self._lock:
            if self._active is not None:
                self._active.set_canceled(MoveBaseResult(), "replaced by a newer goal")
                self._active = None
            try:
                goal = handle.get_goal().target_pose
                self._store(self._checked(self._plan_to(goal), goal))
            except ValueError as error:
                handle.set_rejected(MoveBaseResult(), str(error))
                return
            handle.set_accepted()
            self._active = handle

    def _on_cancel(self, handle: "actionlib.ServerGoalHandle") -> None:
        with self._lock:
            if self._active is not None and handle.get_goal_id() == self._active.get_goal_id():
                self._store(Path())
                self._active.set_canceled(MoveBaseResult(), "cancelled")
                self._active = None

    def on_output(self, output: "FollowerOutput") -> None:
        """Ends the active goal when the follower has reached it or given it up."""
        if self._active is None:
            return
        if output.state.value == "reached":
            self._active.set_succeeded(MoveBaseResult(), output.reason)
            self._active = None
        elif output.state.value == "stuck":
            self._active.set_aborted(MoveBaseResult(), output.reason)
            self._active = None
