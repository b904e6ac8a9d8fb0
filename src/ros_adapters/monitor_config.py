"""What exploration_monitor_node is told: most of it by the launch file."""

from dataclasses import dataclass

from stage_config import check_ranges, parameter

_WATCHED = (
    "scan_filter_node odometry_fusion_node sweep_assembler_node icp_matcher_node pose_graph_mapping_node "
    "octomap_server_3dnav_node octomap_server_3dnav_local_node move_base_node stop_scan_and_go_node"
)


@dataclass(frozen=True)
class MonitorConfig:
    """What is explored, where the results go, and what ends a run."""

    sim: bool = parameter(True, "-", "whether there is a true world to judge by")
    world: str = parameter("", "-", "name or file of the world, for the summary")
    seed: int = parameter(1, "-", "seed of the run, for the summary", low=0)
    profile: str = parameter("ours", "-", "profile of the parameters, for the summary")
    out: str = parameter("", "-", "folder for the results; empty: none")
    required: bool = parameter(False, "-", "the end of the run is the end of all nodes; else they live on, and goals are driven to")
    max_sim_time: float = parameter(3600.0, "s", "seconds by the robot's clock, simulated or not, after which the run ends", low=0.0)
    watch: str = parameter(_WATCHED, "-", "end the run when they stay dead; scan_tracking_node and pybullet_sim_node too, where they are")
    status_period_s: float = parameter(1.0, "s", "wall time between two status lines", low=0.05)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self)
