"""move_base's goals: the action and the simple goal of rviz, answered with a plan from make_plan."""

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

import actionlib
import rospy
from geometry_msgs.msg import PoseStamped
from move_base_msgs.msg import MoveBaseAction, MoveBaseResult
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan

if TYPE_CHECKING:
    from path_following import FollowerOutput

_MAKE_PLAN = "/octomap_server_3dnav_node/make_plan"


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
        """A goal from rviz's tool; ValueError when no plan leads there."""
        self._plan_to(goal)

    def _plan_to(self, goal: PoseStamped) -> None:
        try:
            plan = self._make_plan(PoseStamped(), goal, 0.5).plan
        except rospy.ServiceException as error:
            raise ValueError(f"no plan to ({goal.pose.position.x:.2f}, {goal.pose.position.y:.2f}): {error}") from error
        if not plan.poses:
            raise ValueError(f"no plan to ({goal.pose.position.x:.2f}, {goal.pose.position.y:.2f})")
        self._store(plan)

    def _on_goal(self, handle: "actionlib.ServerGoalHandle") -> None:
        with self._lock:
            if self._active is not None:
                self._active.set_canceled(MoveBaseResult(), "replaced by a newer goal")
                self._active = None
            try:
                self._plan_to(handle.get_goal().target_pose)
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
