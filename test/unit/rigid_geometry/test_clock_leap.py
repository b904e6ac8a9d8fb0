"""A step of stamps that is no time that went by."""

import pytest

from rigid_geometry import clock_leap_s


@pytest.mark.parametrize(
    ("before_s", "now_s", "leapt_s"),
    [(None, 100.0, 0.0), (100.0, 100.0, 0.0), (100.0, 160.0, 0.0), (100.0, 160.5, 60.5), (100.0, 99.5, -0.5), (100.0, -3500.0, -3600.0)],
)
def test_clock_leaps_backward_or_farther_than_anything_is_silent(before_s: float | None, now_s: float, leapt_s: float) -> None:
    assert clock_leap_s(before_s, now_s) == leapt_s


def test_how_long_a_silence_may_be_is_for_who_asks() -> None:
    assert (clock_leap_s(1.0, 2.0, 1.0), clock_leap_s(1.0, 2.5, 1.0)) == (0.0, 1.5)
