"""Judges a robot's inputs by what they say themselves: their timing, units, layout and mounting.

Stands before every stage: `odometry_fusion` asks it whether an IMU can be believed, and the program `check_robot` about all inputs.
"""

from sensor_checks.imu_units import ImuLimits, gravity_fault, turning_fault

__all__ = ["ImuLimits", "gravity_fault", "turning_fault"]
