"""map_goal_client.py: goals in a finished map, of a robot that only localises; exit code 0 when it did so.

Prints after each goal "at X Y in map, X Y in world": where it was sent, and where it truly is.
"""

import math

import rospy
from actionlib_msgs.msg import GoalStatus
from dynamic_reconfigure.client import Client as Reconfigure
from goal_client import expect, wait_until
from nav_msgs.msg import Odometry
from request_client import RequestClient

GOALS, SLOW_MPS, AROUND_M = 3, 0.3, 3.5
NOD_S, HOME_S = 2.0, 120.0


class MapGoalClient(RequestClient):
    def __init__(self) -> None:
        super().__init__()
        self.true: Odometry = Odometry()
        rospy.Subscriber("/ground_truth/odom", Odometry, self._on_truth)

    def _on_truth(self, message: Odometry) -> None:
        self.true = message

    def finds_itself(self) -> None:
        self.wait_for("paused", seconds=300.0)
        wait_until(lambda: self._tf.can_transform("map", "base_link", rospy.Time()), 30.0, "tf tells where")
        expect("exploration is off; goals are driven to" in self.told[-1].reason, f"it waits for goals: {self.told[-1].reason}")
        for name in ("start", "stop", "resume"):
            done, why = self.ask(name)
            expect(not done and "exploration is off" in why, f"{name} is refused: {why}")

    def drives_to_goals(self) -> None:
        for _ in range(GOALS):
            goal = self.farthest()
            self.send(*goal)
            state, text = self.result()
            expect(state == GoalStatus.SUCCEEDED, f"a goal is reached: {state} {text}")
            wait_until(lambda: self.wheels.linear.x == 0.0 == self.wheels.angular.z, 60.0, "it stands")
            self.wait_for("paused", seconds=120.0)
            self.looks_around()
            place, at = self.true.pose.pose.position, self.place()
            print(f"at {at[0]:.3f} {at[1]:.3f} in map, {place.x:.3f} {place.y:.3f} in world", flush=True)

    def looks_around(self) -> None:
        """The laser nods once while the robot stands: it may have come where it saw too little to know its place."""
        until = self.true.header.stamp + rospy.Duration(NOD_S)
        wait_until(lambda: self.true.header.stamp > until, 60.0, "it has looked around")

    def farthest(self) -> tuple[float, float]:
        """As far from where the robot is as make_plan leads, of places around home. Farther off the map ends, and what is new stops it."""
        x, y = self.place()
        return max((p for p in self.reachable() if math.hypot(*p) < AROUND_M), key=lambda p: math.hypot(p[0] - x, p[1] - y))

    def is_slowed(self) -> None:
        """Between two ticks of lock-step, by dynamic_reconfigure's own client."""
        answer = Reconfigure("move_base_node", timeout=60.0).update_configuration({"follower_max_speed_mps": SLOW_MPS})
        expect(answer["follower_max_speed_mps"] == SLOW_MPS, "it is told to drive slower")

    def comes_home(self) -> None:
        expect(self.ask("return_home")[0], "it is asked home")
        speeds = [0.0]

        def is_home() -> bool:
            speeds.append(self.wheels.linear.x)
            return bool(self.told[-1].state == "home")

        wait_until(is_home, HOME_S, "it is home")
        fastest = max(speeds)
        expect(0.1 < fastest < SLOW_MPS + 0.01, f"it comes home, slower: at most {fastest:.2f} m/s")


if __name__ == "__main__":
    rospy.init_node("map_goal_client", disable_rostime=True)
    client = MapGoalClient()
    client.finds_itself()
    client.drives_to_goals()
    client.is_slowed()
    client.comes_home()
