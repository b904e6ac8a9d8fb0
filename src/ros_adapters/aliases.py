"""Second names: what a client or an rviz file calls a topic or service that was written for move_base."""

ALIASES = {
    "move_base/current_plan": "move_base/NavfnROS/plan",
    "local_costmap/costmap": "move_base/local_costmap/costmap",
    "local_costmap/costmap_updates": "move_base/local_costmap/costmap_updates",
    "local_costmap/footprint": "move_base/local_costmap/footprint",
    "projected_map": "move_base/global_costmap/costmap",
    "~clear_costmaps": "move_base/clear_costmaps",
    "~make_plan": "move_base/make_plan",
}
"""By the name that the node gives, the other one under which the same is published or served."""
