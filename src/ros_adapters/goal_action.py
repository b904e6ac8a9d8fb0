"""move_base's goals: the action, and rviz's simple goal and clicked point, answered with a path from plan_path."""

import copy
import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING

import actionlib
import rospy
from actionlib_msgs.msg import GoalID
from explore_3dnav.srv import PlanPath
from geometry_msgs.msg import PointStamped, Pose, PoseStamped, Quaternion
from move_base_msgs.msg import MoveBaseAction, MoveBaseActionGoal, MoveBaseFeedback, MoveBaseGoal, MoveBaseResult
from nav_msgs.msg import Path
from std_msgs.msg import Header

from path_following.patience import PATIENCE_S, Patience
from rigid_geometry import transform_from_rpy
from ros_adapters.asking import NO_ANSWER, waiting_for
from ros_adapters.conversions import header, pose_message, transform_from_pose
from ros_adapters.frames import frames
from ros_adapters.service_errors import reason_of

if TYPE_CHECKING:
    from path_following import FollowerOutput
    from rigid_geometry.transforms import Transform

_PLAN_PATH = "octomap_server_3dnav_node/plan_path"
_TOLERANCE_M = 0.5
_GIVEN_UP = ("stuck", "blocked")
_MOMENT_S = 0.1
_SIMPLE, _CLICKED = "move_base_simple/goal", "clicked_point"
_LEAST_QUATERNION = 1e-3  # move_base's: a shorter one is no rotation, any other is made a unit


@dataclass(frozen=True)
class GoalDriving:
    """What goals need of the node: `store` takes a plan and where it is driven straight. `stand` has the robot stand for a reason until the
    next plan, `stop` until the next goal.

    `pose` tells where the robot is in map, None when that is not known. `in_map` turns a goal of any frame into one in map; ValueError when
    it cannot. `began` and `refused` are told of each goal in map, and of why one is not driven to.
    """

    store: Callable[[Path, Sequence[bool]], None]
    stand: Callable[[str], None]
    stop: Callable[[str], None]
    pose: "Callable[[], Transform | None]"
    in_map: Callable[[PoseStamped], PoseStamped]
    began: Callable[[PoseStamped], None]
    refused: Callable[[str], None]


