"""Whose plan the follower drives: exploration's as it is stored, or one to a goal of the user's, which comes first."""

from collections.abc import Sequence
from functools import partial

from explore_3dnav.msg import RunEvent
from explore_3dnav.srv import StorePlan, StorePlanRequest, StorePlanResponse
from geometry_msgs.msg import PointStamped, PoseStamped
from nav_msgs.msg import Path
from std_msgs.msg import Header

from path_following import FollowerState, PathFollower
from rigid_geometry import yaw_of
from rigid_geometry.transforms import Transform
from ros_adapters.conversions import path_points, stamp_of, transform_from_pose
from ros_adapters.exploration_pause import ExplorationPause
from ros_adapters.frames import frames
from ros_adapters.goal_action import GoalAction, GoalDriving
from ros_adapters.mapping_mode import Results, only_localises
from ros_adapters.node import Node
from ros_adapters.recovery_status import Recovery, RecoveryTopic
from ros_adapters.tf_lookup import TransformInput

_PAUSE, _PLAN = "pause", "plan"


class DrivenPlan:
    """Serves storePlan and what `ExplorationPause` and `GoalAction` do; hears goals from rviz, and /exploration/event.

    After a cancel or a pause nothing of exploration's is driven, goals are. A plan that had no effect yet, and the pause, outlive the
    process.
    """

    def __init__(self, node: Node, follower: PathFollower, results: Results, tf: TransformInput, recoveries: RecoveryTopic) -> None:
        """`results`: when a plan takes effect; `tf`: of goals in any frame."""
        self._node, self._follower, self._results, self._recoveries = node, follower, results, recoveries
        self._plan = node.publisher("move_base/current_plan", Path, latch=True)
        current_goal = node.publisher("move_base/current_goal", PoseStamped, latch=True)
        self.T_map_base: Transform | None = None
        self._failure = ""  # why the robot does not drive any more
        self.pause = ExplorationPause(node, self._stand, lambda: not follower.state.is_over, explores=not only_localises(node.name))
        self.pause.reason, self.pause.recalled, self.pause.asked_s = node.life.kept(_PAUSE, self._pause())
        refused = partial(node.diagnostics.dropped, "goal refused")
        driving = GoalDriving(self._store, self._stand, self.pause.begin, self._place, tf.in_map, current_goal.publish, refused)
        self.goals = GoalAction(node.lock, driving)
        self.pause.serve(self.goals)
        node.serve("storePlan", StorePlan, self._on_store_plan)
        node.subscribe("move_base_simple/goal", PoseStamped, self.goals.on_simple_goal, required=False)
        node.subscribe("clicked_point", PointStamped, self.goals.on_clicked_point, required=False)
        node.subscribe("exploration/event", RunEvent, self._on_event, required=False)

    def take_up(self) -> None:
        """A plan that the process before this one was given and had not driven yet."""
        if (request := self._node.life.kept(_PLAN, None)) is not None:
            self._take(request)

    def keep(self) -> None:
        """For a process after this one."""
        self._node.life.keep(_PAUSE, self._pause())

    def robot_is(self, stamp_s: float, T_map_base: Transform | None) -> None:
        """Where the robot is by now; None while nobody knows."""
        self.pause.now_s, self.T_map_base = stamp_s, T_map_base

    def _pause(self) -> tuple[str, str, float]:
        return self.pause.reason, self.pause.recalled, self.pause.asked_s

    def _on_store_plan(self, request: StorePlanRequest) -> StorePlanResponse:
        with self._node.lock:
            try:
                _check(request.plan)
                self._node.life.keep(_PLAN, request)
                self._results.add(stamp_of(request.plan), partial(self._take, request))
            except ValueError as error:
                return StorePlanResponse(False, str(error))
            return StorePlanResponse(True, "")

    def _take(self, request: StorePlanRequest) -> None:
        """Exploration's plan, or that it has none any more. A goal of the user's comes first, and is planned to anew from here."""
        self._node.life.forget(_PLAN)  # the follower has it, or nobody
        if self.pause.is_outdated(stamp_of(request.plan)):
            return
        self.pause.plan_came()  # also where it is not driven: else sweep after sweep is asked for
        if self.goals.goes_on():
            return
        if request.plan.poses and self._follower.state in (FollowerState.BLOCKED, FollowerState.STUCK):
            self._recoveries.tell_of(Recovery.NEXT_GOAL, stamp_of(request.plan), self.T_map_base)
        if request.wait:
            self.pause.begin(request.wait)
        elif self.pause.reason:
            self._stand(self.pause.reason)
        else:
            self._store(request.plan, request.straight, exact=request.exact)

    def _store(self, plan: Path, straight: Sequence[bool] = (), *, exact: bool = False) -> None:
        """Takes a plan for the follower, `straight` where it must not turn; an empty one stops the robot. `exact`: it is to stand at the
        end. ValueError when it cannot be followed."""
        self.pause.plan_came()
        if not plan.poses:
            self._stand("an empty plan was stored")
            return
        _check(plan)
        self._follower.set_path(path_points(plan), yaw_of(transform_from_pose(plan.poses[-1].pose)), straight, exact=exact)
        self._plan.publish(plan)

    def _stand(self, reason: str) -> None:
        self._follower.clear(reason)
        self._plan.publish(Path(header=Header(frame_id=frames().map)))

    def _place(self) -> Transform | None:
        """Where the robot is, for goals. ValueError while it does not drive any more."""
        if self._failure:
            raise ValueError(self._failure)
        return self.T_map_base

    def _on_event(self, message: RunEvent) -> None:
        """A robot that has failed keeps no goal waiting, and what it was asked for before is over."""
        self._failure = f"the robot has failed: {message.reason}" if message.state == "failed" else ""
        if self._failure:
            self.pause.recalled = ""
            self.goals.give_up(self._failure)


def _check(plan: Path) -> None:
    """ValueError for a plan that cannot be followed."""
    if plan.poses and plan.header.frame_id.lstrip("/") != frames().map:
        raise ValueError(f"plan in frame {plan.header.frame_id!r}, expected {frames().map!r}")
