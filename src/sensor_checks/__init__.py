"""Judges a robot's inputs by what they say themselves: their timing, units, layout and mounting.

Stands before every stage: `odometry_fusion` asks it whether an IMU can be believed, and the program `check_robot` about all inputs.
"""

from sensor_checks.imu_units import ImuLimits, gravity_fault, turning_fault
from sensor_checks.limits import NEEDS, CheckLimits, Needs
from sensor_checks.rows import Level, Row, judged, table, worst
from sensor_checks.timing import Heard, clock_rows, timing_rows
from sensor_checks.wheel_twist import TwistWatch

__all__ = [
    "NEEDS",
    "CheckLimits",
    "Heard",
    "ImuLimits",
    "Level",
    "Needs",
    "Row",
    "TwistWatch",
    "clock_rows",
    "gravity_fault",
    "judged",
    "table",
    "timing_rows",
    "turning_fault",
    "worst",
]
