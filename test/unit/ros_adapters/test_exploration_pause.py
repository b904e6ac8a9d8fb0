"""Exploration that is paused, whose plan a sweep was asked for, and goals of the user's that come first."""

import copy
import threading
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
import rospy
from explore_3dnav.srv import StorePlanRequest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from std_msgs.msg import Header
from std_srvs.srv import TriggerRequest

from path_following import FollowerState
from ros_adapters import driven_plan
from ros_adapters.driven_plan import DrivenPlan
from ros_adapters.exploration_pause import PAUSED, RECALLED


class _Follower:
    """Stands for the follower: it drives while it has a path."""

    state = FollowerState.FOLLOWING

    def set_path(self, *_: object, **_more: object) -> None:
        self.state = FollowerState.FOLLOWING

    def clear(self, _reason: str) -> None:
        self.state = FollowerState.IDLE


class _Goals:
    """Stands for the user's goal; `leads_there`: whether there is a path to it."""

    is_active, leads_there = True, True

    def __init__(self, _lock: threading.RLock, driving: Any) -> None:
        self._driving = driving

    def goes_on(self) -> bool:
        self.is_active = self.is_active and self.leads_there
        if self.is_active:
            self._driving.store(a_path(), ())
        return self.is_active

    def give_up(self, _reason: str) -> None:
        self.is_active = False

    replace = give_up

    def on_simple_goal(self, _goal: object) -> None: ...

    on_clicked_point = on_simple_goal


class _Node:
    """Stands for a node: what it serves is called by name."""

    name = "move_base_node"

    def __init__(self) -> None:
        self.lock, self.served = threading.RLock(), dict[str, Callable[[Any], Any]]()
        self.life = SimpleNamespace(kept=lambda _, otherwise: otherwise, keep=lambda *_: None, forget=lambda *_: None)
        self.diagnostics = SimpleNamespace(dropped=lambda *_: None)

    def publisher(self, *_: object, **_more: object) -> SimpleNamespace:
        return SimpleNamespace(publish=lambda _: None)

    def subscribe(self, *_: object, **_more: object) -> None: ...

    def serve(self, name: str, _type: type, answer: Callable[[Any], Any]) -> None:
        self.served[name] = answer

    def call(self, name: str) -> None:
        assert self.served[name](TriggerRequest()).success


def a_path() -> Path:
    poses = [PoseStamped() for _ in range(2)]
    for x, each in enumerate(poses):
        each.pose.position.x, each.pose.orientation.w = float(x), 1.0
    return Path(header=Header(frame_id="map"), poses=poses)


@pytest.fixture
def driven(monkeypatch: pytest.MonkeyPatch) -> DrivenPlan:
    """A plan of a node without ROS, on its way to a goal of the user's."""
    monkeypatch.setattr(rospy, "resolve_name", lambda name: f"/{name}")
    monkeypatch.setattr(driven_plan, "only_localises", lambda _: False)
    monkeypatch.setattr(driven_plan, "GoalAction", _Goals)
    results = SimpleNamespace(add=lambda _, take: take())
    return DrivenPlan(_Node(), _Follower(), results, SimpleNamespace(in_map=None), SimpleNamespace())  # type: ignore[arg-type]


def asked_for_a_sweep(driven: DrivenPlan) -> Any:
    """The node, when exploration is paused, a goal is driven to, and new zones ask for a plan anew."""
    node: Any = driven._node
    node.call("explore/pause")
    assert driven.pause.state_of_idle() == (PAUSED, "exploration was paused")
    node.call("~replan")
    assert (driven.pause.state_of_idle() or ("",))[0] == RECALLED
    return node


@pytest.mark.parametrize("asked", ["~recall", "~replan", "explore/resume"])
@pytest.mark.parametrize("request_", [StorePlanRequest(wait="home"), StorePlanRequest(), StorePlanRequest(plan=a_path())])
def test_what_was_decided_before_a_sweep_was_asked_for_takes_no_effect(driven: DrivenPlan, request_: StorePlanRequest, asked: str) -> None:
    node: Any = driven._node
    driven.goals.is_active = False  # type: ignore[misc]
    if asked == "explore/resume":
        node.call("explore/pause")
    driven.robot_is(100.0, None)
    node.call(asked)
    before = driven.pause.state_of_idle()
    request_ = copy.deepcopy(request_)
    request_.plan.header.stamp = rospy.Time(99.5)
    node.served["storePlan"](request_)
    assert (before or ("",))[0] == RECALLED and driven.pause.state_of_idle() == before
    request_.plan.header.stamp = rospy.Time(100.5)
    node.served["storePlan"](request_)
    assert driven.pause.state_of_idle() != before


def test_plan_of_before_new_zones_takes_no_effect_for_a_robot_that_stands(driven: DrivenPlan) -> None:
    node: Any = driven._node
    driven.goals.is_active = False  # type: ignore[misc]
    driven._stand("no plan")
    driven.robot_is(100.0, None)
    node.call("~replan")
    request = StorePlanRequest(plan=a_path())
    request.plan.header.stamp = rospy.Time(99.5)
    node.served["storePlan"](request)
    assert driven._follower.state is FollowerState.IDLE
    request.plan.header.stamp = rospy.Time(100.5)
    node.served["storePlan"](request)
    assert driven._follower.state is FollowerState.FOLLOWING


def test_plan_s_frame_may_begin_with_a_slash(driven: DrivenPlan) -> None:
    node: Any = driven._node
    request = StorePlanRequest(plan=a_path())
    request.plan.header.frame_id = "/map"
    assert node.served["storePlan"](request).accepted


def test_clock_that_was_set_back_leaves_no_plan_outdated(driven: DrivenPlan) -> None:
    node: Any = driven._node
    driven.robot_is(100.0, None)
    node.call("~recall")
    driven.robot_is(40.0, None)
    request = StorePlanRequest(plan=a_path())
    request.plan.header.stamp = rospy.Time(41.0)
    node.served["storePlan"](request)
    assert driven.pause.state_of_idle() is None


def test_goal_that_is_given_up_while_exploration_is_paused_leaves_a_pause(driven: DrivenPlan) -> None:
    node = asked_for_a_sweep(driven)
    driven.goals.leads_there = False  # type: ignore[attr-defined]
    node.served["storePlan"](StorePlanRequest(plan=a_path()))  # what exploration decides after the sweep
    assert driven.pause.state_of_idle() == (PAUSED, "exploration was paused")
    node.call("explore/resume")
    assert driven.pause.state_of_idle() == (RECALLED, "exploration goes on")


def test_goal_is_planned_to_anew_after_the_sweep_and_the_pause_stays(driven: DrivenPlan) -> None:
    node = asked_for_a_sweep(driven)
    node.served["storePlan"](StorePlanRequest(plan=a_path()))
    assert driven._follower.state is FollowerState.FOLLOWING
    assert driven.pause.state_of_idle() == (PAUSED, "exploration was paused")


@pytest.mark.parametrize(
    ("request_", "idle"),
    [
        (StorePlanRequest(plan=a_path()), None),
        (StorePlanRequest(), None),
        (StorePlanRequest(wait="home"), (PAUSED, "home; /explore/resume lets exploration go on")),
    ],
    ids=["a path", "none", "none, and a reason to wait"],
)
def test_whatever_is_decided_after_a_recall_ends_it(driven: DrivenPlan, request_: StorePlanRequest, idle: object) -> None:
    node: Any = driven._node
    node.call("~recall")
    assert driven.pause.state_of_idle() == (RECALLED, "exploration was asked for something else")
    node.served["storePlan"](request_)
    assert driven.pause.state_of_idle() == idle
