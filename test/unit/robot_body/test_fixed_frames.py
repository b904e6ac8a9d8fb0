"""Where a sensor is mounted: what the description has comes before what /tf_static says; what is not known is refused."""

import numpy as np
import pytest

from robot_body import FixedFrames, RobotBody, StaticTransform, urdf_file

HUSKY = RobotBody()
UPSIDE_DOWN = (1.0, 0.0, 0.0, 0.0)


def frames() -> FixedFrames:
    return FixedFrames(HUSKY, urdf_file(HUSKY).read_text())


def test_frame_of_the_description_is_where_the_description_has_it() -> None:
    np.testing.assert_allclose(frames().T_base("imu_link")[:3, 3], [0.0, 0.0, 0.1])


def test_frame_that_only_tf_static_knows_is_found_and_slashes_mean_nothing() -> None:
    known = frames()
    known.add([StaticTransform("/imu_link", "/xsens", (0.1, 0.0, 0.0), UPSIDE_DOWN)])
    np.testing.assert_allclose(known.T_base("xsens")[:3, 3], [0.1, 0.0, 0.1])
    np.testing.assert_allclose(known.rotation_in_base("xsens"), np.diag([1.0, -1.0, -1.0]))


def test_description_comes_first_and_the_contradiction_is_told() -> None:
    known = frames()
    known.add([StaticTransform("base_link", "imu_link", (0.0, 0.0, 0.1), UPSIDE_DOWN)])
    np.testing.assert_allclose(known.rotation_in_base("imu_link"), np.eye(3))
    assert known.contradicting == {"imu_link"}


@pytest.mark.parametrize(
    ("xyz_m", "quat_xyzw", "said"),
    [((0.0, np.nan, 0.0), UPSIDE_DOWN, "not a finite position"), ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), "not a unit quaternion")],
)
def test_transform_that_is_none_is_told_and_the_others_are_taken(
    xyz_m: tuple[float, float, float], quat_xyzw: tuple[float, float, float, float], said: str
) -> None:
    known = frames()
    with pytest.raises(ValueError, match=f"base_link -> bad: {said}"):
        known.add(
            [StaticTransform("base_link", "bad", xyz_m, quat_xyzw), StaticTransform("base_link", "good", (0.0, 0.0, 0.0), UPSIDE_DOWN)]
        )
    assert known.rotation_in_base("good")[2, 2] == -1.0
    with pytest.raises(ValueError, match="where frame 'bad' is mounted is not known"):
        known.T_base("bad")


@pytest.mark.parametrize(
    ("frame", "said"), [("", "without frame_id"), ("camera", "is not known"), ("laser", "moves with joint tilt_joint")]
)
def test_frame_that_serves_no_sensor_is_refused(frame: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        frames().T_base(frame)
