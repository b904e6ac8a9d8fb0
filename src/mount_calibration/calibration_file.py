"""A calibration as a YAML file: one line a parameter, and the covariance; `.inf` stands for what was not measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml

from mount_calibration.tilt_calibration import NOMINAL, PARAMETERS, TiltCalibration
from stage_config import yaml_values
from whole_files import write_whole

SECTION = "mount_calibration"
DEFAULT_FILE = Path("~/.ros/explore_3dnav/mount_calibration.yaml")
RECORDED_FILE = "mount_calibration.yaml"
"""In a run's folder beside robot.yaml: the calibration that the nodes applied in the run, where they did."""
_HEAD = "# How the tilting mount differs from the robot's description: radians, scale as a ratio. Written by calibrate_mount.\n"


def write_calibration(calibration: TiltCalibration, path: Path) -> None:
    """Writes the file whole or not at all; OSError when it cannot be written, ValueError for a calibration that is none."""
    if problems := calibration.validate():
        raise ValueError("; ".join(problems))
    values: dict[str, object] = dict(zip(PARAMETERS, calibration.values.tolist(), strict=True))
    values["covariance"] = np.asarray(calibration.covariance, dtype=np.float64).tolist()
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, _HEAD + yaml.safe_dump({SECTION: values}, sort_keys=False, default_flow_style=None))


def read_calibration(path: Path) -> TiltCalibration:
    """The calibration of a file; ValueError in one line that names file and field when it is none, OSError when it cannot be read."""
    try:
        read = yaml_values(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: no YAML: {' '.join(str(error).split())}") from error
    values = read.get(SECTION) if isinstance(read, dict) else None
    if not isinstance(values, dict):
        raise ValueError(f"{path}: has no section {SECTION}; calibrate_mount writes such a file")
    if unknown := [str(key) for key in values if key not in (*PARAMETERS, "covariance")]:
        raise ValueError(f"{path}: unknown {', '.join(unknown)}; known: {', '.join((*PARAMETERS, 'covariance'))}")
    calibration = _calibration(path, values)
    if problems := calibration.validate():
        raise ValueError(f"{path}: {'; '.join(problems)}")
    return calibration


def named_calibration(name: str) -> TiltCalibration:
    """The calibration that a parameter or an argument names: a path, "auto" for `DEFAULT_FILE` where it exists, empty for none.

    ValueError in one line when the file is none, or cannot be read.
    """
    path = Path(name if name != "auto" else DEFAULT_FILE).expanduser()
    if not name or (name == "auto" and not path.exists()):
        return TiltCalibration()
    try:
        return read_calibration(path)
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror}; calibrate_mount writes it, empty means none") from error


def _calibration(path: Path, values: dict[str, object]) -> TiltCalibration:
    numbers = []
    for name, nominal in zip(PARAMETERS, NOMINAL, strict=True):
        value = values.get(name, nominal)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ValueError(f"{path}: {name} = {value!r} is no number")
        numbers.append(float(value))
    if "covariance" not in values:
        return TiltCalibration.of_values(numbers)
    try:
        return TiltCalibration.of_values(numbers, np.array(values["covariance"], dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path}: covariance is no matrix of numbers") from error
