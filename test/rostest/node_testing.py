"""What the rostests share: mailboxes that are waited on with a time limit, publishers that are heard, and made-up sensors."""

import math
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState, LaserScan
from std_msgs.msg import String

from rigid_geometry import transform_from_rpy
from ros_adapters.conversions import header, pose_message, stamp_of
from ros_adapters.node import READY_TOPIC

sys.path.append(str(Path(__file__).resolve().parents[1] / "system"))
from slow_machine import slowness  # noqa: F401  # for the tests

TIMEOUT_S = 60.0  # what does not come within it does not come on a slow machine either
QUIET_S = 0.3
BEAMS = 1081
TILT_JOINT = "tilt_joint"


class Inbox:
    """The messages of a topic in the order of their arrival."""

    def __init__(self, topic: str, message_type: type) -> None:
        self.topic = topic
        self.messages: list[Any] = []
        self._arrived = threading.Condition()
        self._subscriber = rospy.Subscriber(topic, message_type, self._on_message, queue_size=None, tcp_nodelay=True, buff_size=2**25)

    def _on_message(self, message: Any) -> None:
        with self._arrived:
            self.messages.append(message)
            self._arrived.notify_all()

    def wait_for(self, wanted: Callable[[Any], bool] = lambda _: True, timeout_s: float = TIMEOUT_S) -> Any:
        """The first message that is wanted, also of those that came before; AssertionError when none comes in time."""
        seen = 0
        deadline = time.monotonic() + timeout_s
        with self._arrived:
            while True:
                for message in self.messages[seen:]:
                    if wanted(message):
                        return message
                seen = len(self.messages)
                left = deadline - time.monotonic()
                assert left > 0, f"no message as wanted on {self.topic} within {timeout_s:.0f} s, {seen} others"
                self._arrived.wait(left)

    def wait_for_stamp(self, stamp_s: float, timeout_s: float = TIMEOUT_S) -> Any:
        """The message with this header stamp."""
        return self.wait_for(lambda m: abs(stamp_of(m) - stamp_s) < 1e-6, timeout_s)

    def stamps(self) -> list[float]:
        """Header stamps of all messages."""
        return [round(stamp_of(m), 6) for m in list(self.messages)]

    def wait_until_connected(self) -> "Inbox":
        """Until somebody publishes here."""
        wait_until(lambda: self._subscriber.get_num_connections() > 0, f"a publisher of {self.topic}")
        return self


def wait_until(condition: Callable[[], bool], what: str, timeout_s: float = TIMEOUT_S) -> None:
    """Looks until `condition` holds; AssertionError with `what` when it does not in time."""
    deadline = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline, f"waited {timeout_s:.0f} s in vain for {what}"
        time.sleep(0.01)


def feed(topic: str, message_type: type) -> rospy.Publisher:
    """A publisher, once everybody who listens to the topic hears it, the node under test among them: a test may listen as well."""
    publisher = rospy.Publisher(topic, message_type, queue_size=None, tcp_nodelay=True)
    wait_until(lambda: 0 < len(subscribers_of(topic)) <= publisher.get_num_connections(), f"all subscribers of {topic}")
    return publisher


def subscribers_of(topic: str) -> list[str]:
    """Names of the nodes that listen to a topic."""
    _, subscribers, _ = rosgraph.Master("/node_testing").getSystemState()
    return [node for name, nodes in subscribers if name == rospy.resolve_name(topic) for node in nodes]


def wait_for_node(name: str, timeout_s: float = 120.0) -> None:
    """Until the node says that it is ready."""
    Inbox(READY_TOPIC, String).wait_for(lambda m: m.data == name, timeout_s)


class DiagnosticsOf:
    """What a node says of itself on /diagnostics."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._inbox = Inbox("/diagnostics", DiagnosticArray)

    def wait_until_connected(self) -> "DiagnosticsOf":
        """Until somebody publishes diagnostics."""
        self._inbox.wait_until_connected()
        return self

    def counts(self) -> dict[str, str]:
        """The newest values by key."""
        newest: dict[str, str] = {}
        for array in list(self._inbox.messages):
            for status in array.status:
                if status.name == self._name:
                    newest = {v.key: v.value for v in status.values}
        return newest

    def message(self) -> str:
        """Its newest message."""
        said = [status.message for array in list(self._inbox.messages) for status in array.status if status.name == self._name]
        return said[-1] if said else ""

    def wait_for_count(self, what: str, at_least: int = 1) -> None:
        """Until a counter of the node's own stage is so high."""
        wait_until(lambda: int(self.counts().get(what, 0)) >= at_least, f"{what} counted {at_least} times: {self.counts()}")

    def dropped(self, what: str) -> int:
        """How many inputs were dropped under a heading, by the newest report; 0 when it does not mention it."""
        return int(self.counts().get(f"dropped: {what}", "0").partition(",")[0])

    def wait_for_dropped(self, what: str, at_least: int = 1, timeout_s: float = TIMEOUT_S) -> None:
        """Until so many were counted."""
        deadline = time.monotonic() + timeout_s
        while self.dropped(what) < at_least:
            assert time.monotonic() < deadline, f"{what!r} was not counted {at_least} times: {self.counts()}"
            time.sleep(0.01)