class GoalAction:
    """Action server move_base: asks for a path, stores it, and reports what becomes of it. A new goal replaces the old one.

    As move_base, it accepts every goal, and aborts what it cannot drive to; then the goal before stays. Simple goals and clicked points
    are goals of the action, too: who lists or cancels goals finds them. A goal stays the robot's until it is reached, cancelled or
    given up, as after 30 s in which the robot was free to drive and got nowhere: what exploration decides on the way comes later.
    It stands outside the lock-step chain: a goal comes from a person or another program, at any time.
    """

    def __init__(self, lock: threading.RLock, driving: GoalDriving) -> None:
        self._lock, self._driving = lock, driving
        self._active: actionlib.ServerGoalHandle | None = None
        self._goal: PoseStamped | None = None  # of the active one, in map
        self._is_whole = False
        self._patience = Patience()
        self._numbers = count(1)
        self._plan_path = rospy.ServiceProxy(_PLAN_PATH, PlanPath)
        self._server = actionlib.ActionServer("move_base", MoveBaseAction, self._on_goal, self._on_cancel, auto_start=False)
        self._server.lock = lock  # one lock for both: the server calls us under its own, and we call it under ours
        self._server.start()
        rospy.on_shutdown(self._end)  # these hooks come before the one that closes the topics

    def _end(self) -> None:
        """Before the topics close: the server's own timer would publish to one that is closed."""
        with self._lock:
            self._server.started = False

    @property
    def is_active(self) -> bool:
        """Whether the robot has a goal of the user's."""
        return self._active is not None

    def on_simple_goal(self, goal: PoseStamped) -> None:
        """A goal from rviz's tool, which knows no height: where the one given is no ground, the storey nearest to the robot is meant."""
        self._submit(_SIMPLE, goal)

    def on_clicked_point(self, point: PointStamped) -> None:
        """A point on the ground from rviz's tool, height and all; the robot is to look on the way it came."""
        goal = PoseStamped(header=point.header)
        goal.pose.position, goal.pose.orientation.w = point.point, 1.0
        self._submit(_CLICKED, goal)

    def _submit(self, source: str, goal: PoseStamped) -> None:
        """As a goal of the action whose id tells where it came from."""
        goal_id = GoalID(id=f"{source}-{next(self._numbers)}")
        self._server.internal_goal_callback(MoveBaseActionGoal(goal.header, goal_id, MoveBaseGoal(goal)))

    def goes_on(self) -> bool:
        """Stores a path to the goal that the robot has, from where it is now; False when it has none, or no path leads there any more."""
        if self._goal is None:
            return False
        try:
            self._is_whole = self._drive_to(self._goal)
        except ValueError as error:
            self.give_up(str(error))
            return False
        return True

    def give_up(self, reason: str) -> None:
        """Aborts the goal, if there is one."""
        if self._active is not None:
            self._active.set_aborted(MoveBaseResult(), reason)
        self._active = self._goal = None

    def replace(self, reason: str) -> None:
        """Preempts the goal, if there is one: something else is driven to."""
        if self._active is not None:
            self._active.set_canceled(MoveBaseResult(), reason)
        self._active = self._goal = None

    def on_output(self, stamp_s: float, output: "FollowerOutput", *, is_held: bool) -> None:
        """Feedback, and the goal's end when the follower has reached it or given it up; after a part of the way a sweep is waited for.

        is_held: somebody keeps the robot's wheels from turning.
        """
        if self._active is None:
            return
        if output.state.value in _GIVEN_UP:
            self.give_up(output.reason)
            self._driving.stand(f"the goal was given up: {output.reason}")  # exploration's own goal has not failed
        elif output.state.value == "reached" and self._is_whole:
            self._active.set_succeeded(MoveBaseResult(), output.reason)
            self._active = self._goal = None
        elif self._gets_nowhere(stamp_s, is_held=is_held):
            self.give_up(f"no progress for {PATIENCE_S:.0f} s: {output.reason}")
            self._driving.stand("the goal was given up: the robot got nowhere")
        else:
            self._tell_position(stamp_s)

    def _gets_nowhere(self, stamp_s: float, *, is_held: bool) -> bool:
        T_map_base = self._driving.pose()
        return T_map_base is not None and self._patience.is_over(stamp_s, T_map_base[:3, 3], is_held=is_held)

    def _tell_position(self, stamp_s: float) -> None:
        T_map_base = self._driving.pose()
        if self._active is not None and T_map_base is not None:
            here = PoseStamped(header(stamp_s, frames().map), pose_message(T_map_base))
            self._active.publish_feedback(MoveBaseFeedback(here))

    def _known_pose(self) -> "Transform":
        T_map_base = self._driving.pose()
        if T_map_base is None:
            raise ValueError("a goal was given before the robot knows where it is")
        return T_map_base

    def _drive_to(self, goal: PoseStamped) -> bool:
        """Stores a path to a goal, or the first part of one: whether it is the whole. ValueError when there is none."""
        at, start = goal.pose.position, PoseStamped(Header(frame_id=frames().map), pose_message(self._known_pose()))
        try:
            with waiting_for(_PLAN_PATH):
                answer = self._plan_path(start, goal, _TOLERANCE_M)
        except NO_ANSWER as error:
            raise ValueError(f"no plan to ({at.x:.2f}, {at.y:.2f}): {reason_of(error)}") from error
        if not answer.plan.poses:
            raise ValueError(f"no plan to ({at.x:.2f}, {at.y:.2f}): no ground within {_TOLERANCE_M} m of it that the robot reaches")
        self._driving.store(answer.plan, answer.straight)
        return bool(answer.whole)

    def _drive_to_any_storey(self, goal: PoseStamped) -> PoseStamped:
        """The goal that is driven to: where the height given is no ground, that on the storey nearest to the robot."""
        try:
            self._is_whole = self._drive_to(goal)
        except ValueError:
            goal = copy.deepcopy(goal)
            goal.pose.position.z = math.nan
            self._is_whole = self._drive_to(goal)
        return goal

    def _on_goal(self, handle: "actionlib.ServerGoalHandle") -> None:
        """Drives to a goal in place of the one before, which stays when there is no path to the new one."""
        handle.set_accepted()
        source = handle.get_goal_id().id.rpartition("-")[0]
        try:
            asked = goal = self._driving.in_map(_checked(handle.get_goal().target_pose))
            if source == _CLICKED:
                goal.pose = self._looking_along(goal.pose)
            if source == _SIMPLE:
                goal = self._drive_to_any_storey(asked)
            else:
                self._is_whole = self._drive_to(asked)
        except ValueError as error:
            self._refuse(handle, str(error))
            return
        self.replace("replaced by a newer goal")
        self._active, self._goal, self._patience = handle, goal, Patience()
        self._driving.began(asked)

    def _refuse(self, handle: "actionlib.ServerGoalHandle", reason: str) -> None:
        """Aborts a goal a moment later: actionlib's client in Python is deaf to a result that comes before its send_goal has returned."""
        self._driving.refused(reason)
        timer = threading.Timer(_MOMENT_S, self._abort, (handle, reason))
        timer.daemon = True
        timer.start()

    def _abort(self, handle: "actionlib.ServerGoalHandle", reason: str) -> None:
        with self._lock:
            if self._server.started:
                handle.set_aborted(MoveBaseResult(), reason)

    def _looking_along(self, pose: Pose) -> Pose:
        """The place of a pose, and the direction in which it lies from the robot."""
        here, at = self._known_pose(), pose.position
        return pose_message(transform_from_rpy((at.x, at.y, at.z), (0.0, 0.0, math.atan2(at.y - here[1, 3], at.x - here[0, 3]))))

    def _on_cancel(self, handle: "actionlib.ServerGoalHandle") -> None:
        """Who cancels wants a robot that stands."""
        if self._active is not None and handle.get_goal_id() == self._active.get_goal_id():
            self._active.set_canceled(MoveBaseResult(), "cancelled")
            self._active = self._goal = None
            self._driving.stop("a goal was cancelled")


def _checked(goal: PoseStamped) -> PoseStamped:
    """The goal with a quaternion of length one; ValueError where something is no number, too far, or no rotation."""
    q = goal.pose.orientation
    values = q.x, q.y, q.z, q.w
    norm = math.sqrt(sum(value * value for value in values))
    if not _LEAST_QUATERNION < norm < math.inf:
        raise ValueError(f"invalid quaternion {values}: a goal without a heading has the orientation 0 0 0 1")
    goal.pose.orientation = Quaternion(*(value / norm for value in values))
    transform_from_pose(goal.pose)
    return goal
