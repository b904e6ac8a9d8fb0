#!/usr/bin/env python3
"""explore_markers_node beside a made-up exploration: what rviz sends is asked of the services, and what they say is shown."""

import sys
import time
import unittest

import numpy as np
import rospy
from explore_3dnav.msg import ExploreStatus, ZoneList
from explore_3dnav.srv import SetZones, SetZonesRequest, SetZonesResponse
from geometry_msgs.msg import Pose
from node_testing import Inbox, feed, wait_for_node, wait_until
from std_srvs.srv import Trigger, TriggerResponse
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import InteractiveMarker, InteractiveMarkerFeedback, InteractiveMarkerInit, InteractiveMarkerUpdate

import rostest
from rigid_geometry import transform_from_rpy
from ros_adapters.conversions import header, transform_stamped
from ros_adapters.zone_messages import zone_list, zones_of

NODE, MARKERS = "explore_markers_node", "/explore/markers"
DEAF_S = 1.1  # interactive_markers' server, to a client that it does not know, after a marker was made


class ExploreMarkersTest(unittest.TestCase):
    asked: list[str] = []
    zones: list[SetZonesRequest] = []

    @classmethod
    def setUpClass(cls) -> None:
        cls.services = [
            rospy.Service(f"/explore/{name}", Trigger, lambda _, name=name: cls.answer(name))
            for name in ("start", "stop", "pause", "resume", "return_home")
        ]
        cls.services.append(rospy.Service("/explore/set_zones", SetZones, cls.set_zones))
        cls.listed = rospy.Publisher("/explore/zone_list", ZoneList, latch=True, queue_size=1)
        wait_for_node(NODE)
        cls.updates = Inbox(f"{MARKERS}/update", InteractiveMarkerUpdate).wait_until_connected()
        cls.feedback = feed(f"{MARKERS}/feedback", InteractiveMarkerFeedback)
        cls.status = feed("/explore/status", ExploreStatus)
        cls.tf = rospy.Publisher("/tf", TFMessage, queue_size=1)

    @classmethod
    def answer(cls, name: str) -> TriggerResponse:
        cls.asked.append(name)
        return TriggerResponse(name != "resume", "going home" if name == "return_home" else "exploration is not paused")

    @classmethod
    def set_zones(cls, request: SetZonesRequest) -> SetZonesResponse:
        """As octomap_server_3dnav_node does."""
        cls.zones.append(request)
        zones = zones_of(request.bounds, request.no_go)
        if problems := zones.problems():
            return SetZonesResponse(False, "; ".join(problems))
        cls.listed.publish(zone_list(zones))
        return SetZonesResponse(True, f"{len(zones.no_go)} no-go zones")

    def shown(self) -> dict[str, InteractiveMarker]:
        """All markers, as rviz has them that comes now."""
        markers = Inbox(f"{MARKERS}/update_full", InteractiveMarkerInit).wait_for().markers
        return {marker.name: marker for marker in markers}

    def robot_says(self, words: str) -> None:
        wait_until(lambda: words in self.shown()["robot"].description, f"{words!r} at the robot")

    def click(self, marker: str, title: str) -> None:
        time.sleep(DEAF_S)
        entries = {entry.title: entry.id for entry in self.shown()[marker].menu_entries}
        self.feedback.publish(
            InteractiveMarkerFeedback(
                header=header(0.0, "map"),
                client_id="rviz",
                marker_name=marker,
                event_type=InteractiveMarkerFeedback.MENU_SELECT,
                menu_entry_id=entries[title],
            )
        )

    def drag(self, marker: str, x: float, y: float) -> None:
        time.sleep(DEAF_S)
        for event in (InteractiveMarkerFeedback.MOUSE_DOWN, InteractiveMarkerFeedback.POSE_UPDATE, InteractiveMarkerFeedback.MOUSE_UP):
            told = InteractiveMarkerFeedback(header=header(0.0, "map"), client_id="rviz", marker_name=marker, event_type=event, pose=Pose())
            told.pose.position.x, told.pose.position.y, told.pose.orientation.w = x, y, 1.0
            self.feedback.publish(told)

    def drawn(self, count: int) -> np.ndarray:
        """(N, 2) corners of the no-go zone that was asked for last, of so many requests."""
        wait_until(lambda: len(self.zones) == count, f"{count} requests for zones, not {len(self.zones)}")
        return np.array([(p.x, p.y) for p in self.zones[-1].no_go[0].polygon.points])

    def test_1_menu_goes_with_the_robot_and_asks_what_it_says(self) -> None:
        robot = self.shown()["robot"]
        self.assertEqual((robot.header.frame_id, robot.header.stamp), ("base_link", rospy.Time()))
        for title, name, words in (("Return home", "return_home", "going home"), ("Resume", "resume", "exploration is not paused")):
            self.click("robot", title)
            self.robot_says(f"{title}: {words}")
            self.assertEqual(self.asked[-1], name)
        for title, name in (("Pause", "pause"), ("Start", "start"), ("Stop", "stop")):
            self.click("robot", title)
            wait_until(lambda name=name: self.asked[-1] == name, name)

    def test_2_state_of_exploration_stands_at_the_robot(self) -> None:
        self.status.publish(ExploreStatus(header(0.0, "map"), "going_home", "told to return home"))
        self.robot_says("going home")

    def test_3_without_a_place_nothing_is_drawn(self) -> None:
        self.click("robot", "Draw a no-go zone ahead")
        self.robot_says("tf does not tell 'base_link' in 'map'")
        self.assertEqual(self.zones, [])

    def test_4_zone_is_drawn_ahead_of_the_robot_and_its_corners_are_dragged(self) -> None:
        T = transform_from_rpy((1.0, 2.0, 0.132), (0.0, 0.0, np.pi / 2))
        known = feed("/tf", TFMessage)
        for stamp_s in (100.0, 101.0):
            known.publish(TFMessage([transform_stamped(stamp_s, "map", "base_link", T)]))
        self.click("robot", "Draw a no-go zone ahead")  # more than a second later
        wait_until(lambda: "no_go/0/3" in self.shown(), "the corners")
        square = np.array([(p.x, p.y) for p in self.zones[-1].no_go[-1].polygon.points])
        np.testing.assert_allclose(square.mean(axis=0), (1.0, 4.5), atol=1e-3)
        np.testing.assert_allclose(np.ptp(square, axis=0), 2.0, atol=1e-3)
        corner = self.shown()["no_go/0/1"]
        self.assertEqual(corner.header.frame_id, "map")
        self.assertAlmostEqual(corner.pose.position.z, 0.132, places=3)
        count = len(self.zones)
        self.drag("no_go/0/1", 3.5, 3.0)
        np.testing.assert_allclose(self.drawn(count + 1)[1], (3.5, 3.0), atol=1e-3)
        wait_until(lambda: abs(self.shown()["no_go/0/1"].pose.position.x - 3.5) < 1e-3, "the corner to stay there")

    def test_5_corner_that_is_refused_goes_back_and_the_reason_is_told(self) -> None:
        before, count = self.shown()["no_go/0/0"].pose.position, len(self.zones)
        self.drag("no_go/0/0", 1.0, 6.5)
        self.drawn(count + 1)
        self.robot_says("refused: no_go[0]: its sides cross")
        after = self.shown()["no_go/0/0"].pose.position
        self.assertEqual((after.x, after.y), (before.x, before.y))

    def test_6_corners_and_zones_are_added_and_taken_away(self) -> None:
        count = len(self.zones)
        self.click("no_go/0/0", "Add a corner")
        self.assertEqual(len(self.drawn(count + 1)), 5)
        wait_until(lambda: "no_go/0/4" in self.shown(), "the fifth corner")
        self.click("no_go/0/1", "Take this corner away")
        self.assertEqual(len(self.drawn(count + 2)), 4)
        wait_until(lambda: "no_go/0/4" not in self.shown(), "the corner to go")
        self.click("no_go/0/0", "Take this zone away")
        wait_until(lambda: "no_go/0/0" not in self.shown(), "the zone to go")
        self.click("robot", "Draw bounds around here")
        wait_until(lambda: "bounds/0/3" in self.shown(), "the bounds")
        self.click("robot", "Take all zones away")
        wait_until(lambda: set(self.shown()) == {"robot"}, "all zones to go")


if __name__ == "__main__":
    rospy.init_node("explore_markers_test")
    rostest.rosrun("explore_3dnav", "explore_markers", ExploreMarkersTest, sys.argv)
