"""The state of exploration that people are told, by what the robot does and what it is about; and what a sweep is told of its drive."""

from types import SimpleNamespace

import pytest
from explore_3dnav.msg import RunEvent

from octomap_server_3dnav.exploration.decide import Errand, Explorer, State
from ros_adapters.conversions import header
from ros_adapters.exploration_requests import ExplorationRequests, status_of


@pytest.mark.parametrize(
    ("event", "state", "is_going_home", "told"),
    [
        ("starting", State.STARTING, False, "exploring"),
        ("driving", State.UNDER_WAY, False, "exploring"),
        ("sweeping", State.GOING_HOME, True, "going_home"),
        ("driving", State.UNDER_WAY, True, "going_home"),  # asked for, and not decided yet
        ("paused", State.UNDER_WAY, False, "paused"),
        ("paused", State.GOING_HOME, True, "paused"),
        ("paused", State.HOME, False, "home"),
        ("finished", State.HOME, False, "home"),
        ("finished", State.EXPLORED, False, "done"),
        ("finished", State.ENDED, False, "done"),
        ("finished", State.TRAPPED, False, "failed"),
        ("failed", State.GOING_HOME, True, "failed"),
        ("taken_over", State.UNDER_WAY, False, "exploring"),
    ],
)
def test_state_is_that_of_the_robot_and_of_what_it_is_about(event: str, state: State, is_going_home: bool, told: str) -> None:
    assert status_of(event, state, is_going_home) == told


class Robot:
    """A node that tells nobody, keeps what it is to keep, and hears the events that it is given here."""

    def __init__(self, kept: dict[str, object] | None = None) -> None:
        self.memory = {} if kept is None else kept
        life = SimpleNamespace(kept=self.memory.get, keep=self.memory.__setitem__)
        publisher = SimpleNamespace(publish=lambda _message: None)
        node = SimpleNamespace(life=life, publisher=lambda *_, **__: publisher, serve=lambda *_: None, subscribe=self._subscribe)
        self.requests = ExplorationRequests(node, Explorer())

    def _subscribe(self, _topic: str, _kind: object, hear: object) -> None:
        self.hear = hear

    def event(self, stamp_s: float, state: str, began_s: float = 1000.0, failure: str = "") -> None:
        self.hear(RunEvent(header=header(stamp_s, "odom"), state=state, began_s=began_s, failure=failure))

    def elapsed_s(self, stamp_s: float) -> float:
        return self.requests.drive(stamp_s)[2]

    def paused_s(self) -> float:
        return self.requests.drive(2000.0)[-1]

    def failure(self, stamp_s: float) -> str:
        return self.requests.drive(stamp_s)[1]


@pytest.mark.parametrize("step_s", [3600.0, -500.0])
def test_clock_that_is_set_spends_nothing_of_a_budget(step_s: float) -> None:
    robot = Robot()
    robot.event(1000.0, "starting")
    robot.event(1020.0, "driving")
    assert robot.elapsed_s(1021.0) == pytest.approx(21.0)
    robot.event(1040.0 + step_s, "sweeping", 1000.0 + step_s)
    assert robot.elapsed_s(1044.0 + step_s) == pytest.approx(44.0)


@pytest.mark.parametrize("step_s", [3600.0, -500.0])
def test_sweep_of_another_clock_than_the_last_event_is_as_late_as_that(step_s: float) -> None:
    robot = Robot()
    robot.event(1020.0, "driving")
    assert robot.elapsed_s(1040.0 + step_s) == pytest.approx(20.0)


def test_clock_that_is_set_while_somebody_has_paused_is_no_pause() -> None:
    robot = Robot()
    robot.event(1020.0, "paused")
    robot.event(1020.0 + 50.0 + 3600.0, "driving", 1000.0 + 3600.0)
    assert robot.paused_s() == pytest.approx(50.0)


def test_time_of_a_run_goes_on_in_a_process_that_was_started_again() -> None:
    robot = Robot()
    robot.event(1020.0, "paused")
    robot.event(1000.0 + 3650.0, "driving", 4600.0)
    again = Robot(robot.memory)
    assert (again.elapsed_s(4660.0), again.paused_s()) == pytest.approx((60.0, 30.0))


@pytest.mark.parametrize("state", ["looking", "sweeping"])
def test_failure_of_a_drive_is_told_once(state: str) -> None:
    """Looking, a robot makes several sweeps in one state: one blocked way counted as two, and two put a frontier aside."""
    robot = Robot()
    robot.event(1100.0, state, failure="blocked: a box")
    assert [robot.failure(stamp_s) for stamp_s in (1101.0, 1102.0)] == ["blocked: a box", ""]
    robot.event(1120.0, state, failure="blocked: a box")
    assert robot.failure(1121.0) == "blocked: a box"


@pytest.mark.parametrize(("state", "is_overruled"), [("driving", False), ("sweeping", False), ("paused", True), ("taken_over", True)])
def test_robot_that_is_paused_or_driven_by_joystick_does_not_drive_what_was_decided(state: str, is_overruled: bool) -> None:
    told: list[bool] = []
    node = SimpleNamespace(
        life=SimpleNamespace(kept=lambda _, otherwise: otherwise, keep=lambda *_: None),
        publisher=lambda *_, **__: SimpleNamespace(publish=lambda _: None),
        serve=lambda *_: None,
        subscribe=lambda *_: None,
    )
    explorer = SimpleNamespace(state=State.UNDER_WAY, is_going_home=False, overrule=lambda: told.append(True))
    requests = ExplorationRequests(node, explorer)  # type: ignore[arg-type]
    requests._on_event(RunEvent(state=state))
    assert bool(told) == is_overruled


def test_robot_that_has_failed_is_asked_for_nothing_but_to_explore_anew() -> None:
    robot = Robot()
    robot.hear(RunEvent(header=header(1000.0, "odom"), state="failed", reason="the mount was not level", began_s=1000.0))
    told = {errand: robot.requests._why_not(errand) for errand in Errand}
    assert told.pop(Errand.EXPLORE) == "" and set(told.values()) == {"the robot has failed: the mount was not level"}
