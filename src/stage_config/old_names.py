"""Names that parameters had, by "section/name" or "name", and where the same is said now: an old file is told, not misread."""

_TURNING = "robot.yaml: length_m and width_m, whose corner it reaches"
OLD_NAMES = {
    "base_height_m": "robot.yaml: base_height_m",
    "terrain/base_height_m": "robot.yaml: base_height_m",
    "terrain/robot_height_m": "robot.yaml: height_m",
    "terrain/max_step_m": "robot.yaml: max_step_m",
    "terrain/max_slope_rad": "robot.yaml: max_slope_rad",
    "terrain/inflation_radius_m": _TURNING,
    "terrain/cliff_inflation_radius_m": _TURNING,
    "terrain/narrow_radius_m": "robot.yaml: width_m and straying_m; passages/enabled false drives no passage",
    "terrain/narrow_cliff_radius_m": "robot.yaml: track_m, wheel_width_m, straying_m and straying_rad",
    "terrain/narrow_width_m": "robot.yaml: width_m",
    "costmap/inscribed_radius_m": "robot.yaml: width_m",
    "costmap/overhead_clearance_m": "robot.yaml: height_m, and costmap/overhead_margin_m above it",
    "follower/footprint_length_m": "robot.yaml: length_m",
    "follower/footprint_width_m": "robot.yaml: width_m",
    "follower/turn_slide_m": "robot.yaml: turning_slide_m, of which follower/turn_slide_factor wants room",
    "body_min_m": "robot.yaml: length_m, width_m, base_height_m and own_echo_margin_m",
    "body_max_m": "robot.yaml: length_m, width_m, height_m and own_echo_margin_m",
    "turning_slide_m": "robot.yaml: turning_slide_m",
    "wheel_contact_slope_rad": "robot.yaml: max_step_m and wheel_radius_m, and wheel_contact_margin_rad beyond it",
    "track_factor": "robot.yaml: effective_track_factor",
    "max_speed_mps": "robot.yaml: max_speed_mps",
    "max_turn_rate_rps": "robot.yaml: max_turn_rate_radps",
}
