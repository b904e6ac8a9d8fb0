"""move_base's goals: the action, and rviz's simple goal and clicked point, answered with a path from plan_path."""

import math
import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import actionlib
import rospy
from actionlib_msgs.msg import GoalID
from explore_3dnav.srv import PlanPath
from geometry_msgs.msg import PointStamped, PoseStamped
from move_base_msgs.msg import MoveBaseAction, MoveBaseResult
from nav_msgs.msg import Path
from std_msgs.msg import Header

from rigid_geometry import transform_from_rpy
from ros_adapters.conversions import pose_message
from ros_adapters.frames import frames

if TYPE_CHECKING:
    from path_following import FollowerOutput
    from rigid_geometry.transforms import Transform

_PLAN_PATH = "/octomap_server_3dnav_node/plan_path"
_TOLERANCE_M = 0.5
_GIVEN_UP = ("stuck", "blocked")


class GoalAction:
    """Action server move_base: asks for a path, stores it, and reports what becomes of it. A new goal replaces the old one.

    A goal stays the robot's until it is reached or given up: what exploration decides after a sweep on the way there comes later.
    It stands outside the lock-step chain: a goal comes from a person or another program, at any time.
    """

    def __init__(
        self,
        lock: threading.RLock,
        store: Callable[[Path, Sequence[bool]], None],
        pose: "Callable[[], Transform | None]",
        in_map: Callable[[PoseStamped], PoseStamped],
    ) -> None:
        """`store` takes a plan and where it is driven straight; `pose` tells where the robot is in map, None when that is not known.

        `in_map` turns a goal of any frame into one in map; ValueError when it cannot.
        """
        self._lock, self._store, self._pose, self._in_map = lock, store, pose, in_map
        self._active: actionlib.ServerGoalHandle | None = None
        self._goal: PoseStamped | None = None
        self._is_whole = False
        self._plan_path = rospy.ServiceProxy(_PLAN_PATH, PlanPath)
        self._server = actionlib.ActionServer("move_base", MoveBaseAction, self._on_goal, self._on_cancel, auto_start=False)
        self._server.lock = lock  # one lock for both: the server calls us under its own, and we call it under ours
        self._server.start()
        rospy.on_shutdown(self._end)  # these hooks come before the one that closes the topics

    def _end(self) -> None:
        """Before the topics close: the server's own timer would publish to one that is closed."""
        with self._lock:
            self._server.started = False

    def on_simple_goal(self, goal: PoseStamped) -> None:
        """A goal from rviz's tool, which knows no height: where the one given is no ground, the storey nearest to the robot is meant.

        ValueError when no path leads there.
        """
        goal = self._in_map(goal)
        try:
            self._take(goal, None)
        except ValueError:
            goal.pose.position.z = math.nan
            self._take(goal, None)

    def on_clicked_point(self, point: PointStamped) -> None:
        """A point on the ground from rviz's tool, height and all; the robot is to look on the way it came. ValueError without a path."""
        here, goal = self._known_pose(), PoseStamped(header=point.header)
        goal.pose.position, goal.pose.orientation.w = point.point, 1.0
        goal = self._in_map(goal)
        at = goal.pose.position
        goal.pose = pose_message(transform_from_rpy((at.x, at.y, at.z), (0.0, 0.0, math.atan2(at.y - here[1, 3], at.x - here[0, 3]))))
        self._take(goal, None)

    def on_cancel_topic(self, cancelled: GoalID) -> None:
        """/move_base/cancel also ends a simple goal, which is no goal of the action's; one that names another goal does not."""
        if not cancelled.id and self._active is None and self._goal is not None:
            self._store(Path(), [])
            self._goal = None

    def goes_on(self) -> bool:
        """Stores a path to the goal that the robot has, from where it is now; False when it has none, or no path leads there any more."""
        if self._goal is None:
            return False
        try:
            self._drive_to(self._goal)
        except ValueError as error:
            self.give_up(str(error))
            return False
        return True

    def give_up(self, reason: str) -> None:
        """Forgets the goal, and ends the action's."""
        self._goal = None
        if self._active is not None:
            self._active.set_aborted(MoveBaseResult(), reason)
            self._active = None

    def on_output(self, output: "FollowerOutput") -> None:
        """Ends the goal when the follower has reached it or given it up; after a part of the way the next sweep is waited for."""
        if self._goal is not None and output.state.value in _GIVEN_UP:
            self.give_up(output.reason)
        elif self._goal is not None and output.state.value == "reached" and self._is_whole:
            self._goal = None
            if self._active is not None:
                self._active.set_succeeded(MoveBaseResult(), output.reason)
                self._active = None

    def _known_pose(self) -> "Transform":
        T_map_base = self._pose()
        if T_map_base is None:
            raise ValueError("a goal was given before the robot knows where it is")
        return T_map_base

    def _drive_to(self, goal: PoseStamped) -> None:
        """Stores a path to a goal, or the first part of one. ValueError when there is none."""
        at, start = goal.pose.position, PoseStamped(Header(frame_id=frames().map), pose_message(self._known_pose()))
        try:
            answer = self._plan_path(start, goal, _TOLERANCE_M)
        except rospy.ServiceException as error:
            raise ValueError(f"no plan to ({at.x:.2f}, {at.y:.2f}): {error}") from error
        if not answer.plan.poses:
            frame = goal.header.frame_id
            raise ValueError(
                f"no plan to ({at.x:.2f}, {at.y:.2f}) in frame {frame!r}: no ground within {_TOLERANCE_M} m that the robot reaches"
            )
        self._store(answer.plan, answer.straight)
        self._goal, self._is_whole = goal, answer.whole

    def _take(self, goal: PoseStamped, handle: "actionlib.ServerGoalHandle | None") -> None:
        """Drives to a goal in place of the one before, which stays when there is no path to the new one: ValueError."""
        self._drive_to(goal)
        if self._active is not None:
            self._active.set_canceled(MoveBaseResult(), "replaced by a newer goal")
        self._active = handle

    def _on_goal(self, handle: "actionlib.ServerGoalHandle") -> None:
        with self._lock:
            try:
                self._take(self._in_map(handle.get_goal().target_pose), handle)
            except ValueError as error:
                handle.set_rejected(MoveBaseResult(), str(error))
                return
            handle.set_accepted()

    def _on_cancel(self, handle: "actionlib.ServerGoalHandle") -> None:
        with self._lock:
            if self._active is not None and handle.get_goal_id() == self._active.get_goal_id():
                self._store(Path(), [])
                self._active.set_canceled(MoveBaseResult(), "cancelled")
                self._active = self._goal = None
