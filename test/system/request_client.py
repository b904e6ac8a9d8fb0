"""request_client.py: what people ask of exploration while it explores, and after its end; exit code 0 when it did so.

Pause and resume; zones while it drives; a goal that they close; home and back to exploring; home at the end; a new start.
"""

import math
import sys

import rospy
from actionlib_msgs.msg import GoalStatus
from explore_3dnav.msg import ExploreStatus, Zone
from explore_3dnav.srv import SetZones
from geometry_msgs.msg import Point32, Polygon
from goal_client import EXPLORED_S, Client, expect, wait_until
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from rigid_geometry import rotation_from_quat, yaw_of

HOME_M, HOME_RAD = 0.2, 0.2
ASIDE_M = 0.75  # of the closed ground from the robot's middle: it can turn


class RequestClient(Client):
    def __init__(self) -> None:
        super().__init__()
        self.told: list[ExploreStatus] = []
        rospy.Subscriber("/explore/status", ExploreStatus, self.told.append)

    def ask(self, name: str) -> tuple[bool, str]:
        answer = rospy.ServiceProxy(f"/explore/{name}", Trigger)()
        return answer.success, answer.message

    def wait_for(self, *states: str, seconds: float = 240.0) -> str:
        wait_until(lambda: bool(self.told) and self.told[-1].state in states, seconds, f"it is {' or '.join(states)}")
        return str(self.told[-1].reason)

    def heading(self) -> float:
        q = self._tf.lookup_transform("map", "base_link", rospy.Time()).transform.rotation
        return yaw_of(rotation_from_quat(q.x, q.y, q.z, q.w))

    def stands(self, why: str) -> None:
        wait_until(lambda: self.wheels.linear.x == 0.0 == self.wheels.angular.z, 30.0, f"the robot stands: {why}")

    def drives(self) -> None:
        wait_until(lambda: self.state() == "driving" and abs(self.wheels.linear.x) > 0.1, EXPLORED_S, "it drives")

    def pause_and_resume(self) -> None:
        self.drives()
        expect(not self.ask("resume")[0], "what is not paused is not resumed")
        expect(self.ask("pause")[0], "it is paused")
        self.wait_for("paused")
        self.stands("paused")
        expect(not self.ask("pause")[0], "and not twice")
        expect(self.ask("resume")[0], "it is resumed")
        self.wait_for("exploring")

    def zones(self) -> None:
        """All that is ahead of the robot is closed while it drives there."""
        self.drives()
        (x, y), yaw = self.place(), self.heading()
        ahead = [(ASIDE_M, -9.0), (9.0, -9.0), (9.0, 9.0), (ASIDE_M, 9.0)]
        c, s = math.cos(yaw), math.sin(yaw)
        corners = [Point32(x + c * a - s * b, y + s * a + c * b, 0.0) for a, b in ahead]
        set_zones = rospy.ServiceProxy("/explore/set_zones", SetZones)
        answer = set_zones(Header(frame_id="map"), [], [Zone(polygon=Polygon(corners))])
        expect(answer.accepted, f"a zone is set: {answer.message}")
        self.stands("what lies ahead is closed")
        there = self.place()
        beyond = c * (there[0] - x) + s * (there[1] - y)
        expect(beyond < ASIDE_M - 0.3, f"well before it: driven {beyond:.2f} m")
        self.send(x + c * 1.5, y + s * 1.5)
        state, text = self.result()
        expect(state == GoalStatus.ABORTED and "no_go[0]" in text, f"a goal there is aborted: {state} {text}")
        answer = set_zones(Header(frame_id="map"), [], [])
        expect(answer.accepted, f"the zone is taken away: {answer.message}")

    def home(self) -> None:
        expect(self.ask("return_home")[0], "it is asked home")
        self.wait_for("going_home")
        reason = self.wait_for("home")
        self.stands(reason)
        away_m, turn_rad = math.hypot(*self.place()), abs(self.heading())
        expect(away_m < HOME_M and turn_rad < HOME_RAD, f"there it is: {away_m:.2f} m and {turn_rad:.2f} rad from the start")

    def after_the_end(self) -> None:
        reason = self.wait_for("home", seconds=EXPLORED_S)
        expect("no reachable frontier" in reason and "; home, " in reason, f"it ends at home: {reason}")
        expect(self.ask("start")[0], "it is started again")
        self.wait_for("exploring", "going_home")
        self.wait_for("home", seconds=EXPLORED_S)
        expect(self.ask("stop")[1].startswith("exploration has ended already"), "and has ended again")


if __name__ == "__main__":
    rospy.init_node("request_client", disable_rostime=True)
    client = RequestClient()
    client.pause_and_resume()
    client.zones()
    client.drives()
    client.home()
    expect(client.ask("start")[0], "it is told to explore")
    client.wait_for("exploring")
    client.after_the_end()
    sys.exit(0)
