"""Path following: from a planned path, a pose and a local costmap to the next velocity command.

Stands between the planner's path (service storePlan, thesis 6.2.2) and `/cmd_vel/move_base` (6.2.1). Regulated pure pursuit on
the path, turns in place at sharp corners and at the goal, a footprint check of every motion before it is commanded, and a
recovery that ends with a reason. Any object with `cost`, `origin_xy` and `resolution` serves as costmap.
"""

from path_following.config import FollowerConfig
from path_following.follower import PathFollower
from path_following.interface import FollowerObservation, FollowerOutput, FollowerState

__all__ = ["FollowerConfig", "FollowerObservation", "FollowerOutput", "FollowerState", "PathFollower"]
