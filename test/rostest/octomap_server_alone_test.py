#!/usr/bin/env python3
"""octomap_server_3dnav_node alone, in octomap_server's place: another node's clouds in a camera's frame, tf, and its parameter file."""

import math
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np
import rosbag
import rospy
from dynamic_reconfigure.client import Client
from explore_3dnav.srv import LoadMap
from geometry_msgs.msg import Point, PoseStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import GetPlan
from node_testing import DiagnosticsOf, Inbox, feed, floor_and_walls, octomap_bytes, wait_for_node, wait_until
from sensor_msgs.msg import PointCloud2, PointField
from std_srvs.srv import Empty, Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

import rostest
from octomap_server_3dnav.octree.column_runs import VoxelState
from octomap_server_3dnav.octree.octree import OctreeMap
from rigid_geometry import inverse, transform_from_rpy, transform_points
from ros_adapters.conversions import header, pose_message, transform_stamped
from ros_adapters.octomap_messages import BoundingBoxQuery, GetOctomap, Octomap

NODE = "octomap_server_3dnav_node"
RESOLUTION_M = 0.1
T_WORLD_BASE = transform_from_rpy((2.0, -1.0, 0.132), (0.0, 0.0, 0.5))
T_BASE_CAMERA = transform_from_rpy((0.3, 0.1, 0.8), (-math.pi / 2, 0.0, -math.pi / 2))  # z ahead, as optical frames have it


def plain_cloud(stamp_s: float, points: np.ndarray, frame: str = "camera") -> PointCloud2:
    """A cloud as a camera's driver sends it: x y z, and not a word of where its beams began."""
    rows = np.ascontiguousarray(points, np.float32)
    fields = [PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate("xyz")]
    size = {"height": 1, "width": len(rows), "point_step": 12, "row_step": 12 * len(rows)}
    return PointCloud2(header=header(stamp_s, frame), fields=fields, data=rows.tobytes(), is_dense=True, **size)


