"""A clock that is set while nodes run: which step from one stamp to the next is time that went by, and which is none."""

LONGEST_SILENCE_S = 60.0
"""No sensor and no follower of a run is silent for so long: a longer step is a clock that was set."""


def clock_leap_s(before_s: float | None, now_s: float, longest_s: float = LONGEST_SILENCE_S) -> float:
    """The step between two stamps in seconds where it is no time that went by: backward, or longer than `longest_s`; else 0."""
    step_s = 0.0 if before_s is None else now_s - before_s
    return 0.0 if 0.0 <= step_s <= longest_s else step_s
