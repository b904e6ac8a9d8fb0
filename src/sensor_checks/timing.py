"""Whether an input's messages come often, soon and in order, and whether the inputs' clocks agree."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sensor_checks.limits import CheckLimits, Needs
from sensor_checks.rows import Level, Row, judged

FloatArray = NDArray[np.float64]
_JUMP_S = 0.5  # a stamp that goes back by more is a clock that jumped
_MOST_REPEATED = 0.02  # share of messages that may come twice or late


@dataclass(frozen=True)
class Heard:
    """When a message came, by the steady clock and by the robot's, and the stamp that it bears; seconds.

    `duration_s`: how long after the stamp its last beam was fired, as it says itself.
    """

    arrival_s: float
    clock_s: float
    stamp_s: float
    duration_s: float = 0.0


def timing_rows(topic: str, heard: Sequence[Heard], needs: Needs, looked_s: float, limits: CheckLimits) -> list[Row]:
    """Rate and jitter, age, pauses and order of one input that was listened to for `looked_s` seconds."""
    if not heard:
        return [Row(Level.ERROR, topic, "messages", f"none in {looked_s:.0f} s", f"start its driver, or remap {topic} to its topic")]
    stamps, arrivals = np.array([h.stamp_s for h in heard]), np.array([h.arrival_s for h in heard])
    if not (stamps > 0.0).all():
        found = f"{int((stamps <= 0.0).sum())} of {len(stamps)} are zero"
        return [Row(Level.ERROR, topic, "stamps", found, "the driver must stamp each message with the time of its measurement")]
    rows = [_rate(topic, stamps, arrivals, needs, looked_s), _age(topic, heard, needs, limits), _order(topic, stamps)]
    return rows + _pauses(topic, stamps, needs)


def clock_rows(heard: Mapping[str, Sequence[Heard]], limits: CheckLimits, tilt: tuple[str, str] | None = None) -> list[Row]:
    """Whether the inputs' stamps are of one clock: the least age of each, by which its latency is taken out as far as it can be.

    `tilt`: topics of the tilt and of the laser that it tilts. These two are compared more strictly, as far as their jitter allows.
    """
    ages = {topic: _latencies(found) for topic, found in heard.items() if found}
    if len(ages) < 2:
        return []
    found, apart_s = _apart(ages, limits)
    advice = "give their computers one clock (chrony), or let the drivers stamp with the host's time"
    rows = [judged("clocks", "of inputs", found, (apart_s > limits.apart_s, Level.ERROR, advice))]
    if tilt is None or not all(topic in ages for topic in tilt):
        return rows
    found, apart_s = _apart({topic: ages[topic] for topic in tilt}, limits)
    sure_s = limits.tilt_apart_s + sum(_deviation(ages[topic]) for topic in tilt)
    advice = "a beam is tilted as the mount stood then: let both drivers stamp with the time of measurement"
    return [*rows, judged("clocks", "of tilt and laser", found, (apart_s > sure_s, Level.WARN, advice))]


def _latencies(heard: Sequence[Heard]) -> FloatArray:
    """(N,) ages at the last beam, s; of readings that come before it, and hence bear another stamp than the first beam's, at the stamp."""
    ages, durations = np.array([(h.clock_s - h.stamp_s, h.duration_s) for h in heard]).T
    return np.asarray(ages - durations if np.median(ages - durations) >= 0.0 else ages)


def _apart(ages: Mapping[str, FloatArray], limits: CheckLimits) -> tuple[str, float]:
    """How far the oldest is behind the newest, in words and in seconds."""
    least = {topic: float(found.min()) for topic, found in ages.items()}
    oldest, newest = max(least, key=least.__getitem__), min(least, key=least.__getitem__)
    apart_s = least[oldest] - least[newest]
    return f"{oldest} is {_seconds(apart_s)} behind {newest}" if apart_s > limits.ahead_s else f"agree within {_seconds(apart_s)}", apart_s


