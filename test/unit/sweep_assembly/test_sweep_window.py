"""When a sweep of a resting mount, each half of a nod, and a part of a robot's way, begins and ends."""

from collections import Counter

import numpy as np
import pytest

from rigid_geometry import transform_from_rpy
from sweep_assembly.sweep_window import NodWindowDetector, SweepWindow, SweepWindowDetector, TravelWindowDetector

LOW, HIGH, HALF_S = 1.05, -0.26, 2.0


def nodding(stamp_s: float) -> float:
    """From level at 1 s down to the lower end at 2 s, then to and fro."""
    phase = np.interp((stamp_s - 2.0) % (2 * HALF_S), [0.0, HALF_S, 2 * HALF_S], [LOW, HIGH, LOW])
    return float(np.interp(stamp_s, [1.0, 2.0], [0.0, LOW])) if stamp_s < 2.0 else float(phase)


def whole_sweep(stamp_s: float) -> float:
    return float(np.interp(stamp_s, [1.0, 1.8, 5.8, 6.2], [0.0, 2.88, -0.61, 0.0]))


def windows(tilt_at, end_s: float, noise_rad: float = 0.0, dropped: Counter | None = None) -> list[SweepWindow]:
    rng, dropped = np.random.default_rng(1), Counter() if dropped is None else dropped
    detector = NodWindowDetector(SweepWindowDetector(0.01, 0.05, 10.0, dropped), 1.3, 0.3)
    found = [detector.add(t, tilt_at(t) + noise_rad * rng.standard_normal()) for t in np.arange(0.5, end_s, 0.02)]
    return [window for window in found if window is not None]


@pytest.mark.parametrize("noise_rad", [0.0, 0.002])
def test_each_half_of_a_nod_is_a_window_that_begins_where_the_last_one_ended(noise_rad: float) -> None:
    dropped: Counter[str] = Counter()
    found = windows(nodding, 30.0, noise_rad, dropped)
    assert [w.start_stamp_s for w in found] == pytest.approx([2.0 + HALF_S * k for k in range(len(found))], abs=0.041)
    assert len(found) == 13 and not any(w.from_rest for w in found)
    assert [w.end_stamp_s for w in found[:-1]] == [w.start_stamp_s for w in found[1:]]
    assert not dropped


def test_movement_from_rest_to_behind_the_robot_is_one_sweep_that_ends_at_rest() -> None:
    (window,) = windows(whole_sweep, 8.0)
    assert window.from_rest
    assert (window.start_stamp_s, window.end_stamp_s) == pytest.approx((1.0, 6.2), abs=0.021)


def test_sweep_nod_and_sweep_again() -> None:
    def tilt_at(stamp_s: float) -> float:
        if stamp_s < 8.0:
            return whole_sweep(stamp_s)
        if stamp_s < 8.0 + 5.6:  # stopped on the way up from the lower end, level
            return nodding(stamp_s - 8.0 + 1.0)
        return 0.0 if stamp_s < 16.0 else whole_sweep(stamp_s - 15.0)

    found = windows(tilt_at, 24.0)
    assert [w.from_rest for w in found] == [True, False, False, True]


def test_mount_that_trembles_makes_no_windows() -> None:
    assert not windows(lambda t: 0.05 * np.sin(5.0 * t), 20.0)


def test_mount_that_stops_nodding_ends_no_window() -> None:
    assert len(windows(lambda t: nodding(min(t, 5.0)), 60.0)) == 1


def travelled(pose_at, end_s: float) -> list[SweepWindow]:
    detector = TravelWindowDetector(1.0, 0.7, 2.0)
    found = [detector.add(float(t), pose_at(float(t))) for t in np.arange(0.0, end_s, 0.05).round(6)]
    return [window for window in found if window is not None]


@pytest.mark.parametrize(
    ("speed_mps", "turn_rps", "each_s"),
    [(0.8, 0.0, 1.25), (0.0, 0.89, 0.8), (0.0, -0.89, 0.8), (0.1, 0.1, 2.0), (0.0, 0.0, 2.0)],
    ids=["a metre", "a turn", "a turn to the right", "slow", "standing"],
)
def test_way_is_cut_into_windows_that_follow_on_each_other(speed_mps: float, turn_rps: float, each_s: float) -> None:
    found = travelled(lambda t: transform_from_rpy((speed_mps * t, 0.0, 0.0), (0.0, 0.0, turn_rps * t)), 6.2)
    assert [w.end_stamp_s - w.start_stamp_s for w in found] == pytest.approx([each_s] * int(6.15 / each_s))
    assert found[0].start_stamp_s == 0.0 and [w.end_stamp_s for w in found[:-1]] == [w.start_stamp_s for w in found[1:]]
    assert not any(w.from_rest for w in found)


def test_robot_that_comes_to_rest_is_swept_as_late_as_one_that_stands() -> None:
    ends = [w.end_stamp_s for w in travelled(lambda t: transform_from_rpy((0.8 * min(t, 2.0), 0.0, 0.0)), 6.0)]
    assert ends == pytest.approx([1.25, 3.25, 5.25])
