"""What the exploration hears and answers, as messages: a sweep's outcome, its decision, and the path for the follower."""

from explore_3dnav.msg import ExplorationDecision, MappedSweep
from explore_3dnav.srv import StorePlanRequest
from geometry_msgs.msg import Point
from nav_msgs.msg import Path

from octomap_server_3dnav.exploration.decision import Decision, DecisionKind
from octomap_server_3dnav.exploration.observation import SweepOutcome
from ros_adapters.conversions import header, path_message
from ros_adapters.frames import frames
from ros_adapters.stage_times import StageTimes


def outcome_of(message: MappedSweep) -> SweepOutcome:
    """What became of a sweep."""
    if message.lost or message.failure:
        return SweepOutcome.LOST if message.lost else SweepOutcome.UNPLACED
    return SweepOutcome.REFUSED if message.match_refused else SweepOutcome.MATCHED


def plan_of(stamp_s: float, decision: Decision) -> StorePlanRequest:
    """The follower's path, or an empty one where there is no goal, and why it waits then (6.2.2)."""
    plan = Path(header=header(stamp_s, frames().map))  # empty: the robot stands
    if decision.kind is DecisionKind.GOAL:
        assert decision.path is not None and decision.goal is not None
        plan = path_message(stamp_s, frames().map, decision.path, decision.goal[3])
    straight = [] if decision.straight is None else decision.straight.tolist()
    return StorePlanRequest(plan, straight, decision.exact, decision.reason if decision.kind is DecisionKind.WAIT else "")


def decision_message(stamp_s: float, decision: Decision, outcome: SweepOutcome, timing: StageTimes) -> ExplorationDecision:
    """The decision, with what its classifications have cost so far."""
    message = ExplorationDecision(header=header(stamp_s, frames().map), kind=decision.kind.value, reason=decision.reason)
    message.has_terrain, message.match_refused = outcome is not SweepOutcome.LOST, outcome is SweepOutcome.REFUSED
    if decision.frontier is not None:
        message.frontier = Point(*decision.frontier)
    message.open_frontiers, message.set_aside_frontiers = decision.open_frontiers, decision.set_aside
    message.local_classifications, message.local_classification_time_s = timing.count("local")
    message.global_classifications, message.global_classification_time_s = timing.count("global")
    return message