def run_misconfigured(node: str, *parameters: str) -> tuple[int, str]:
    """Exit code and stderr of a node started beside the one under test with private parameters name:=value."""
    with suppress(KeyError):  # those of the last time
        rospy.delete_param(f"/misconfigured_{node}")
    command = ["rosrun", "explore_3dnav", node, f"__name:=misconfigured_{node}", *(f"_{p}" for p in parameters)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120.0)
    return done.returncode, done.stderr


def one_line_of(stderr: str) -> str:
    """The only line that is there, but for the word of a slow machine; AssertionError when there are others."""
    lines = [line for line in stderr.splitlines() if line.strip() and "loads its kernels" not in line]
    assert len(lines) == 1, f"expected one line: {stderr!r}"
    return lines[0]


# -- made-up sensors


def scan(stamp_s: float, ranges: Any = 2.0, beams: int = BEAMS) -> LaserScan:
    """A scan of the robot's laser with `beams` beams, all of one range or of those given."""
    increment = math.radians(0.25)
    message = LaserScan(header=header(stamp_s, "laser"), angle_min=math.radians(-135), angle_max=math.radians(135))
    message.angle_increment, message.time_increment, message.scan_time = increment, 0.025 / 1440, 0.025
    message.range_min, message.range_max = 0.1, 30.0
    message.ranges = np.broadcast_to(np.asarray(ranges, dtype=np.float64), beams).tolist()
    return message


def clock(now_s: float) -> Clock:
    """The time that it is for nodes under test, with /use_sim_time."""
    return Clock(rospy.Time.from_sec(now_s))


def joints(stamp_s: float, tilt_rad: float = 0.0) -> JointState:
    """The tilting joint's sample."""
    return JointState(header=header(stamp_s, ""), name=[TILT_JOINT], position=[tilt_rad], velocity=[0.0])


def odometry(stamp_s: float, x: float = 0.0, y: float = 0.0, yaw: float = 0.0, v: float = 0.0, w: float = 0.0) -> Odometry:
    """/odom of a robot on flat ground, with a covariance."""
    message = Odometry(header=header(stamp_s, "odom"), child_frame_id="base_link")
    message.pose.pose = pose_message(transform_from_rpy((x, y, 0.132), (0.0, 0.0, yaw)))
    message.pose.covariance = (np.eye(6) * 1e-4).ravel().tolist()
    message.twist.twist.linear.x, message.twist.twist.angular.z = v, w
    return message


def wheels(stamp_s: float, v: float = 0.0, w: float = 0.0) -> Odometry:
    """The encoders' velocities."""
    message = Odometry(header=header(stamp_s, "odom"), child_frame_id="base_link")
    message.pose.pose.orientation.w = 1.0
    message.twist.twist.linear.x, message.twist.twist.angular.z = v, w
    return message


def imu(
    stamp_s: float,
    gyro: tuple[float, float, float] = (0.0, 0.0, 0.0),
    accel: tuple[float, float, float] = (0.0, 0.0, 9.81),
    frame: str = "imu_link",
) -> Imu:
    """An IMU sample of a robot that stands level."""
    message = Imu(header=header(stamp_s, frame), angular_velocity=Vector3(*gyro), linear_acceleration=Vector3(*accel))
    message.orientation_covariance = [-1.0] + [0.0] * 8
    return message


def octomap_bytes(message: Any) -> bytes:
    """The tree of a received octomap_msgs/Octomap."""
    return np.asarray(message.data, dtype=np.int8).tobytes()


def floor_and_walls(half_m: float = 3.0, step_m: float = 0.06) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) points of a square room around the robot and (N, 3) origins at the laser, float32, in base_link."""
    line = np.arange(-half_m, half_m, step_m)
    floor = np.stack([a.ravel() for a in (*np.meshgrid(line, line), np.full((line.size, line.size), -0.132))], axis=1)
    up = np.arange(-0.132, 1.9, step_m)
    along, height = (a.ravel() for a in np.meshgrid(line, up))
    edge = np.full(along.size, half_m)
    walls = [np.stack(c, axis=1) for c in ((edge, along, height), (-edge, along, height), (along, edge, height), (along, -edge, height))]
    points = np.concatenate([floor, *walls]).astype(np.float32)
    return points, np.tile(np.float32([0.23, 0.0, 0.79]), (len(points), 1))
