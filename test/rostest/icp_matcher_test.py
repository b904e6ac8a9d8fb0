#!/usr/bin/env python3
"""icp_matcher_node alone: the service match_clouds on clouds of one room, and on what are no clouds."""

import sys
import unittest

import numpy as np
import rospy
from dynamic_reconfigure.client import Client
from explore_3dnav.srv import MatchClouds, MatchCloudsResponse
from geometry_msgs.msg import Transform
from node_testing import DiagnosticsOf, floor_and_walls, one_line_of, run_misconfigured, wait_for_node
from sensor_msgs.msg import PointCloud2

import rostest
from rigid_geometry import inverse, rotation_angle, transform_from_rpy, transform_points
from ros_adapters.conversions import cloud_message, transform_from_message, transform_message

NODE = "icp_matcher_node"


def room() -> tuple[np.ndarray, np.ndarray]:
    """Points and origins of a room with a pillar, so that it has no symmetry."""
    points, origins = floor_and_walls()
    angle, height = (a.ravel() for a in np.meshgrid(np.arange(0, 2 * np.pi, 0.1), np.arange(-0.1, 1.9, 0.06)))
    pillar = np.stack([1.8 + 0.3 * np.cos(angle), 1.2 + 0.3 * np.sin(angle), height], axis=1).astype(np.float32)
    return np.concatenate([points, pillar]), np.concatenate([origins, np.tile(origins[:1], (len(pillar), 1))])


class IcpMatcherTest(unittest.TestCase):
    clock_s = 100.0

    @classmethod
    def setUpClass(cls) -> None:
        wait_for_node(NODE)
        cls.diagnostics = DiagnosticsOf(NODE).wait_until_connected()
        rospy.wait_for_service("match_clouds", 60.0)
        cls.match = rospy.ServiceProxy("match_clouds", MatchClouds)
        cls.T_map_base = transform_from_rpy((0.3, -0.2, 0.0), (0.0, 0.0, 0.1))
        points, origins = room()
        T_base_map = inverse(cls.T_map_base)
        cls.reference = cloud_message(0.0, "map", points, origins)
        cls.moved = transform_points(T_base_map, points), transform_points(T_base_map, origins)

    def reading(self) -> PointCloud2:
        """The room as seen from elsewhere, later than all before."""
        IcpMatcherTest.clock_s += 2.0
        return cloud_message(self.clock_s, "base_link", *self.moved)

    def assert_refused(self, response: MatchCloudsResponse, reason: str) -> None:
        """Not accepted, with a reason, and with no number that could be taken for a result."""
        self.assertEqual(response.verdict, "refused")
        self.assertIn(reason, response.reason)
        self.assertTrue(np.isnan(response.transform.translation.x) and np.isnan(response.covariance).all())

    def assert_matches(self) -> None:
        response = self.match(self.reference, self.reading(), transform_message(np.eye(4)), [])
        self.assertEqual(response.verdict, "accepted", response.reason)
        error = inverse(self.T_map_base) @ transform_from_message(response.transform)
        self.assertLess(np.linalg.norm(error[:3, 3]), 0.03)
        self.assertLess(rotation_angle(error), 0.01)
        covariance = np.array(response.covariance).reshape(6, 6)
        self.assertTrue((np.linalg.eigvalsh(covariance) > 0).all())

    def test_reading_is_registered_to_the_reference(self) -> None:
        self.assert_matches()

    def test_the_same_request_gets_the_same_answer(self) -> None:
        answers = [self.match(self.reference, self.reading(), transform_message(np.eye(4)), []) for _ in range(2)]
        self.assertEqual(answers[0].transform, answers[1].transform)

    def test_clouds_that_are_none_are_refused_and_counted(self) -> None:
        empty = cloud_message(0.0, "base_link", np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32))
        nan = cloud_message(0.0, "base_link", np.full((50, 3), np.nan, np.float32), np.zeros((50, 3), np.float32))
        cut = self.reading()
        cut.data = cut.data[:100]
        for bad, reason in ((empty, "without points"), (nan, "finite"), (cut, "cannot be read"), (PointCloud2(), "without float fields")):
            self.assert_refused(self.match(self.reference, bad, transform_message(np.eye(4)), []), reason)
            self.assert_refused(self.match(bad, self.reading(), transform_message(np.eye(4)), []), reason)
        self.assert_matches()
        self.diagnostics.wait_for_dropped("bad match request", at_least=8)

    def test_guess_that_is_no_transform_is_refused(self) -> None:
        self.assert_refused(self.match(self.reference, self.reading(), Transform(), []), "not a unit quaternion")
        self.assert_matches()

    def test_reading_of_another_place_is_refused(self) -> None:
        rng = np.random.default_rng(1)
        noise = rng.uniform(-3.0, 3.0, (20000, 3)).astype(np.float32)
        response = self.match(
            self.reference, cloud_message(0.0, "base_link", noise, np.zeros_like(noise)), transform_message(np.eye(4)), []
        )
        self.assertEqual(response.verdict, "refused")

    def test_wrong_parameter_ends_the_node_with_the_nearest_name(self) -> None:
        code, stderr = run_misconfigured(NODE, "voxel:=0.1")
        self.assertEqual(code, 2, stderr)
        self.assertIn("unknown parameter voxel", one_line_of(stderr))

    def test_limits_are_changed_by_dynamic_reconfigure(self) -> None:
        client = Client(NODE, timeout=60.0)
        client.update_configuration({"max_contradiction": 0.0, "min_overlap": 1.0})
        try:
            response = self.match(self.reference, self.reading(), transform_message(np.eye(4)), [])
            self.assertNotEqual(response.verdict, "accepted")
            self.assertIn("overlap", response.reason)
        finally:
            client.update_configuration({"max_contradiction": 0.012, "min_overlap": 0.2})
        self.assert_matches()


if __name__ == "__main__":
    rospy.init_node("icp_matcher_test")
    rostest.rosrun("explore_3dnav", "icp_matcher", IcpMatcherTest, sys.argv)
