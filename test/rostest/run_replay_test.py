#!/usr/bin/env python3
"""run_replay_node alone, started anew in every test, for each ends with its node: a hand-made run, a bag of one, two runs, damage."""

import subprocess
import sys
import tempfile
import unittest
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rosbag
import rospy
from explore_3dnav.msg import MappedSweep
from nav_msgs.msg import Path as PathMessage
from node_testing import Inbox
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, PointCloud2
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

import rostest
from rigid_geometry import inverse, transform_points
from ros_adapters.conversions import (
    cloud_arrays,
    cloud_message,
    header,
    path_points,
    pose_message,
    ros_time,
    transform_from_message,
    transform_stamped,
)

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit" / "run_replay"))
from recorded_runs import LAST_S, SWEEP_STAMPS_S, T_WORLD_MAP, true_poses, wall_world, write_run

NODE = "run_replay_node"
LIMIT_S = 160.0
WALL_IN_MAP = transform_points(inverse(T_WORLD_MAP), wall_world())


def replay(*parameters: str) -> tuple[int, str]:
    """Exit code and output of the node with these private parameters and no others."""
    if rospy.has_param(f"/{NODE}"):
        rospy.delete_param(f"/{NODE}")
    command = ["rosrun", "explore_3dnav", NODE, *(f"_{p}" for p in parameters)]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=LIMIT_S)
    return done.returncode, done.stdout


def bag_of_the_run(path: Path) -> Path:
    """What `./explore --record` writes, as far as it is shown: the robot stands, sweeps, and is where the next sweep is."""
    poses = inverse(T_WORLD_MAP) @ true_poses(SWEEP_STAMPS_S)
    with rosbag.Bag(str(path), "w") as bag:
        for k, stamp_s in enumerate(SWEEP_STAMPS_S):
            points = transform_points(inverse(poses[k]), WALL_IN_MAP)
            sweep = MappedSweep(header=header(stamp_s, "map"), vertex_id=k, vertex_poses=[pose_message(T) for T in poses[: k + 1]])
            sweep.cloud = cloud_message(stamp_s, "base_link", points, np.zeros_like(points))
            transforms = [transform_stamped(stamp_s, "map", "odom", np.eye(4)), transform_stamped(stamp_s, "odom", "base_link", poses[k])]
            bag.write("/tf", TFMessage(transforms), ros_time(stamp_s))
            bag.write("/mapped_sweep", sweep, ros_time(stamp_s))
        broken = MappedSweep(header=header(10.0, "map"), vertex_id=5, vertex_poses=[pose_message(T) for T in poses])
        bag.write("/mapped_sweep", broken, ros_time(10.0))
    return path


def marked(count: int) -> Callable[[MarkerArray], bool]:
    return lambda array: sum(len(marker.points) for marker in array.markers) == count


class RunReplayTest(unittest.TestCase):
    def setUp(self) -> None:
        self._folder = tempfile.TemporaryDirectory()
        self.addCleanup(self._folder.cleanup)
        self.folder = Path(self._folder.name)

    def assert_wall(self, message: PointCloud2) -> None:
        low, high = WALL_IN_MAP.min(axis=0), WALL_IN_MAP.max(axis=0)
        points, _ = cloud_arrays(message, "map")
        np.testing.assert_allclose(points.min(axis=0), low, atol=0.05)
        np.testing.assert_allclose(points.max(axis=0), high, atol=0.05)

    def test_run_is_played_to_its_end(self) -> None:
        topics: dict[str, Any] = {"/cloud_map": PointCloud2, "/trajectory": PathMessage, "/pose_graph": MarkerArray, "/clock": Clock}
        topics |= {"/terrain_markers": MarkerArray, "/occupied_cells_vis_array": MarkerArray, "/tf": TFMessage, "/joint_states": JointState}
        heard = {topic: Inbox(topic, message_type) for topic, message_type in topics.items()}
        code, text = replay(f"run:={write_run(self.folder)}", "speed:=4", "frame_rate_hz:=20")
        self.assertEqual(code, 0, text)
        self.assertIn("played to its end at 9.0 s: 5 sweeps, 4 m", text)
        heard["/clock"].wait_for(lambda m: abs(m.clock.to_sec() - LAST_S) < 1e-6)
        clocks = [m.clock.to_sec() for m in heard["/clock"].messages]
        self.assertEqual(clocks, sorted(clocks))
        self.assertAlmostEqual(clocks[-1], LAST_S)
        self.assert_wall(heard["/cloud_map"].wait_for(lambda m: abs(m.header.stamp.to_sec() - LAST_S) < 1e-3))
        np.testing.assert_allclose(path_points(heard["/trajectory"].messages[-1])[-1], [4.0, 0.0, 0.0], atol=1e-3)
        last = {t.child_frame_id: transform_from_message(t.transform) for t in heard["/tf"].messages[-1].transforms}
        np.testing.assert_allclose((last["odom"] @ last["base_link"])[:3, 3], [4.0, 0.0, 0.0], atol=1e-3)
        heard["/pose_graph"].wait_for(marked(5 + 2 * 4))
        heard["/terrain_markers"].wait_for(marked(12))
        heard["/occupied_cells_vis_array"].wait_for(marked(12))
        self.assertIn("tilt_joint", heard["/joint_states"].messages[-1].name)

    def test_bag_is_played_and_its_map_is_made_again(self) -> None:
        cloud, tf, terrain = Inbox("/cloud_map", PointCloud2), Inbox("/tf", TFMessage), Inbox("/terrain_markers", MarkerArray)
        code, text = replay(f"bag:={bag_of_the_run(self.folder / 'run.bag')}", "speed:=4")
        self.assertEqual(code, 0, text)
        self.assertIn("5 sweeps", text)
        self.assert_wall(cloud.wait_for_stamp(LAST_S))
        self.assertTrue(tf.messages)
        terrain.wait_for(lambda array: len(array.markers) > 0)

    def test_two_runs_lie_on_each_other(self) -> None:
        a, b = Inbox("/compare/cloud_a", PointCloud2), Inbox("/compare/cloud_b", PointCloud2)
        path = Inbox("/compare/path_b", PathMessage)
        first, second = write_run(self.folder / "a"), write_run(self.folder / "b", np.eye(4))
        code, text = replay(f"run:={first}", f"other:={second}")
        self.assertEqual(code, 0, text)
        self.assertIn("both maps are in the frame of the first", text)
        self.assert_wall(a.wait_for())
        self.assert_wall(b.wait_for())
        np.testing.assert_allclose(path_points(path.wait_for())[-1], [4.0, 0.0, 0.0], atol=1e-3)

    def test_run_that_cannot_be_read_is_told_in_one_line(self) -> None:
        (write_run(self.folder) / "trajectory.txt").write_text("no pose\n")
        code, text = replay(f"run:={self.folder}")
        self.assertEqual(code, 2, text)
        self.assertIn("cannot be shown:", text)
        self.assertIn("trajectory.txt", text)
        self.assertNotIn("Traceback", text)

    def test_wrong_parameter_ends_the_node_with_the_nearest_name(self) -> None:
        code, text = replay(f"run:={self.folder}", "sped:=3")
        self.assertEqual(code, 2, text)
        self.assertIn("did you mean speed?", text)


if __name__ == "__main__":
    rospy.init_node("run_replay_test", disable_rostime=True)
    rostest.rosrun("explore_3dnav", "run_replay", RunReplayTest, sys.argv)
