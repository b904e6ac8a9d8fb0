"""Stop, scan and go: the last of the driving chain, which decides when the robot drives and when it stands for a sweep.

Forwards the follower's commands to the wheels until the goal is reached, or until so many metres or radians have passed since the
last sweep (thesis 6.2.1); then stops, has a sweep made, and waits for what the planner decides. It answers every tick of the
simulator, and lets the clock stand while it waits.
"""

from stop_scan_and_go.config import StopScanAndGoConfig
from stop_scan_and_go.interface import Decision, DriveState, SweepKind, TickAction, TickObservation
from stop_scan_and_go.machine import StopScanAndGo
from stop_scan_and_go.scan_while_driving import LookWhileDriving, ScanWhileDriving

__all__ = [
    "Decision",
    "DriveState",
    "LookWhileDriving",
    "ScanWhileDriving",
    "StopScanAndGo",
    "StopScanAndGoConfig",
    "SweepKind",
    "TickAction",
    "TickObservation",
]
