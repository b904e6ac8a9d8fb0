"""What people ask of exploration, by the names of explore_lite: start, stop, home; what they see of it; and how the robot drives meanwhile.

Pausing is move_base_node's. What is asked here takes effect with the next sweep, which move_base_node is told to let come at once.
"""

import math
from functools import partial

import rospy
from explore_3dnav.msg import ExploreStatus, RunEvent
from std_srvs.srv import Trigger, TriggerResponse
from visualization_msgs.msg import MarkerArray

from octomap_server_3dnav.exploration.decide import Errand, Explorer, State
from octomap_server_3dnav.exploration.decision import Decision
from rigid_geometry import LONGEST_SILENCE_S
from ros_adapters.conversions import header, plain, stamp_of
from ros_adapters.frames import frames
from ros_adapters.frontier_markers import frontier_markers
from ros_adapters.node import Node

RECALL = "move_base_node/recall"
STATUS = "explore/status"
_MEMORY = "requests"
_OVER = ("finished", "failed")
_EXPLORING, _GOING_HOME, _HOME = ExploreStatus.EXPLORING, ExploreStatus.GOING_HOME, ExploreStatus.HOME


def status_of(event: str, state: State, is_going_home: bool) -> str:
    """The state of exploration: what the robot does, by the name of stop_scan_and_go_node's state, and what it is about."""
    if event == "failed" or (event == "finished" and state is State.TRAPPED):
        return str(ExploreStatus.FAILED)
    if event in ("paused", "finished") and state is State.HOME:
        return str(_HOME)
    if event in ("paused", "finished"):
        return str(ExploreStatus.PAUSED if event == "paused" else ExploreStatus.DONE)
    return str(_GOING_HOME if is_going_home else _EXPLORING)


def _since_start_s(event: RunEvent) -> float:
    return stamp_of(event) - float(event.began_s)


class ExplorationRequests:
    """Serves /explore/start, /explore/stop and /explore/return_home, publishes /explore/status and /explore/frontiers, latched, and hears
    /exploration/event."""

    def __init__(self, node: Node, explorer: Explorer) -> None:
        self._node, self._explorer = node, explorer
        starting = RunEvent(state="starting", reason="waiting for the first sweep", began_s=math.nan)
        # The last event, that to which the next sweep belongs, what was decided, and seconds of all pauses.
        memory = node.life.kept(_MEMORY, (starting, RunEvent(), "", 0.0))
        self._event, self._drive, self._decided, self._paused_s = memory
        self._told = ExploreStatus()
        self._status = node.publisher(STATUS, ExploreStatus, latch=True)
        self._frontiers = node.publisher("explore/frontiers", MarkerArray, latch=True)
        self._recall = rospy.ServiceProxy(RECALL, Trigger)
        for name, errand in (("start", Errand.EXPLORE), ("stop", Errand.END), ("return_home", Errand.HOME)):
            node.serve(f"explore/{name}", Trigger, partial(self._ask, errand))
        node.subscribe("exploration/event", RunEvent, self._on_event)
        self._tell()

    def _on_event(self, heard: RunEvent) -> None:
        event = plain(heard, RunEvent)
        self._paused_s += _since_start_s(event) - _since_start_s(self._event) if self._event.state == "paused" else 0.0
        self._event = event
        if event.state in ("paused", "taken_over"):
            self._explorer.overrule()
        if event.state in ("sweeping", "looking"):
            self._drive = event
        elif event.state == "driving":
            self._drive = RunEvent(state=event.state, intermediate=True, distance_m=event.distance_m)
        self._remember()
        self._tell()

    def drive(self, stamp_s: float) -> tuple[bool, str, float, float, bool, bool, float]:
        """Of a sweep at `stamp_s`, for `Observation`: on the way, why the drive failed, time and way, whether it stood, and at its goal,
        and seconds of all pauses. A failure is told once."""
        drive, elapsed_s = self._drive, self._elapsed_s(stamp_s)
        failure, drive.failure = drive.failure, ""
        stands = drive.state != "driving" and stamp_s > stamp_of(drive)
        return drive.intermediate, failure, elapsed_s, drive.distance_m, stands, stands and drive.reached, self._paused_s

    def _elapsed_s(self, stamp_s: float) -> float:
        """Of a sweep, since the start. One whose clock is not that of the last event is as late as that."""
        apart_s = abs(stamp_s - stamp_of(self._event))
        return _since_start_s(self._event) if apart_s > LONGEST_SILENCE_S else stamp_s - self._event.began_s

    def on_decision(self, stamp_s: float, decision: Decision) -> None:
        """What was decided after a sweep."""
        self._decided = decision.reason
        self._remember()
        self._frontiers.publish(frontier_markers(stamp_s, decision))
        self._tell()

    def _remember(self) -> None:
        self._node.life.keep(_MEMORY, (self._event, self._drive, self._decided, self._paused_s))

    def _tell(self) -> None:
        event, explorer = self._event, self._explorer
        state = status_of(event.state, explorer.state, explorer.is_going_home)
        reason = event.reason if not self._decided or event.state in (*_OVER, "paused", "taken_over") else self._decided
        if (state, reason) != (self._told.state, self._told.reason):
            self._told = ExploreStatus(header(event.header.stamp.to_sec(), frames().map), state, reason)
            self._status.publish(self._told)

    def _ask(self, errand: Errand, _request: object) -> TriggerResponse:
        with self._node.lock:
            refusal = self._why_not(errand)
            if refusal:
                return TriggerResponse(False, refusal)
            self._explorer.ask(errand, _ASKED[errand])
        try:
            answer = self._recall()
        except rospy.ServiceException as error:
            return TriggerResponse(False, f"with the next sweep: move_base_node does not answer: {error}")
        with self._node.lock:
            self._tell()
        return TriggerResponse(answer.success, answer.message or _ANSWERS[errand])

    def _why_not(self, errand: Errand) -> str:
        """Why the state stays as it is; empty where it changes."""
        state, is_over = self._told.state, self._event.state in _OVER
        if self._event.state == "failed" and errand is not Errand.EXPLORE:
            return f"the robot has failed: {self._event.reason}"
        if errand is not Errand.HOME and not self._explorer.explores:
            return "exploration is off: the robot is localised in a finished map (mapping:=off)"
        if errand is Errand.EXPLORE:
            return "exploring already" if state == _EXPLORING else ""
        if not self._decided:
            return "no sweep is in the map yet: where the robot begins is not known"
        if errand is Errand.END:
            return f"exploration has ended already: {self._event.reason}" if is_over else ""
        return "" if state not in (_GOING_HOME, _HOME) else f"already {state.replace('_', ' ')}: {self._told.reason}"


_ASKED = {Errand.EXPLORE: "", Errand.END: "told to stop", Errand.HOME: "told to return home"}
_ANSWERS = {Errand.EXPLORE: "exploring, with a sweep from here", Errand.END: "stopping, with a last sweep", Errand.HOME: "going home"}
