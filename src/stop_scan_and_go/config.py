"""Parameters of stop, scan and go and the only home of their defaults."""

from dataclasses import dataclass

from stage_config import check_ranges, parameter


@dataclass(frozen=True)
class StopScanAndGoConfig:
    """When to sweep, what standing still means, and how long to wait for what."""

    max_input_age_s: float = parameter(
        0.3, "s", "the robot stands when odometry, joint states or the follower's command are older than this", low=0.05, high=5.0
    )
    teleop_topic: str = parameter("joy_teleop/cmd_vel", "-", "a Twist here drives the robot in place of the follower's command")
    teleop_hold_s: float = parameter(0.5, "s", "for so long after it came", low=0.05, high=10.0, at_runtime=True)
    max_distance_m: float = parameter(
        2.5, "m", "distance since the last sweep that asks for the next", low=0.2, high=100.0, at_runtime=True
    )
    nod_patience_s: float = parameter(
        6.0, "s", "while driving: a robot that has stood so long without a decision asks the mount again to nod", low=1.0, high=60.0
    )
    max_backward_m: float = parameter(
        0.5,
        "m",
        "while driving: the way backward after which it stands for a whole sweep: the laser that nods does not see behind",
        low=0.1,
        high=100.0,
    )
    max_yaw_rad: float = parameter(
        3.5, "rad", "sum of turns since the last sweep that asks for the next", low=0.3, high=100.0, at_runtime=True
    )
    max_slope_turn_rad: float = parameter(
        2.0,
        "rad",
        "sum of turns in place on a slope since the last sweep after which the next comes before it drives on: in these a skid steer "
        "slides downhill, by up to a quarter of a metre for every radian, and its odometry knows that roughly",
        low=0.1,
        high=100.0,
        at_runtime=True,
    )
    max_pose_sigma_m: float = parameter(
        0.03, "m", "where motion is tracked against the map: sigma of the position that asks for the next sweep", low=0.001, high=1.0
    )
    max_tracked_distance_m: float = parameter(
        3.0,
        "m",
        "and the distance since the last sweep that asks for it: the costmap's terrain ends 4 m from that, half of size_m of "
        "octomap_server_3dnav_local_node, and the robot's front is to stand before",
        low=0.2,
        high=100.0,
    )
    slope_rad: float = parameter(0.035, "rad", "ground that tilts the robot more than this is a slope", low=0.0, high=1.6)
    still_time_s: float = parameter(0.5, "s", "the robot must have been still so long before a sweep", low=0.0, high=10.0, at_runtime=True)
    still_speed_mps: float = parameter(0.02, "m/s", "slower than this is still", low=0.0, high=0.5)
    still_turn_rate_radps: float = parameter(0.02, "rad/s", "turning slower than this is still", low=0.0, high=0.5)
    still_rocking_radps: float = parameter(
        0.01, "rad/s", "rolling and pitching slower than this is still: on rocks a robot tips over onto other wheels", low=0.0, high=0.5
    )
    settle_limit_s: float = parameter(
        20.0, "s", "a robot that is not still after this time is swept all the same, and counted", low=0.5, high=120.0
    )
    level_tilt_rad: float = parameter(0.02, "rad", "the laser is horizontal within this angle", low=0.001, high=0.2)
    level_rate_radps: float = parameter(0.04, "rad/s", "and stands when it tilts slower: a sweep passes the horizon", low=0.0, high=1.0)
    left_tilt_rad: float = parameter(0.3, "rad", "tilted more than this the sweep has begun", low=0.05, high=3.0)
    sweep_start_limit_s: float = parameter(
        3.0, "s", "a sweep that has not begun by then is asked for again, three times", low=0.1, high=60.0
    )
    sweep_limit_s: float = parameter(30.0, "s", "a sweep that has not ended after this time has failed", low=1.0, high=600.0)
    cloud_limit_s: float = parameter(
        10.0,
        "s",
        "a sweep of which no cloud has come so long after its end is made again, three times; not in lock-step",
        low=1.0,
        high=600.0,
    )
    decision_limit_s: float = parameter(
        120.0,
        "s",
        "time to wait for a decision where the clock does not stand, as on a real robot; then one more sweep is made",
        low=1.0,
        high=3600.0,
    )

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        problems = check_ranges(self)
        if not self.teleop_topic:
            problems.append("teleop_topic is empty: it is the topic of a joystick's Twist")
        if self.left_tilt_rad <= self.level_tilt_rad:
            problems.append(f"left_tilt_rad = {self.left_tilt_rad} is not above level_tilt_rad = {self.level_tilt_rad}")
        if self.sweep_limit_s <= self.sweep_start_limit_s:
            problems.append(f"sweep_limit_s = {self.sweep_limit_s} is not above sweep_start_limit_s = {self.sweep_start_limit_s}")
        return problems
