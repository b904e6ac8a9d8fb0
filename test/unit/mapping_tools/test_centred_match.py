"""Matching in a frame at the reading's centre gives what matching in the reading's own frame would, to first order."""

import gtsam
import numpy as np
import pytest

from mapping_tools.centred_match import carried, match_centred
from pose_graph_mapping.registration.cloud import PointCloud
from pose_graph_mapping.registration.matching import RegistrationResult, Verdict
from rigid_geometry import transform_from_rpy, transform_points

T_TRUE = transform_from_rpy((3.0, -1.0, 0.5), (0.1, -0.2, 1.1))
COVARIANCE = np.diag([1e-4, 2e-4, 3e-4, 1e-2, 2e-2, 3e-2])


class Recorder:
    """A matcher that remembers what it was asked and finds the guess."""

    def match(self, reference, reading, T_guess, guess_covariance=None):
        self.reading, self.T_guess, self.guess_covariance = reading, T_guess, guess_covariance
        nan = float("nan")
        covariance = COVARIANCE if guess_covariance is None else guess_covariance
        return RegistrationResult(T_guess, covariance, nan, nan, nan, 0, np.zeros((0, 6)), Verdict.ACCEPTED, "", T_guess[None])


@pytest.fixture
def reading():
    points = np.random.default_rng(3).uniform(-2.0, 2.0, (50, 3)) + [100.0, 50.0, 0.0]
    return PointCloud(points, np.tile([100.0, 50.0, 1.0], (50, 1)))


def test_matcher_sees_the_reading_around_its_sensor_and_all_comes_back(reading):
    matcher = Recorder()
    result = match_centred(matcher, reading, reading, T_TRUE, COVARIANCE)
    np.testing.assert_allclose(matcher.reading.origins, 0.0, atol=1e-9)
    np.testing.assert_allclose(transform_points(matcher.T_guess, matcher.reading.points), transform_points(T_TRUE, reading.points))
    np.testing.assert_allclose(result.T_reference_reading, T_TRUE, atol=1e-9)
    np.testing.assert_allclose(result.rivals[0], T_TRUE, atol=1e-9)
    np.testing.assert_allclose(result.covariance, COVARIANCE, atol=1e-6)


def test_nothing_known_of_the_guess_stays_so(reading):
    matcher = Recorder()
    match_centred(matcher, reading, reading, T_TRUE, None)
    assert matcher.guess_covariance is None


def test_carried_covariance_is_that_of_drawn_poses():
    T_a_b = transform_from_rpy((4.0, 1.0, -2.0), (0.0, 0.0, 0.7))
    rng = np.random.default_rng(5)
    T_map_a = gtsam.Pose3(T_TRUE)
    drawn = []
    for motion in rng.multivariate_normal(np.zeros(6), 1e-2 * COVARIANCE, 4000):
        disturbed_a = gtsam.Pose3(T_TRUE @ T_a_b).retract(motion).compose(gtsam.Pose3(T_a_b).inverse())
        drawn.append(gtsam.Pose3.Logmap(T_map_a.between(disturbed_a)))
    np.testing.assert_allclose(np.cov(np.array(drawn).T), carried(T_a_b, 1e-2 * COVARIANCE), atol=1e-4)
