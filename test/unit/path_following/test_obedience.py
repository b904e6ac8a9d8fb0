"""A base that does not obey: it is told, crept at, and blames no drive; wheels that something blocks are backed off."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from local_terrain_costmap import CostmapView
from path_following import FollowerConfig, FollowerObservation, FollowerOutput, FollowerState, PathFollower
from path_following.manoeuvres import Motion
from path_following.obedience import Obedience
from robot_body import load_robot

TICK_S = 0.05
FREE = CostmapView(np.zeros((150, 150), np.uint8), (-6.0, -6.0), 0.08)
STRAIGHT = np.column_stack([np.linspace(0.0, 4.0, 81), np.zeros(81), np.zeros(81)])


@dataclass
class Track:
    """A robot on a straight way, its follower, and what that said."""

    follower: PathFollower = field(default_factory=lambda: PathFollower(FollowerConfig(max_speed_mps=0.7), load_robot()))
    t: float = 0.0
    x: float = 0.0
    v: float = 0.0
    outputs: list[FollowerOutput] = field(default_factory=list)

    def go(self, seconds: float, *, forward: bool = True, backward: bool = True, passes: bool = True, view: CostmapView = FREE) -> None:
        """Wheels that turn forward or backward or not at all; commands that somebody `passes` to them or keeps."""
        for _ in range(round(seconds / TICK_S)):
            T = np.eye(4)
            T[0, 3] = self.x
            sent = None if passes else (0.0, 0.0)
            out = self.follower.step(FollowerObservation(self.t, T, view, (self.v, 0.0), sent=sent))
            self.v = out.v if passes and (forward if out.v > 0.0 else backward) else 0.0
            self.t, self.x = self.t + TICK_S, self.x + self.v * TICK_S
            self.outputs.append(out)


@pytest.fixture
def track() -> Track:
    made = Track()
    made.follower.set_path(STRAIGHT, None)
    return made


def test_e_stop_is_told_and_no_drive_fails_by_it(track: Track) -> None:
    track.go(60.0, forward=False, backward=False)
    assert not any(out.state.is_over for out in track.outputs)
    assert max(out.v for out in track.outputs[:30]) > 0.3, "for a moment nobody knows"
    assert "does not obey" in track.outputs[-1].reason and "does not obey" in track.follower.disobeyed
    assert all(abs(out.v) <= 0.1 + 1e-9 and abs(out.w) <= 0.3 + 1e-9 for out in track.outputs[40:])
    assert track.outputs[-1].v == pytest.approx(0.1)


def test_release_is_no_step(track: Track) -> None:
    track.go(20.0, forward=False, backward=False)
    track.go(10.0)
    speeds = np.array([out.v for out in track.outputs[400:]])
    assert speeds[0] <= 0.1 + 1e-9 and np.diff(speeds).max() <= 0.8 * TICK_S + 1e-9 and speeds.max() > 0.5
    assert track.outputs[-1].state is FollowerState.REACHED and track.follower.disobeyed == ""


def test_wheels_that_something_blocks_back_off_once(track: Track) -> None:
    track.go(1.0)
    track.go(20.0, forward=False)
    assert FollowerState.BACKING_OFF in {out.state for out in track.outputs} and track.x < 0.2
    assert track.outputs[-1].state is FollowerState.STUCK, "it moved: the way is what keeps it"


def test_recovery_that_is_not_obeyed_either_is_not_repeated(track: Track) -> None:
    track.go(60.0, forward=False, backward=False)
    backward_s = [k * TICK_S for k, out in enumerate(track.outputs) if out.v < 0.0]
    assert backward_s and 6.0 <= backward_s[0] < 7.5 and backward_s[-1] < 14.0


def test_command_that_somebody_keeps_from_the_wheels_is_not_disobeyed(track: Track) -> None:
    """The collision monitor, before a person."""
    track.go(4.0, passes=False)
    assert not any("obey" in out.reason for out in track.outputs)


def test_way_that_is_blocked_meanwhile_ends_the_drive(track: Track) -> None:
    track.go(4.0, forward=False, backward=False)
    blocked = FREE.cost.copy()
    blocked[:, 82:84] = 254
    track.go(20.0, forward=False, backward=False, view=CostmapView(blocked, FREE.origin_xy, FREE.resolution))
    assert track.outputs[-1].state.is_over


def test_base_that_obeys_is_never_accused() -> None:
    base, v = Obedience(), 0.0
    for k in range(2000):
        told = 0.5 * max(0.0, math.sin(0.02 * k))
        assert base.take_in(k * TICK_S, Motion(told, 0.0), (v, 0.0)) == 0.0 and base.obeys
        v = told


def test_both_sides_of_each_bar() -> None:
    def obeys(sent: Motion, twist: tuple[float, float] | None, seconds: float = 1.6) -> bool:
        base = Obedience()
        for k in range(round(seconds / TICK_S) + 1):
            base.take_in(k * TICK_S, sent, twist)
        return base.obeys

    assert not obeys(Motion(0.1, 0.0), (0.0, 0.0)) and obeys(Motion(0.09, 0.0), (0.0, 0.0))
    assert not obeys(Motion(0.0, -0.2), (0.0, 0.0)) and obeys(Motion(0.0, -0.19), (0.0, 0.0))
    assert not obeys(Motion(0.5, 0.0), (0.009, -0.019)) and obeys(Motion(0.5, 0.0), (0.011, 0.0)) and obeys(Motion(0.5, 0.0), (0.0, 0.021))
    assert obeys(Motion(0.5, 0.0), (0.0, 0.0), 1.4) and obeys(Motion(0.5, 0.0), None) and obeys(Motion(0.5, 0.0), (math.nan, 0.0))


def test_pause_is_no_disobedience() -> None:
    base = Obedience()
    for stamp_s in (0.0, 0.05, 3.0, 3.05, -7.0, -6.9):
        assert base.take_in(stamp_s, Motion(0.5, 0.0), (0.0, 0.0)) == 0.0 and base.obeys


def test_time_that_it_took_to_notice_counts_for_nothing_either() -> None:
    base = Obedience()
    passed = [base.take_in(k * TICK_S, Motion(0.5, 0.0), (0.0, 0.0)) for k in range(61)]
    assert sum(passed) == pytest.approx(3.0)


def test_drive_that_has_ended_tells_how_it_ended(track: Track) -> None:
    """Somebody pushes a base that does not obey to its goal."""
    track.go(3.0, forward=False, backward=False)
    assert "does not obey" in track.outputs[-1].reason
    for x in np.arange(track.x, 4.0, 0.05):
        track.x = x
        track.go(TICK_S, forward=False, backward=False)
    assert (track.outputs[-1].state, track.outputs[-1].reason) == (FollowerState.REACHED, "at the goal")
