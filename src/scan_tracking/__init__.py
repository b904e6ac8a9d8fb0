"""Tracking against the map: odometry, corrected by what the laser or lidar sees of the surfaces that are mapped already.

Stands between odometry and sweep assembly. `ScanTracker` takes filtered readings, tilts, odometry and the map around the robot, and
gives a `TrackedPose` for every odometry sample.
"""

from scan_tracking.config import ScanTrackingConfig
from scan_tracking.tracker import ScanTracker, TrackedPose

__all__ = ["ScanTracker", "ScanTrackingConfig", "TrackedPose"]
