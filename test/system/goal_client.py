"""goal_client.py: what people and programs ask of a robot that explores, with move_base's clients; exit code 0 when it did as it should.

While it explores, a joystick takes it over, and lets go. After the end it is sent to goals, and a cancel makes it stand.
"""

import math
import sys
import threading
import time
from collections.abc import Callable

import actionlib
import rospy
import tf2_ros
from actionlib_msgs.msg import GoalStatus
from explore_3dnav.msg import RunEvent
from geometry_msgs.msg import PoseStamped, Twist
from move_base_msgs.msg import MoveBaseAction, MoveBaseFeedback, MoveBaseGoal
from nav_msgs.srv import GetPlan
from slow_machine import patience_s

GOAL_S, EXPLORED_S = 240.0, 900.0
NEAR_M = 0.5  # a goal is the ground within 0.5 m of it
BY_HAND_MPS = -0.03  # nothing looks at obstacles then, and two seconds here are five of the simulator


def expect(holds: bool, what: str) -> None:
    print(f"{'ok' if holds else 'NOT'}: {what}", flush=True)
    if not holds:
        sys.exit(1)


def wait_until(condition: Callable[[], bool], seconds: float, what: str) -> None:
    deadline = time.monotonic() + patience_s(seconds)
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.02)
    expect(condition(), what)


class Client:
    def __init__(self) -> None:
        self.events: list[RunEvent] = []
        self.wheels = Twist()
        rospy.Subscriber("/exploration/event", RunEvent, self.events.append)
        rospy.Subscriber("/cmd_vel", Twist, self._on_wheels)
        self._joystick = rospy.Publisher("/joy_teleop/cmd_vel", Twist, queue_size=1)
        self._tf = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._tf)
        self._actions = actionlib.SimpleActionClient("move_base", MoveBaseAction)

    def _on_wheels(self, message: Twist) -> None:
        self.wheels = message

    def state(self) -> str:
        return self.events[-1].state if self.events else ""

    def place(self) -> tuple[float, float]:
        at = self._tf.lookup_transform("map", "base_link", rospy.Time()).transform.translation
        return at.x, at.y

    def take_over(self, seconds: float) -> None:
        twist, let_go = Twist(), threading.Event()
        twist.linear.x = BY_HAND_MPS

        def steer() -> None:
            while not let_go.wait(0.05):
                self._joystick.publish(twist)

        hand = threading.Thread(target=steer)
        hand.start()
        wait_until(lambda: self.state() == "taken_over" and self.wheels.linear.x == BY_HAND_MPS, 60.0, "the joystick drives")
        time.sleep(seconds)
        still = self.wheels.linear.x == BY_HAND_MPS
        let_go.set()
        hand.join()
        expect(still, "for as long as it speaks")

    def send(self, x: float, y: float, frame: str = "map", seen: "Callable[[MoveBaseFeedback], None] | None" = None) -> None:
        goal = MoveBaseGoal(PoseStamped())
        goal.target_pose.header.frame_id = frame
        goal.target_pose.pose.position.x, goal.target_pose.pose.position.y, goal.target_pose.pose.orientation.w = x, y, 1.0
        self._actions.send_goal(goal, feedback_cb=seen)

    def result(self) -> tuple[int, str]:
        self._actions.wait_for_result(rospy.Duration(patience_s(GOAL_S)))
        return self._actions.get_state(), self._actions.get_goal_status_text()

    def explore(self) -> None:
        wait_until(lambda: self.state() == "driving", EXPLORED_S, "it explores")
        self.take_over(2.0)
        wait_until(lambda: self.state() in ("settling", "sweeping", "mapping", "driving"), 60.0, "exploration goes on")
        wait_until(lambda: self.state() == "finished", EXPLORED_S, "it ends")
        expect(self.events[-1].reason.startswith("explored"), f"because of: {self.events[-1].reason}")

    def drive_in_the_finished_map(self) -> None:
        expect(self._actions.wait_for_server(rospy.Duration(patience_s(20.0))), "move_base lives on")
        places: list[MoveBaseFeedback] = []
        self.send(0.0, 0.0, seen=places.append)
        state, text = self.result()
        away_m = math.hypot(*self.place())
        expect(state == GoalStatus.SUCCEEDED and away_m < NEAR_M, f"a goal in map is reached: {state} {text}, {away_m:.2f} m beside it")
        expect(len(places) > 20, f"with feedback: {len(places)} places")
        self.send(900.0, 0.0)
        state, text = self.result()
        expect(state == GoalStatus.ABORTED and "no ground" in text, f"an unreachable one is aborted: {state} {text}")
        self.cancel_on_the_way()
        self.send(0.3, 0.0, "base_link")
        state, text = self.result()
        expect(state == GoalStatus.SUCCEEDED, f"a goal in base_link is reached: {state} {text}")

    def cancel_on_the_way(self) -> None:
        far = self.farthest()
        self.send(*far)
        wait_until(lambda: abs(self.wheels.linear.x) > 0.1, 120.0, f"it drives to {far}")
        self._actions.cancel_all_goals()
        state, text = self.result()
        expect(state == GoalStatus.PREEMPTED, f"the goal is cancelled: {state} {text}")
        wait_until(lambda: self.wheels.linear.x == 0.0 == self.wheels.angular.z, 10.0, "the robot stands")
        at, moved = self.place(), False
        for _ in range(50):
            time.sleep(0.1)
            moved = moved or math.dist(at, self.place()) > 0.05
        expect(not moved and self.state() in ("paused", "finished"), f"and stays there: {self.state()}")

    def farthest(self) -> tuple[float, float]:
        """A place in the map that make_plan leads to, as far away as it finds one."""
        return self.reachable()[0]

    def reachable(self) -> list[tuple[float, float]]:
        """Places around the map's origin that make_plan leads to, the farthest first."""
        found = []
        make_plan = rospy.ServiceProxy("/move_base/make_plan", GetPlan)
        for radius_m in (6.0, 4.0, 3.0, 2.0):
            for k in range(8):
                goal = PoseStamped()
                goal.header.frame_id = "map"
                goal.pose.position.x, goal.pose.position.y = radius_m * math.cos(k * math.pi / 4), radius_m * math.sin(k * math.pi / 4)
                if make_plan(PoseStamped(), goal, 0.3).plan.poses:
                    found.append((goal.pose.position.x, goal.pose.position.y))
        expect(bool(found), "make_plan leads somewhere")
        return found


if __name__ == "__main__":
    rospy.init_node("goal_client", disable_rostime=True)
    client = Client()
    client.explore()
    client.drive_in_the_finished_map()
