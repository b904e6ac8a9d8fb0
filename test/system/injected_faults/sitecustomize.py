"""Faults that no simulator makes, put into single nodes of a run: Python imports this at its start where the folder is in PYTHONPATH.

Odometry jumps by half a metre and by 30 degrees, each way; matches of some sweeps are refused, three in a row.
"""

import sys

JUMPS = ((14.0, 0.5, 0.0), (20.0, 0.0, 0.5236), (33.0, -0.3, -0.5236))  # when in s, m forward, rad
REFUSED = (8, 9, 10)  # sweeps
NODE = next((name for name in ("odometry_fusion_node", "pose_graph_mapping_node") if any(name in word for word in sys.orig_argv)), "")


def let_odometry_jump() -> None:
    """Each jump moves all poses that come after it."""
    from dataclasses import replace

    import numpy as np

    from odometry_fusion import FusedOdometry
    from rigid_geometry import inverse, transform_from_rpy

    plain, due, moved = FusedOdometry.poll, list(JUMPS), [np.eye(4)]

    def poll(self):
        for estimate in plain(self):
            if due and estimate.stamp_s > due[0][0]:
                _, forward_m, yaw_rad = due.pop(0)
                jump = transform_from_rpy((forward_m, 0.0, 0.0), (0.0, 0.0, yaw_rad))
                moved[0] = moved[0] @ estimate.T_odom_base @ jump @ inverse(estimate.T_odom_base)
            yield replace(estimate, T_odom_base=moved[0] @ estimate.T_odom_base)

    FusedOdometry.poll = poll


def refuse_matches() -> None:
    """All matches that are tried for a sweep, those of loops as well."""
    from pose_graph_mapping.graph.mapper import PoseGraphMapper
    from pose_graph_mapping.registration.matching import refused
    from ros_adapters.matching import MatchService

    add_sweep, match, now = PoseGraphMapper.add_sweep, MatchService.__call__, [False]

    def adding(self, *measured):
        now[0] = len(self.graph) in REFUSED
        return add_sweep(self, *measured)

    def matching(self, reference, reading, T_guess, covariance):
        return refused(T_guess, "by the test") if now[0] else match(self, reference, reading, T_guess, covariance)

    PoseGraphMapper.add_sweep, MatchService.__call__ = adding, matching


if NODE == "odometry_fusion_node":
    let_odometry_jump()
elif NODE == "pose_graph_mapping_node":
    refuse_matches()
