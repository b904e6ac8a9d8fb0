"""The calibration as a value, a file, and a correction of measured tilts."""

import math
from pathlib import Path

import numpy as np
import pytest
from room_sweeps import T_BASE_MOUNT, T_TILT_LASER

from mount_calibration import (
    DEFAULT_FILE,
    PARAMETERS,
    TiltCalibration,
    TiltDirection,
    TiltGeometry,
    asked_sweeps,
    named_calibration,
    read_calibration,
    tilt_directions,
    write_calibration,
)
from rigid_geometry import transform_from_rpy

DEG = math.radians(1.0)


def measured(*names: str) -> np.ndarray:
    """A covariance in which these were measured."""
    return np.diag([1e-8 if name in names else np.inf for name in PARAMETERS])


def test_identity_is_no_calibration_and_changes_nothing() -> None:
    identity = TiltCalibration()
    assert identity.is_nominal and not identity.measured.any() and identity.validate() == []
    assert identity.true_tilt([0.1, -2.0], [1.0, -1.0]).tolist() == [0.1, -2.0]
    plain = TiltGeometry(T_BASE_MOUNT, T_TILT_LASER).base_from_laser(0.3)[0]
    turn = transform_from_rpy((0.0, 0.0, 0.0), (0.0, 0.3, 0.0))
    np.testing.assert_allclose(plain, T_BASE_MOUNT @ turn @ T_TILT_LASER, atol=1e-15)


def test_true_tilt_lags_behind_by_half_of_the_backlash_either_way() -> None:
    mount = TiltCalibration(offset_rad=0.01, scale=1.1, backlash_rad=0.004)
    np.testing.assert_allclose(mount.true_tilt([1.0, 1.0, 1.0], [1.0, -1.0, 0.0]), [1.108, 1.112, 1.11])


def test_roll_and_offset_turn_the_laser_s_pose() -> None:
    calibration = TiltCalibration(0.01, 1.0, 0.0, 0.02, 0.03)
    pose = TiltGeometry(T_BASE_MOUNT, T_TILT_LASER, calibration).base_from_laser(0.5)[0]
    turns = [(0.02, 0.0, 0.0), (0.0, 0.03, 0.0), (0.0, 0.51, 0.0)]
    expected = T_BASE_MOUNT
    for rpy in turns:
        expected = expected @ transform_from_rpy((0.0, 0.0, 0.0), rpy)
    np.testing.assert_allclose(pose, expected @ T_TILT_LASER, atol=1e-12)


def test_points_and_poses_agree() -> None:
    mount = TiltGeometry(T_BASE_MOUNT, T_TILT_LASER, TiltCalibration(0.01, 1.005, 0.004, -0.02, 0.005))
    points, tilts, directions = np.array([[1.0, 2.0, 0.0], [3.0, -1.0, 0.5]]), np.array([0.4, -0.2]), np.array([1.0, -1.0])
    poses = mount.base_from_laser(tilts, directions)
    one_by_one = [T[:3, :3] @ p + T[:3, 3] for T, p in zip(poses, points, strict=True)]
    np.testing.assert_allclose(mount.points_in_base(points, tilts, directions), one_by_one, atol=1e-12)


def test_direction_is_held_at_rest_and_through_noise() -> None:
    tilts = np.array([0.0, 0.1, 0.2, 0.1999, 0.2, 0.2, 0.1, 0.1, 0.1001])
    directions = tilt_directions(tilts, 0.005)
    np.testing.assert_allclose(directions[[1, 2, 5, 6, 7]], [1.0, 1.0, 1.0, -1.0, -1.0])
    assert directions[3] > 0.9 and directions[8] < -0.9


def test_play_is_crossed_before_the_true_tilt_follows() -> None:
    mount = TiltCalibration(backlash_rad=0.01)
    direction = TiltDirection(0.01)
    true = [float(mount.true_tilt(tilt, direction.after(tilt))) for tilt in (0.0, 0.1, 0.096, 0.092, 0.088)]
    np.testing.assert_allclose(true[1:], [0.095, 0.095, 0.095, 0.093])


