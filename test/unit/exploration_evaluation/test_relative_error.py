"""Trajectory scores against evo's own, and relative errors known beforehand."""

import math

import numpy as np
import pytest
from evo.core.metrics import APE, RPE, PoseRelation, StatisticsType, Unit
from evo.core.trajectory import PoseTrajectory3D
from hypothesis import given, settings
from hypothesis import strategies as st

from exploration_evaluation import trajectory_errors
from exploration_evaluation.relative_error import matched_poses, relative_pose_error
from rigid_geometry import transform_from_rpy


def random_run(seed, count, position_sigma_m, angle_sigma_rad):
    """Stamps, true poses, and estimated ones with errors of their own, in a map frame that lies anywhere."""
    rng = np.random.default_rng(seed)
    truth = np.stack([transform_from_rpy(rng.uniform(-20, 20, 3), tuple(rng.uniform(-3, 3, 3))) for _ in range(count)])
    noise = [transform_from_rpy(rng.normal(0, position_sigma_m, 3), tuple(rng.normal(0, angle_sigma_rad, 3))) for _ in range(count)]
    T_map_world = transform_from_rpy(rng.uniform(-20, 20, 3), tuple(rng.uniform(-3, 3, 3)))
    return 1.0 + 0.5 * np.arange(count), truth, T_map_world @ truth @ np.stack(noise)


runs = st.builds(random_run, st.integers(0, 2**32 - 1), st.integers(3, 40), st.floats(1e-4, 3.0), st.floats(1e-4, 1.0))


def of_evo(metric, truth, estimate):
    metric.process_data((truth, estimate))
    return metric.get_statistic(StatisticsType.rmse)


@settings(max_examples=60, deadline=None)
@given(runs)
def test_absolute_and_relative_errors_are_those_of_evo(run):
    stamps, truth, estimate = run
    absolute = trajectory_errors(stamps, estimate, stamps, truth).ate_rms_m
    relative = relative_pose_error(estimate, truth)
    reference, other = (PoseTrajectory3D(poses_se3=list(poses), timestamps=stamps) for poses in (truth, estimate))
    for relation, ours in (
        (PoseRelation.translation_part, relative.translation_rms_m),
        (PoseRelation.rotation_angle_rad, relative.rotation_rms_rad),
        (PoseRelation.rotation_angle_deg, math.degrees(relative.rotation_rms_rad)),
    ):
        assert ours == pytest.approx(of_evo(RPE(relation, delta=1, delta_unit=Unit.frames), reference, other), abs=1e-6)
    other.align(reference, correct_scale=False)
    assert absolute == pytest.approx(of_evo(APE(PoseRelation.translation_part), reference, other), abs=1e-6)


def test_one_bad_match_is_one_bad_motion_however_far_the_run_goes_on():
    truth = np.stack([transform_from_rpy((float(k), 0.0, 0.0)) for k in range(6)])
    estimate = truth.copy()
    estimate[3:] = transform_from_rpy((2.0, 0.0, 0.0)) @ transform_from_rpy((0.1, 0.0, 0.0), (0.0, 0.0, 0.2)) @ truth[1:4]
    found = relative_pose_error(estimate, truth)
    assert found.translation_rms_m == pytest.approx(_rms_of_one(np.linalg.norm(estimate[3, :3, 3] - truth[3, :3, 3]), 5))
    assert found.rotation_rms_rad == pytest.approx(_rms_of_one(0.2, 5))


def _rms_of_one(value, count):
    return value / math.sqrt(count)


def test_matched_poses_leave_out_what_has_no_truth_and_count_it():
    truth = np.stack([transform_from_rpy((x, 0, 0)) for x in (0.0, 1.0)])
    matched = matched_poses([-3.0, 0.25, 0.5, 9.0], np.tile(np.eye(4), (4, 1, 1)), [0.0, 1.0], truth)
    assert matched.unmatched == 2
    np.testing.assert_allclose(matched.stamps, [0.25, 0.5])
    np.testing.assert_allclose(matched.truth[:, 0, 3], [0.25, 0.5])


def test_what_has_no_relative_error_is_refused():
    pose = np.eye(4)[None]
    with pytest.raises(ValueError, match="two poses or more"):
        relative_pose_error(pose, pose)
    with pytest.raises(ValueError, match="N, 4, 4"):
        relative_pose_error(np.zeros((3, 3)), pose)
    with pytest.raises(ValueError, match="none of 1 estimated poses lies within"):
        matched_poses([9.0], pose, [0.0], pose)
    with pytest.raises(ValueError, match="every pose needs a stamp"):
        matched_poses([9.0, 10.0], pose, [0.0], pose)