class OctomapServerAloneTest(unittest.TestCase):
    clock_s = 100.0

    @classmethod
    def setUpClass(cls) -> None:
        wait_for_node(NODE)
        cls.full = Inbox("/octomap_full", Octomap).wait_until_connected()
        cls.occupied = Inbox("/occupied_cells_vis_array", MarkerArray).wait_until_connected()
        cls.free = Inbox("/free_cells_vis_array", MarkerArray).wait_until_connected()
        cls.projected = Inbox("/projected_map", OccupancyGrid).wait_until_connected()
        cls.diagnostics = DiagnosticsOf(NODE).wait_until_connected()
        cls.tf, cls.static = feed("/tf", TFMessage), feed("/tf_static", TFMessage)
        cls.clouds = feed("/camera/points", PointCloud2)
        cls.reset = rospy.ServiceProxy(f"/{NODE}/reset", Empty)
        cls.load = rospy.ServiceProxy(f"/{NODE}/load", LoadMap)
        cls.make_plan = rospy.ServiceProxy(f"/{NODE}/make_plan", GetPlan)
        cls.static.publish(TFMessage([transform_stamped(0.0, "chassis", "camera", T_BASE_CAMERA)]))
        points, _ = floor_and_walls()
        cls.room = transform_points(inverse(T_BASE_CAMERA), points)  # as the camera sees it

    @classmethod
    def tearDownClass(cls) -> None:
        rospy.ServiceProxy(f"/{NODE}/save", Trigger)()  # nothing is written any more
        shutil.rmtree(rospy.get_param(f"/{NODE}/out"))

    def setUp(self) -> None:
        self.reset()
        OctomapServerAloneTest.clock_s += 10.0

    def stand(self, stamp_s: float) -> None:
        """tf of a robot that stands, from a second before to a second after."""
        self.tf.publish(TFMessage([transform_stamped(stamp_s + dt, "world", "chassis", T_WORLD_BASE) for dt in (-1.0, 1.0)]))

    def mapped(self) -> OctreeMap:
        """The map of one cloud of the room."""
        self.stand(self.clock_s)
        self.clouds.publish(plain_cloud(self.clock_s, self.room))
        message = self.full.wait_for_stamp(self.clock_s)
        self.assertEqual((message.header.frame_id, message.resolution), ("world", RESOLUTION_M))
        return OctreeMap.from_full(octomap_bytes(message), message.resolution)

    def seen_from(self, xyz_base: tuple[float, float, float]) -> np.ndarray:
        return transform_points(T_WORLD_BASE, np.array([xyz_base]))

    def test_cloud_in_a_camera_s_frame_is_mapped_where_tf_has_it_and_frees_the_way_from_there(self) -> None:
        tree = self.mapped()
        wall, way, beneath = (self.seen_from(p) for p in ((2.98, 0.1, 0.8), (1.5, 0.1, 0.8), (1.0, 0.5, -0.14)))
        self.assertEqual(
            [int(tree.states_at(p)[0]) for p in (wall, way, beneath)], [VoxelState.OCCUPIED, VoxelState.FREE, VoxelState.OCCUPIED]
        )

    def test_terrain_grid_and_plan_come_without_the_rest(self) -> None:
        self.mapped()
        grid = self.projected.wait_for_stamp(self.clock_s)
        self.assertEqual(grid.header.frame_id, "world")
        ahead = self.seen_from((1.5, 0.5, 0.0))[0]
        column = int((ahead[0] - grid.info.origin.position.x) / RESOLUTION_M)
        row = int((ahead[1] - grid.info.origin.position.y) / RESOLUTION_M)
        self.assertEqual(grid.data[row * grid.info.width + column], 0)
        goal = PoseStamped(header(0.0, "chassis"), pose_message(transform_from_rpy((1.5, 0.5, 0.0))))
        plan = self.make_plan(PoseStamped(), goal, 0.5).plan
        end = plan.poses[-1].pose.position
        self.assertEqual(plan.header.frame_id, "world")
        self.assertLess(math.hypot(end.x - ahead[0], end.y - ahead[1]), 0.3)

    def test_what_octomap_server_s_file_limits_is_obeyed(self) -> None:
        tree = self.mapped()
        centers, _ = tree.occupied_voxels()
        self.assertLess(centers[:, 2].max(), 1.6)  # pointcloud_max_z
        shown = np.array([[p.x, p.y, p.z] for m in self.newest(self.occupied).markers for p in m.points])
        self.assertGreater(centers[:, 2].max(), 1.3)
        self.assertLess(shown[:, 2].max(), 1.3)  # occupancy_max_z
        self.assertGreater(shown[:, 2].min(), 0.0)
        far = transform_points(inverse(T_BASE_CAMERA), np.array([[4.5, 0.0, 0.5], [5.5, 0.0, 0.5]]))  # sensor_model/max_range is 5 m
        OctomapServerAloneTest.clock_s += 1.0
        self.stand(self.clock_s)
        self.clouds.publish(plain_cloud(self.clock_s, far))
        tree = OctreeMap.from_full(octomap_bytes(self.full.wait_for_stamp(self.clock_s)), RESOLUTION_M)
        states = tree.states_at(transform_points(T_WORLD_BASE, np.array([[4.5, 0.0, 0.5], [5.5, 0.0, 0.5]])))
        self.assertEqual(states.tolist(), [VoxelState.OCCUPIED, VoxelState.UNKNOWN])

    def newest(self, inbox: Inbox) -> MarkerArray:
        return inbox.wait_for(lambda m: m.markers and abs(m.markers[0].header.stamp.to_sec() - self.clock_s) < 1e-6)

    def test_free_voxels_are_shown_as_octomap_server_shows_them(self) -> None:
        tree = self.mapped()
        points = np.array([[p.x, p.y, p.z] for m in self.newest(self.free).markers for p in m.points])
        self.assertGreater(len(points), 100)
        self.assertEqual(set(tree.states_at(points).tolist()), {VoxelState.FREE})

    def test_cloud_waits_for_its_transform(self) -> None:
        self.clouds.publish(plain_cloud(self.clock_s, self.room))
        rospy.rostime.wallsleep(0.1)  # it waits for half a second
        self.assertNotIn(self.clock_s, self.full.stamps())
        self.stand(self.clock_s)
        self.full.wait_for_stamp(self.clock_s)

    def test_cloud_in_the_map_s_own_frame_waits_for_nobody_and_has_the_robot_where_it_was_last(self) -> None:
        self.stand(self.clock_s)
        OctomapServerAloneTest.clock_s += 1.3  # 0.3 s after the newest transform
        self.clouds.publish(plain_cloud(self.clock_s, transform_points(T_WORLD_BASE @ T_BASE_CAMERA, self.room), frame="/world"))
        self.projected.wait_for_stamp(self.clock_s)
        goal = PoseStamped(header(0.0, "world"), pose_message(T_WORLD_BASE @ transform_from_rpy((1.5, 0.5, -0.132))))
        self.assertGreater(len(self.make_plan(PoseStamped(), goal, 0.5).plan.poses), 5)

    def test_cloud_that_tf_does_not_place_is_dropped_and_counted(self) -> None:
        before = self.diagnostics.dropped("cloud without tf")
        self.clouds.publish(plain_cloud(self.clock_s, self.room, frame="nowhere"))
        self.diagnostics.wait_for_dropped("cloud without tf", before + 1)
        self.assertIn("'nowhere' in 'world'", self.diagnostics.counts()["dropped: cloud without tf"])
        self.mapped()
        self.assertNotIn("nowhere", self.diagnostics.message())

    def test_bad_clouds_are_dropped_and_counted(self) -> None:
        for number, points in enumerate((self.room[:0], np.full((5, 3), np.nan))):
            before = self.diagnostics.dropped("bad PointCloud2")
            self.stand(self.clock_s + number)
            self.clouds.publish(plain_cloud(self.clock_s + number, points))
            self.diagnostics.wait_for_dropped("bad PointCloud2", before + 1)
        without_z = plain_cloud(self.clock_s, self.room)
        without_z.fields = without_z.fields[:2]
        before = self.diagnostics.dropped("bad PointCloud2")
        self.clouds.publish(without_z)
        self.diagnostics.wait_for_dropped("bad PointCloud2", before + 1)
        OctomapServerAloneTest.clock_s += 5.0
        self.mapped()

    def test_map_without_a_robot_is_served_and_says_why_it_has_no_terrain(self) -> None:
        self.tf.publish(TFMessage([transform_stamped(self.clock_s + dt, "world", "tripod", T_WORLD_BASE) for dt in (-1.0, 1.0)]))
        self.clouds.publish(plain_cloud(self.clock_s, transform_points(T_BASE_CAMERA, self.room), frame="tripod"))
        self.full.wait_for_stamp(self.clock_s)
        goal = PoseStamped(header(0.0, "world"), pose_message(T_WORLD_BASE))
        with self.assertRaisesRegex(rospy.ServiceException, "'chassis' in 'world': set base_frame_id"):
            self.make_plan(PoseStamped(), goal, 0.5)
        wait_until(lambda: "no terrain" in self.diagnostics.counts(), "the reason on /diagnostics")

    def test_box_is_cleared_and_reset_forgets(self) -> None:
        tree = self.mapped()
        wall = tree.occupied_voxels()[0]
        wall = wall[wall[:, 2] > 0.5][:1]
        rospy.ServiceProxy(f"/{NODE}/clear_bbx", BoundingBoxQuery)(Point(*(wall[0] - 0.02)), Point(*(wall[0] + 0.02)))
        served = rospy.ServiceProxy("/octomap_full", GetOctomap)
        tree = OctreeMap.from_full(octomap_bytes(served().map), RESOLUTION_M)
        self.assertEqual(tree.states_at(wall).tolist(), [VoxelState.FREE])
        shown = self.full.wait_for(lambda m: OctreeMap.from_full(octomap_bytes(m), RESOLUTION_M).states_at(wall)[0] == VoxelState.FREE)
        self.assertEqual(octomap_bytes(shown), octomap_bytes(served().map))
        self.reset()
        self.full.wait_for(lambda m: not OctreeMap.from_full(octomap_bytes(m), RESOLUTION_M).leaf_count)
        with self.assertRaisesRegex(rospy.ServiceException, "no sweep is in the map yet"):
            served()
        with self.assertRaisesRegex(rospy.ServiceException, "no sweep is in the map yet"):
            self.make_plan(PoseStamped(), PoseStamped(header(0.0, "world"), pose_message(T_WORLD_BASE)), 0.5)

    def test_save_says_where_or_why_not(self) -> None:
        save = rospy.ServiceProxy(f"/{NODE}/save", Trigger)
        answer = save()
        self.assertFalse(answer.success)
        self.assertIn("no sweep is in the map", answer.message)
        tree = self.mapped()
        answer = save()
        self.assertTrue(answer.success, answer.message)
        folder = Path(rospy.get_param(f"/{NODE}/out"))
        self.assertIn(str(folder), answer.message)
        self.assertEqual(OctreeMap.read(folder / "map.ot").to_full(), tree.to_full())
        self.assertTrue((folder / "terrain.npz").is_file())

    def test_map_of_a_file_is_loaded_and_gone_on_with(self) -> None:
        tree = self.mapped()
        with tempfile.TemporaryDirectory() as folder:
            path = str(Path(folder) / "map.ot")
            tree.write_ot(path)
            refused = self.load(path)
            self.assertFalse(refused.success)
            self.assertIn("the map is of clouds: call ~reset", refused.message)
            self.reset()
            answer = self.load(path)
        self.assertTrue(answer.success, answer.message)
        served = rospy.ServiceProxy("/octomap_full", GetOctomap)().map
        self.assertEqual(octomap_bytes(served), tree.to_full())
        goal = PoseStamped(header(0.0, "world"), pose_message(T_WORLD_BASE @ transform_from_rpy((1.5, 0.5, -0.132))))
        self.assertGreater(len(self.make_plan(PoseStamped(), goal, 0.5).plan.poses), 5)  # tf knows the robot
        OctomapServerAloneTest.clock_s += 1.0
        self.mapped()

    def test_map_that_cannot_be_is_refused_and_nothing_is_changed(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            damaged, coarse = Path(folder) / "damaged.bt", Path(folder) / "coarse.bt"
            damaged.write_bytes(b"# Octomap OcTree binary file\nid OcTree\nsize 5\nres 0.1\ndata\n\x00")
            other = OctreeMap(0.2)
            middles = other.unknown_on_plane((0.0, 0.0, 0.0), 1.0)
            other.insert_sweep(middles, middles)
            other.write_bt(coarse)
            for path, reason in (
                (damaged, "damaged.bt"),
                (coarse, "0.2 m"),
                (Path(folder), "no map there"),
                (Path("/nowhere.bt"), "No such file"),
            ):
                answer = self.load(str(path))
                self.assertFalse(answer.success)
                self.assertIn(reason, answer.message)
                self.assertNotIn("\n", answer.message)
        self.mapped()  # it is still empty: clouds are taken

    def test_robot_that_moves_in_a_loaded_map_has_the_terrain_around_it(self) -> None:
        tree = self.mapped()
        self.reset()
        with tempfile.TemporaryDirectory() as folder:
            path = str(Path(folder) / "map.bt")
            tree.write_bt(path)
            self.assertTrue(self.load(path).success)
        late = self.clock_s + 5.0
        T_there = T_WORLD_BASE @ transform_from_rpy((1.0, 1.0, 0.0))
        self.tf.publish(TFMessage([transform_stamped(late, "world", "chassis", T_there)]))
        goal = PoseStamped(header(0.0, "world"), pose_message(T_WORLD_BASE @ transform_from_rpy((-1.5, 0.5, -0.132))))

        def begins_there() -> bool:
            first = self.make_plan(PoseStamped(), goal, 0.5).plan.poses[0].pose.position
            return math.hypot(first.x - T_there[0, 3], first.y - T_there[1, 3]) < 0.2

        wait_until(begins_there, "a plan from where tf has the robot now")

    def test_bag_of_another_robot_is_played(self) -> None:
        """tf at 20 Hz and a camera at 4 Hz, on a way of 2 m: map and plan of what was seen along it, and no cloud is lost."""
        stamps = self.clock_s + np.arange(0.0, 2.01, 0.05)
        poses = [T_WORLD_BASE @ transform_from_rpy((s - self.clock_s, 0.0, 0.0)) for s in stamps]
        room = transform_points(T_WORLD_BASE @ T_BASE_CAMERA, self.room)
        dropped = self.diagnostics.counts().get("dropped: cloud without tf")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "robot.bag"
            with rosbag.Bag(str(path), "w") as bag:
                for k, (stamp_s, T) in enumerate(zip(stamps.tolist(), poses, strict=True)):
                    bag.write("/tf", TFMessage([transform_stamped(stamp_s, "world", "chassis", T)]), rospy.Time.from_sec(stamp_s))
                    if k % 5 == 0:
                        seen = transform_points(inverse(T @ T_BASE_CAMERA), room)
                        bag.write("/camera/points", plain_cloud(stamp_s, seen), rospy.Time.from_sec(stamp_s))
            subprocess.run(["rosbag", "play", "--quiet", "--wait-for-subscribers", str(path)], check=True, timeout=240.0)
        tree = OctreeMap.from_full(octomap_bytes(self.full.wait_for_stamp(float(stamps[-1]))), RESOLUTION_M)
        hits = room[(room[:, 2] < 1.4) & (np.linalg.norm(room[:, :2] - poses[-1][:2, 3], axis=1) < 4.0)]
        self.assertGreater((tree.states_at(hits) == VoxelState.OCCUPIED).mean(), 0.95)
        self.assertEqual(self.diagnostics.counts().get("dropped: cloud without tf"), dropped)
        goal = PoseStamped(header(0.0, "world"), pose_message(T_WORLD_BASE))
        plan = self.make_plan(PoseStamped(), goal, 0.5).plan
        self.assertLess(math.dist((plan.poses[0].pose.position.x, plan.poses[0].pose.position.y), poses[-1][:2, 3]), 0.3)

    def test_what_octomap_saver_writes_is_read_by_octomap_s_own_tools(self) -> None:
        """It calls one of two services, and writes the data behind a header by octomap's library."""
        self.mapped()
        answer = rospy.ServiceProxy("/octomap_binary", GetOctomap)().map
        self.assertEqual((answer.id, answer.binary), ("OcTree", True))
        tree = OctreeMap.from_binary(octomap_bytes(answer), answer.resolution)
        with tempfile.TemporaryDirectory() as folder:
            bt, wrl = Path(folder) / "map.bt", Path(folder) / "map.bt.wrl"
            tree.write_bt(bt)
            subprocess.run(["bt2vrml", str(bt)], check=True, capture_output=True, timeout=60.0)
            self.assertGreater(wrl.stat().st_size, 1000)

    def test_sensor_model_is_changed_by_octomap_server_s_names(self) -> None:
        client = Client(NODE, timeout=60.0)
        before = client.get_configuration(timeout=60.0)
        self.assertTrue({"sensor_model_hit", "sensor_model_min", "sensor_model_max_range", "occupancy_max_z"} <= before.keys())
        first, _ = self.mapped().occupied_voxels()
        tuned = {"sensor_model_max_range": 2.0, "occupancy_min_z": -1.0, "occupancy_max_z": 0.5}
        client.update_configuration(dict(tuned))
        try:
            self.reset()
            OctomapServerAloneTest.clock_s += 1.0
            tree, shown = self.mapped(), self.newest(self.occupied)
        finally:
            client.update_configuration({name: before[name] for name in tuned})
        self.assertLess(len(tree.occupied_voxels()[0]), 0.5 * len(first))
        heights = [p.z for m in shown.markers for p in m.points]
        self.assertTrue(min(heights) < 0.0 and max(heights) < 0.5, heights)

    def test_topics_are_there_for_who_comes_late(self) -> None:
        self.mapped()
        late = Inbox("/octomap_point_cloud_centers", PointCloud2)
        self.assertEqual(late.wait_for_stamp(self.clock_s).header.frame_id, "world")


if __name__ == "__main__":
    rospy.init_node("octomap_server_alone_test")
    rostest.rosrun("explore_3dnav", "octomap_server_alone", OctomapServerAloneTest, sys.argv)
