"""The tilting mount calibrates itself: from sweeps to its offset, scale, backlash and roll, which `TiltGeometry` applies."""

from mount_calibration.calibration_file import DEFAULT_FILE, RECORDED_FILE, named_calibration, read_calibration, write_calibration
from mount_calibration.config import MountCalibrationConfig, asked_sweeps
from mount_calibration.estimate import MountEstimate, estimate_mount
from mount_calibration.geometry import TiltGeometry
from mount_calibration.report import estimate_table
from mount_calibration.tilt_calibration import PARAMETERS, TiltCalibration, TiltDirection, tilt_directions
from mount_calibration.tilted_beams import Place, TiltedBeams, joined_places, steady_directions
from mount_calibration.watch import MountVerdict, MountWatch, MountWatchConfig

__all__ = [
    "DEFAULT_FILE",
    "PARAMETERS",
    "RECORDED_FILE",
    "MountCalibrationConfig",
    "MountEstimate",
    "MountVerdict",
    "MountWatch",
    "MountWatchConfig",
    "Place",
    "TiltCalibration",
    "TiltDirection",
    "TiltGeometry",
    "TiltedBeams",
    "asked_sweeps",
    "estimate_mount",
    "estimate_table",
    "joined_places",
    "named_calibration",
    "read_calibration",
    "steady_directions",
    "tilt_directions",
    "write_calibration",
]
