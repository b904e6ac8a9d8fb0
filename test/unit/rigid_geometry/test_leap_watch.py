"""A covariance that leaps is told from one that grows as a robot drives, or falls."""

from rigid_geometry import LeapWatch


def test_only_a_leap_of_a_metre_says_that_nothing_is_known_of_the_way() -> None:
    watch = LeapWatch()
    variances = [400.0, 400.0, 400.9, 401.8, 0.0001, 0.8, 26.0, 26.0]
    assert [watch.leapt(v, 0.0) for v in variances] == [False] * 6 + [True, False]


def test_either_axis_leaps() -> None:
    watch = LeapWatch()
    assert not watch.leapt(0.01, 0.01) and watch.leapt(0.01, 25.0)
