"""Whether exploration's plans are driven: paused and resumed by service or topic, by who cancels all goals, and by exploration itself."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import rospy
from actionlib_msgs.msg import GoalID
from std_msgs.msg import Bool
from std_srvs.srv import Trigger, TriggerResponse

from ros_adapters.node import Node

if TYPE_CHECKING:
    from ros_adapters.goal_action import GoalAction

PAUSED, RECALLED = "paused", "recalled"
"""States that are told of a follower without a path: exploration's are not driven; and a sweep is to decide anew, at once."""


class ExplorationPause:
    """Serves /explore/pause, /explore/resume, ~recall, ~replan (Trigger), and hears /explore/resume (Bool), /move_base/cancel (GoalID).

    A goal of the user's is driven to while exploration is paused. ~recall drops whatever is driven, and the pause: a sweep follows, and
    what is decided after it. ~replan drops the path only, when there is one: goal and pause stay. What was decided before does not count.
    """

    def __init__(self, node: Node, stand: Callable[[str], None], drives: Callable[[], bool], *, explores: bool = True) -> None:
        """`stand` has the robot stand for a reason until the next plan; `drives`: whether it has a path. Without `explores` there is
        nothing to go on with."""
        self._node, self._stand, self._drives, self._explores = node, stand, drives, explores
        self._goals: GoalAction | None = None
        self.reason = ""  # why exploration is paused; empty: it is not
        self.recalled = ""  # why a sweep is to decide anew; empty: nobody asked for one
        self.now_s = self.asked_s = -math.inf  # the newest stamp, and when people asked for something last

    def serve(self, goals: "GoalAction") -> None:
        """Begins to answer; `goals` are the user's."""
        self._goals = goals
        node = self._node
        node.serve("explore/pause", Trigger, lambda _: self._answer_pause())
        node.serve("explore/resume", Trigger, lambda _: self._answer_resume())
        node.serve("~recall", Trigger, lambda _: self._answer_recall())
        node.serve("~replan", Trigger, lambda _: self._answer_replan())
        node.subscribe("move_base/cancel", GoalID, self._on_cancel, required=False)
        node.subscribe("explore/resume", Bool, self._on_resume, required=False)

    def begin(self, why: str) -> None:
        """The robot stands, and drives nothing but goals until exploration is told to go on."""
        how = f"{rospy.resolve_name('explore/resume')} lets exploration go on" if self._explores else "goals are driven to"
        self.reason, self.recalled = f"{why}; {how}", ""
        self._stand(self.reason)

    def end(self, why: str) -> None:
        """Exploration goes on with a sweep; a goal that is driven to stays."""
        self.reason = ""
        if self._goals is None or not self._goals.is_active:
            self._recall(why)

    def is_outdated(self, stamp_s: float) -> bool:
        """Whether a plan of a sweep, 0 for none, was decided before something else was asked for. A clock may have been set back."""
        return 0.0 < stamp_s <= self.asked_s <= self.now_s

    def plan_came(self) -> None:
        """What a recall asked for is here."""
        self.recalled = ""

    def _recall(self, why: str) -> None:
        self.recalled, self.asked_s = why, self.now_s

    def state_of_idle(self) -> tuple[str, str] | None:
        """State and reason of a follower without a path; None when they are its own."""
        if self.recalled:
            return RECALLED, self.recalled
        return (PAUSED, self.reason) if self.reason else None

    def _on_cancel(self, cancelled: GoalID) -> None:
        """Who cancels all goals, as /move_base/cancel does, means exploration's, too. The goals themselves are the action's."""
        if not cancelled.id and not cancelled.stamp:
            self.begin("all goals were cancelled")

    def _on_resume(self, message: Bool) -> None:
        """A goal that is driven to stays, whichever it says."""
        if not message.data:
            self._hold()
        elif self.reason and self._explores:
            self.end("exploration goes on")

    def _hold(self) -> None:
        if self._goals is not None and self._goals.is_active:
            self.reason = "exploration was paused"
        else:
            self.begin("exploration was paused")

    def _answer_pause(self) -> TriggerResponse:
        with self._node.lock:
            if self.reason:
                return TriggerResponse(False, f"paused already: {self.reason}")
            self._hold()
            return TriggerResponse(True, "exploration is paused; goals are driven to")

    def _answer_resume(self) -> TriggerResponse:
        with self._node.lock:
            if not self.reason or not self._explores:
                return TriggerResponse(False, "exploration is not paused" if self._explores else f"there is none: {self.reason}")
            self.end("exploration goes on")
            return TriggerResponse(True, "exploration goes on")

    def _answer_recall(self) -> TriggerResponse:
        with self._node.lock:
            if self._goals is not None:
                self._goals.replace("exploration was asked for something else")
            self.end("exploration was asked for something else")
            self._stand(self.recalled)
            return TriggerResponse(True, "")

    def _answer_replan(self) -> TriggerResponse:
        with self._node.lock:
            self.asked_s = self.now_s  # also of a robot that stands: a plan may be on its way
            if self._drives():
                self._recall("where the robot may drive has changed")
                self._stand(self.recalled)
            return TriggerResponse(True, "")
