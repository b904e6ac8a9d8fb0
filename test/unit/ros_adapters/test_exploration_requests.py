"""The state of exploration that people are told, by what the robot does and what it is about."""

from types import SimpleNamespace

import pytest
from explore_3dnav.msg import RunEvent

from octomap_server_3dnav.exploration.decide import State
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