def _rate(topic: str, stamps: FloatArray, arrivals: FloatArray, needs: Needs, looked_s: float) -> Row:
    rate_hz = len(stamps) / looked_s
    steps = np.diff(np.unique(stamps))
    jitter = f", jitter {100.0 * _spread(steps):.1f} %" if len(steps) > 2 else ""
    advice = f"at least {needs.least_rate_hz:g} Hz are needed: raise the driver's rate"
    slow = f"below {needs.steady_rate_hz:g} Hz the robot twitches: raise ~follower/max_input_age_s of move_base_node, and drive slower"
    return judged(
        topic,
        "rate",
        f"{rate_hz:.1f} Hz{jitter}",
        (rate_hz < needs.least_rate_hz, Level.ERROR, advice),
        (rate_hz < needs.steady_rate_hz, Level.WARN, slow),
    )


def _spread(steps: FloatArray) -> float:
    """Their deviation over their median."""
    return _deviation(steps) / float(np.median(steps))


def _deviation(values: FloatArray) -> float:
    """Half the middle two thirds: a standard deviation that lost messages do not raise."""
    low, high = np.percentile(values, [16, 84])
    return float((high - low) / 2.0)


def _age(topic: str, heard: Sequence[Heard], needs: Needs, limits: CheckLimits) -> Row:
    ages, durations = np.array([(h.clock_s - h.stamp_s, h.duration_s) for h in heard]).T
    middle, late, after_last = float(np.median(ages)), float(np.percentile(ages, 95)), float(np.median(ages - durations))
    other_clock = "its clock is not the robot's: synchronise it (chrony), or let the driver stamp with the host's time"
    return judged(
        topic,
        "age",
        f"{_seconds(middle)} when it comes, {_seconds(late)} at most"
        if middle >= 0.0
        else f"stamped {_seconds(-middle)} ahead of the clock",
        (abs(middle) > 10.0, Level.ERROR, other_clock),
        (middle < -limits.ahead_s, Level.ERROR, other_clock),
        (middle > needs.max_age_s, Level.ERROR, f"at most {needs.max_age_s:g} s are usable: {other_clock}"),
        (
            float(np.median(durations)) > 0.0 > after_last,
            Level.WARN,
            f"it comes {_seconds(-after_last)} before its last beam: its stamp is not that of the first beam, or its clock is ahead; "
            "set the driver to that of the first beam",
        ),
        (late > needs.max_age_s, Level.WARN, f"at most {needs.max_age_s:g} s are usable: the network or the computer is busy"),
    )


def _order(topic: str, stamps: FloatArray) -> Row:
    steps = np.diff(stamps)
    repeated, back = int((steps == 0.0).sum()), int((steps < 0.0).sum())
    jump_s = float(-steps.min()) if back else 0.0
    texts = [f"{repeated} of {len(stamps)} stamps come twice"] * (repeated > 0) + [f"{back} go back, by {_seconds(jump_s)} at most"] * (
        back > 0
    )
    return judged(
        topic,
        "order",
        "; ".join(texts) or "each stamp later than the one before",
        (jump_s > _JUMP_S, Level.ERROR, "time jumps back: two drivers on one topic, or a clock that was set; see rostopic info"),
        (
            repeated + back > _MOST_REPEATED * len(stamps),
            Level.WARN,
            "these are dropped: two drivers on one topic, or a driver that sends old data again",
        ),
    )


def _pauses(topic: str, stamps: FloatArray, needs: Needs) -> list[Row]:
    steps = np.diff(np.unique(stamps))
    longest_s = float(steps.max()) if len(steps) else 0.0
    if longest_s <= needs.max_gap_s:
        return []
    advice = f"one over {needs.max_gap_s:g} s spoils a sweep, and after 0.3 s the robot stops: see cable, network and the computer's load"
    return [Row(Level.WARN, topic, "pauses", f"{int((steps > needs.max_gap_s).sum())}, up to {_seconds(longest_s)}", advice)]


def _seconds(duration_s: float) -> str:
    """In the unit that one reads."""
    if abs(duration_s) < 1.0:
        return f"{1000.0 * duration_s:.0f} ms"
    return f"{duration_s:.2f} s" if abs(duration_s) < 1000.0 else f"{duration_s:.0f} s"
