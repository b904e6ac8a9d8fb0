"""The watch: silent while the mount is as calibrated, and clear when it has moved."""

import math

import numpy as np
import pytest
from room_sweeps import AT, T_BASE_MOUNT, T_TILT_LASER, place

from mount_calibration import MountCalibrationConfig, MountVerdict, MountWatch, MountWatchConfig, TiltCalibration, TiltGeometry
from rigid_geometry import transform_from_rpy
from robot_body import RobotBody

DEG = math.radians(1.0)
MEASURED = np.diag([1e-7, 1e-9, 1e-8, 1e-7, np.inf])
KNOWN = TiltCalibration(0.4 * DEG, 1.005, 0.3 * DEG, -0.4 * DEG, 0.0, MEASURED)


def watched(known: TiltCalibration, truth: TiltCalibration, sweeps: int = 2) -> MountVerdict:
    watch = MountWatch(TiltGeometry(T_BASE_MOUNT, T_TILT_LASER, known), MountWatchConfig(), MountCalibrationConfig(), RobotBody())
    verdicts = [watch.after(place(truth, AT @ transform_from_rpy((0.3 * k, 0.0, 0.0), (0.0, 0.0, 0.5 * k)), seed=k)) for k in range(sweeps)]
    return verdicts[-1]


def test_mount_that_is_as_calibrated_is_not_reported() -> None:
    verdict = watched(KNOWN, KNOWN, sweeps=3)
    assert verdict.moved is False and "as calibrated" in verdict.text


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ((0.0, 0.004, 0.0, 0.0), "scale by +0."),
        ((0.0, 0.0, 0.25 * DEG, 0.0), "backlash by +0.2"),
        ((1.0 * DEG, 0.0, 0.0, 0.0), "offset by"),
    ],
)
def test_mount_that_moved_is_reported_with_what_changed(change: tuple[float, ...], said: str) -> None:
    truth = TiltCalibration.of_values(KNOWN.values + np.array([*change, 0.0]))
    verdict = watched(KNOWN, truth)
    assert verdict.moved and verdict.text.startswith("the mount has moved") and said in verdict.text


def test_mount_that_was_never_calibrated_and_is_off_is_told_so() -> None:
    verdict = watched(TiltCalibration(), KNOWN)
    assert verdict.moved and verdict.text.startswith("the mount is not calibrated") and "scale" in verdict.text


def test_one_sweep_or_none_says_nothing() -> None:
    assert watched(KNOWN, TiltCalibration(), sweeps=1).moved is None
    watch = MountWatch(TiltGeometry(T_BASE_MOUNT, T_TILT_LASER), MountWatchConfig(), MountCalibrationConfig(), RobotBody())
    assert watch.after(None) == MountVerdict(None, "0 of 2 sweeps compared with the mount's calibration", 0)


def test_of_one_sweep_the_newest_is_heard() -> None:
    config = MountWatchConfig(sweeps=1, least_sweeps=1)
    watch = MountWatch(TiltGeometry(T_BASE_MOUNT, T_TILT_LASER, KNOWN), config, MountCalibrationConfig(), RobotBody())
    for k in range(3):
        verdict = watch.after(place(KNOWN, AT @ transform_from_rpy((0.3 * k, 0.0, 0.0), (0.0, 0.0, 0.5 * k)), seed=k))
    assert verdict.sweeps == 1


def test_wrong_configuration_is_refused() -> None:
    with pytest.raises(ValueError, match="least_sweeps"):
        MountWatch(TiltGeometry(T_BASE_MOUNT, T_TILT_LASER), MountWatchConfig(sweeps=1), MountCalibrationConfig(), RobotBody())


@pytest.mark.parametrize("play_rad", [0.0, 0.3 * DEG])
def test_first_sweep_of_a_resting_robot_tells_the_play_and_none_before(play_rad: float) -> None:
    watch = MountWatch(TiltGeometry(T_BASE_MOUNT, T_TILT_LASER), MountWatchConfig(), MountCalibrationConfig(), RobotBody())
    assert watch.backlash() is None
    watch.after(None)
    assert watch.backlash() is None
    watch.after(place(TiltCalibration(backlash_rad=play_rad), AT, seed=3))
    assert watch.backlash() == pytest.approx(play_rad, abs=0.03 * DEG)
