"""The last guard before the wheels: slows and stops the robot before what the map does not know, whatever the follower wants.

`CollisionMonitor.limited` gets a command and the newest strangers, and gives back as much of the command as is safe. Plain Python.
"""

from collision_monitor.config import CollisionMonitorConfig
from collision_monitor.monitor import CollisionMonitor, seen_from

__all__ = ["CollisionMonitor", "CollisionMonitorConfig", "seen_from"]
