"""3-D mapping (thesis 5.4, 6.1): registration of sweeps, pose graph, loop closure, and what a session leaves on disk.

Registration stands behind the service `match_clouds`; the mapper turns sweeps and odometry into vertices and T_map_odom.
"""

from pose_graph_mapping.config import MappingConfig, RegistrationConfig
from pose_graph_mapping.graph.loop_closure import LoopClosure, Match, detect_loop_closures
from pose_graph_mapping.graph.mapper import MappingUpdate, PoseGraphMapper
from pose_graph_mapping.graph.pose_graph import EdgeKind, PoseGraph
from pose_graph_mapping.registration.cloud import PointCloud, merged, vertex_cloud, voxel_downsample
from pose_graph_mapping.registration.matching import Registration, RegistrationResult, Verdict, create_registration
from pose_graph_mapping.session.session_store import SessionStore, StoredSweep

__all__ = [
    "EdgeKind",
    "LoopClosure",
    "MappingConfig",
    "MappingUpdate",
    "Match",
    "PointCloud",
    "PoseGraph",
    "PoseGraphMapper",
    "Registration",
    "RegistrationConfig",
    "RegistrationResult",
    "SessionStore",
    "StoredSweep",
    "Verdict",
    "create_registration",
    "detect_loop_closures",
    "merged",
    "vertex_cloud",
    "voxel_downsample",
]
