"""The service match_clouds: requests and responses to clouds and results, on both sides."""

import numpy as np
import rospy
from explore_3dnav.srv import MatchClouds, MatchCloudsRequest, MatchCloudsResponse
from geometry_msgs.msg import Transform
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2

from pose_graph_mapping.registration.matching import PointCloud, RegistrationResult, Verdict, refused
from ros_adapters.asking import AskedService
from ros_adapters.conversions import cloud_arrays_with_normals, cloud_message, transform_from_message, transform_message
from ros_adapters.frames import frames

_UNKNOWN = Transform()
_UNKNOWN.translation.x = _UNKNOWN.translation.y = _UNKNOWN.translation.z = float("nan")


def match_request_arguments(
    request: MatchCloudsRequest,
) -> tuple[PointCloud, PointCloud, NDArray[np.float64], NDArray[np.float64] | None]:
    """Reference, reading, guess and its covariance of a request; ValueError when one cannot be read."""
    covariance = np.array(request.guess_covariance)
    if covariance.size not in (0, 36):
        raise ValueError(f"guess_covariance holds {covariance.size} numbers, expected 36 or none")
    guess = transform_from_message(request.guess)
    return _cloud(request.reference), _cloud(request.reading), guess, covariance.reshape(6, 6) if covariance.size else None


def match_response(result: RegistrationResult) -> MatchCloudsResponse:
    return MatchCloudsResponse(
        verdict=result.verdict.value,
        reason=result.reason,
        transform=transform_message(result.T_reference_reading),
        covariance=result.covariance.ravel().tolist(),
        match_ratio=result.match_ratio,
        overlap=result.overlap,
        free_space_contradiction=result.free_space_contradiction,
        degenerate_directions=result.degenerate_directions.ravel().tolist(),
        rivals=[transform_message(T) for T in result.rivals],
        iterations=result.iterations,
    )


def refused_response(reason: str) -> MatchCloudsResponse:
    """An answer to a request that was none: not accepted, and no number that could be taken for a result."""
    nan = float("nan")
    return MatchCloudsResponse(Verdict.REFUSED.value, reason, _UNKNOWN, [nan] * 36, nan, nan, nan, [], [], 0)


class MatchService:
    """match_clouds seen from the mapper: arrays in, result out, asked again of a node that was started again."""

    def __init__(self) -> None:
        self._call = AskedService("match_clouds", MatchClouds)

    def __call__(
        self, reference: PointCloud, reading: PointCloud, T_guess: NDArray[np.float64], covariance: NDArray[np.float64] | None
    ) -> RegistrationResult:
        """A service that does not answer is a refusal with its reason: the vertex then hangs on odometry.

        Not so while the node ends, as by Ctrl-C: then it is an error, for the sweep was neither matched nor refused.
        """
        try:
            response = self._call(
                _message(reference, frames().map),
                _message(reading, frames().base),
                transform_message(T_guess),
                [] if covariance is None else covariance.ravel().tolist(),
            )
        except rospy.ServiceException as error:
            if rospy.core.is_shutdown_requested():
                raise
            return refused(T_guess, f"match_clouds did not answer: {error}")
        return _result(response, T_guess)


def _cloud(message: PointCloud2) -> PointCloud:
    points, origins, normals = cloud_arrays_with_normals(message)
    return PointCloud(points.astype(np.float64), origins.astype(np.float64), None if normals is None else normals.astype(np.float64))


def _message(cloud: PointCloud, frame: str) -> object:
    origins = cloud.origins if cloud.origins is not None else np.full_like(cloud.points, np.nan)
    return cloud_message(0.0, frame, cloud.points, origins, cloud.normals)


def _result(response: MatchCloudsResponse, T_guess: NDArray[np.float64]) -> RegistrationResult:
    verdict = Verdict(response.verdict)
    if verdict is Verdict.REFUSED and not np.isfinite(response.match_ratio):
        return refused(T_guess, response.reason)
    directions = np.array(response.degenerate_directions).reshape(-1, 6)
    return RegistrationResult(
        T_reference_reading=transform_from_message(response.transform),
        covariance=np.array(response.covariance).reshape(6, 6),
        match_ratio=response.match_ratio,
        overlap=response.overlap,
        free_space_contradiction=response.free_space_contradiction,
        iterations=response.iterations,
        degenerate_directions=directions,
        verdict=verdict,
        reason=response.reason,
        rivals=np.array([transform_from_message(T) for T in response.rivals]).reshape(-1, 4, 4),
    )
