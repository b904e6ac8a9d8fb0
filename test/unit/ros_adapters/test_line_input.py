"""Lines as a node hears them: what pauses they stand, and the word that there is none."""

from typing import Any

import numpy as np
import pytest
import rospy

from mount_calibration import TiltGeometry
from ros_adapters import line_input
from ros_adapters.line_input import LineInput
from sweep_assembly import LidarConfig, Scan, ScanGeometry

PERIOD_S, MAX_AGE_S = 0.025, 0.3


class Hearing:
    """In the place of a node: it only says what it would hear."""

    name = "x"

    def __init__(self) -> None:
        self.heard: dict[str, Any] = {}

    def subscribe(self, topic: str, _type: type, callback: Any, **_: object) -> None:
        self.heard[topic] = callback


def lines_of(monkeypatch: pytest.MonkeyPatch, joint_period_s: float, range_m: float = 2.0, **parameters: float) -> LineInput:
    """A second of scans that read `range_m`, odometry and joint states, with the parameters that the assembler has."""
    monkeypatch.setattr(rospy, "get_param", lambda name, default=None: parameters.get(name.rpartition("/")[2], default))
    monkeypatch.setattr(rospy, "resolve_name", lambda name: f"/{name}")
    monkeypatch.setattr(line_input, "sensor_is_spinning", lambda _: False)
    lines = LineInput(Hearing(), LidarConfig(), "tilt", TiltGeometry(np.eye(4), np.eye(4)), "laser")  # type: ignore[arg-type]
    scan = Scan(ScanGeometry(-0.5, 0.1, 0.0, 11), np.full(11, range_m, np.float32), 0.1, 10.0, PERIOD_S)
    for k in range(41):
        lines.add_odometry(k * PERIOD_S, np.eye(4))
        lines._lines.add_reading(k * PERIOD_S, scan)
    for stamp_s in np.arange(0.0, 1.2, joint_period_s):
        lines._lines.add_joint(float(stamp_s), 0.1)
    return lines


def test_line_that_is_there_is_not_missing_until_it_is_old(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = lines_of(monkeypatch, 0.02)
    assert lines.missing(1.0, MAX_AGE_S) == "no line of /scan_filtered"
    assert len(list(lines.poll())) > 30
    assert (lines.missing(1.0, MAX_AGE_S), lines.missing(1.2, MAX_AGE_S)) == ("", "")
    assert lines.missing(1.4, MAX_AGE_S) and lines.missing(-100.0, MAX_AGE_S), "nor is one from before the clock was set back"


def test_lines_stand_the_pauses_that_sweeps_stand_and_say_when_they_do_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """Joint states eight times a second: who raises the assembler's gap for them is not left blind while he drives."""
    blind = lines_of(monkeypatch, 0.127)
    assert len(list(blind.poll())) <= 1 and "scan_without_joints" in blind.missing(1.0, MAX_AGE_S)
    lines = lines_of(monkeypatch, 0.127, max_joint_gap_s=0.26)
    assert len(list(lines.poll())) > 30 and lines.missing(1.0, MAX_AGE_S) == ""


def test_laser_whose_every_beam_is_invalid_sees_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plug half out, a covered lens: scans go on, and nothing is dropped. The filter has made NaN of what is no reading."""
    blind = lines_of(monkeypatch, 0.02, float("nan"))
    assert len(list(blind.poll())) > 30
    assert blind.missing(1.0, MAX_AGE_S) == "the laser sees nothing: no valid beam on /scan_filtered"
    assert "no line" in blind.missing(1.4, MAX_AGE_S), "later it does not speak, either"


def test_laser_that_has_nothing_in_range_sees(monkeypatch: pytest.MonkeyPatch) -> None:
    free = lines_of(monkeypatch, 0.02, float("inf"))
    assert len(list(free.poll())) > 30 and free.missing(1.0, MAX_AGE_S) == ""