def test_without_backlash_there_is_no_direction() -> None:
    assert TiltDirection(0.0).after(1.0) == 0.0


@pytest.mark.parametrize(
    ("calibration", "said"),
    [
        (TiltCalibration(offset_rad=math.nan), "offset_rad = nan"),
        (TiltCalibration(scale=2.0), "scale = 2.0"),
        (TiltCalibration(backlash_rad=-0.1), "backlash_rad"),
        (TiltCalibration(covariance=np.zeros((2, 2))), "covariance is no"),
        (TiltCalibration(covariance=-np.eye(5)), "positive definite"),
    ],
)
def test_what_is_no_calibration_is_told_and_refused_by_the_geometry(calibration: TiltCalibration, said: str) -> None:
    assert any(said in problem for problem in calibration.validate())
    with pytest.raises(ValueError, match=said.split(" ")[0]):
        TiltGeometry(T_BASE_MOUNT, T_TILT_LASER, calibration)


def test_file_gives_back_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "new" / "mount.yaml"
    written = TiltCalibration(0.4 * DEG, 1.005, 0.3 * DEG, 0.0, 0.0, measured("offset_rad", "scale", "backlash_rad"))
    write_calibration(written, path)
    read = read_calibration(path)
    assert read.values.tolist() == written.values.tolist() and np.array_equal(read.covariance, written.covariance)
    assert read.measured.tolist() == [True, True, True, False, False]
    assert [p.name for p in path.parent.iterdir()] == ["mount.yaml"]


def test_what_is_no_calibration_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="scale"):
        write_calibration(TiltCalibration(scale=math.nan), tmp_path / "mount.yaml")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "no YAML"),
        ("a: 1\na: 2", "key a stands in line 1, and again in line 2"),
        ("", "no section mount_calibration"),
        ("mount_calibration: 3", "no section"),
        ("mount_calibration: {ofset_rad: 0.1}", "unknown ofset_rad"),
        ("mount_calibration: {scale: one}", "scale = 'one' is no number"),
        ("mount_calibration: {scale: true}", "scale = True is no number"),
        ("mount_calibration: {scale: .nan}", "scale = nan"),
        ("mount_calibration: {covariance: [[1, 2], [3]]}", "covariance is no matrix"),
        ("mount_calibration: {covariance: {a: 1}}", "covariance is no matrix"),
        ("mount_calibration: {covariance: [[1.0]]}", "covariance is no"),
    ],
)
def test_bad_file_is_one_line_with_file_and_field(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "mount.yaml"
    path.write_text(text)
    with pytest.raises(ValueError) as error:
        read_calibration(path)
    assert said in str(error.value) and str(path) in str(error.value) and "\n" not in str(error.value)


def test_binary_file_is_no_calibration(tmp_path: Path) -> None:
    path = tmp_path / "mount.yaml"
    path.write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(ValueError, match="no YAML"):
        read_calibration(path)


def test_calibration_is_named_by_its_path_by_auto_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert named_calibration("").is_nominal and named_calibration("auto").is_nominal
    write_calibration(TiltCalibration(offset_rad=0.01), DEFAULT_FILE.expanduser())
    write_calibration(TiltCalibration(offset_rad=0.02), tmp_path / "mine.yaml")
    assert [named_calibration(name).offset_rad for name in ("", "auto", "~/mine.yaml")] == [0.0, 0.01, 0.02]
    with pytest.raises(ValueError, match="none.yaml cannot be read: No such file or directory; calibrate_mount writes it"):
        named_calibration(str(tmp_path / "none.yaml"))


def test_sweeps_are_a_whole_number_from_one_to_a_hundred() -> None:
    assert [asked_sweeps(value) for value in (1, "3", 100)] == [1, 3, 100]
    for value in (0, -1, 101, 2.5, True, "nan", "", None):
        with pytest.raises(ValueError, match=f"^sweeps:={value}: expected a whole number from 1 to 100"):
            asked_sweeps(value)
