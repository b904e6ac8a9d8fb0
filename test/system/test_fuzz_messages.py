"""Wrong messages on every topic that the nodes subscribe: each node lives on, counts what it dropped, and prints no traceback."""

import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from exploring import PACKAGE, free_port
from message_mutations import can_be_sent, mutated, of_no_numbers

from explore_command.parameters import ROBOT_NODES
from roslaunch_process.children import end_with_parent

MESSAGES, SEED = int(os.environ.get("FUZZ_MESSAGES", "200")), int(os.environ.get("FUZZ_SEED", "38"))  # so many of each topic
LEAST = 2000  # of all
SILENT_ABOUT = {  # topics whose messages of NaN are no fault: they have no number, or one that is shown and nothing else
    "/exploration/decision",
    "/exploration/event",
    "/diagnostics",
    "/move_base/cancel",
}
PATIENT = {"sweep_start_limit_s": 60.0, "sweep_limit_s": 600.0, "decision_limit_s": 3600.0}
_COUNT = re.compile(r"^(\d+)\b")
_OF_ROSPY = re.compile(
    r"\[rospy\.internal\]\[(?:ERROR|WARNING)\][^\n]*(?:Inbound TCP/IP connection failed|Unknown error initiating TCP/IP socket)[^\n]*:\s*"
    r"Traceback(?:\n?[^\n]+)+"
)


class Nodes:
    """A master, all nodes on it, and what they printed."""

    def __init__(self, folder: Path, environment: dict[str, str]) -> None:
        self.folder, self._environment, self.running = folder, environment, {}
        self._core = self._start("core", ["roscore", "-p", environment["ROS_MASTER_URI"].rpartition(":")[2]])

    def start(self, names: tuple[str, ...]) -> None:
        for name in names:
            self.running[name] = self._start(name, [sys.executable, str(PACKAGE / "nodes" / name), f"__name:={name}"])

    def _start(self, name: str, command: list[str]) -> "subprocess.Popen[bytes]":
        with (self.folder / f"{name}.log").open("wb") as log:
            return subprocess.Popen(command, env=self._environment, stdout=log, stderr=subprocess.STDOUT, preexec_fn=end_with_parent)

    def log_of(self, name: str) -> str:
        """What the node printed, but for rospy's own word about a connection that was gone before it was made, as by two at a time."""
        return _OF_ROSPY.sub("", (self.folder / f"{name}.log").read_text(errors="replace"))

    def stack_of(self, name: str) -> str:
        """Where the threads of a node stand, which ends it."""
        self.running[name].send_signal(signal.SIGABRT)
        self.running[name].wait(60.0)
        return f"{name}:\n{self.log_of(name).rpartition('Fatal Python error')[2]}"

    def end(self) -> None:
        for process in [*self.running.values(), self._core]:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        deadline = time.monotonic() + 8.0
        for process in [*self.running.values(), self._core]:
            try:
                process.wait(max(deadline - time.monotonic(), 0.1))
            except subprocess.TimeoutExpired:
                process.kill()


def until(condition: Callable[[], bool], timeout_s: float, what: str) -> None:
    deadline = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline, f"waited {timeout_s:.0f} s in vain for {what}"
        time.sleep(0.05)


@pytest.fixture(scope="module")
def nodes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Nodes]:
    """All nodes, running free, and this process as a node beside them."""
    os.environ["ROS_MASTER_URI"] = f"http://localhost:{free_port()}"
    import rosgraph
    import rospy

    folder = tmp_path_factory.mktemp("fuzz")
    found = Nodes(folder, {**os.environ, "ROS_LOG_DIR": str(folder), "PYTHONUNBUFFERED": "1", "PYTHONFAULTHANDLER": "1"})
    until(rosgraph.is_master_online, 80.0, "the master")
    rospy.init_node("fuzzer", disable_signals=True, disable_rostime=True)
    rospy.set_param("/robot", yaml.safe_load((PACKAGE / "config/robot.yaml").read_text()))
    rospy.set_param("/robot_description", (PACKAGE / "urdf/husky.urdf").read_text())
    rospy.set_param("/exploration_monitor_node", {"sim": False, "max_sim_time": 1e9, "watch": ""})
    rospy.set_param("/stop_scan_and_go_node", PATIENT)  # nobody sweeps here: a run that failed would rightly end the monitor
    found.start(ROBOT_NODES)
    yield found
    found.end()


class Counts:
    """The sum of all counters that each node has on /diagnostics, by the newest report."""

    def __init__(self) -> None:
        import rospy
        from diagnostic_msgs.msg import DiagnosticArray

        self._counts: dict[str, int] = {}
        self._subscriber = rospy.Subscriber("/diagnostics", DiagnosticArray, self._on_message, queue_size=None)

    def _on_message(self, message: Any) -> None:
        for status in message.status:
            if status.name in ROBOT_NODES and message._connection_header["callerid"] == f"/{status.name}":
                numbers = [_COUNT.match(v.value) for v in status.values if v.key.startswith("dropped: ")]
                self._counts[status.name] = sum(int(n[1]) for n in numbers if n)

    def of(self, node: str) -> int:
        return self._counts.get(node, 0)


def makers() -> dict[str, Callable[[float], Any]]:
    """A right message of every type, by its stamp."""
    sys.path.insert(0, str(PACKAGE / "test" / "rostest"))
    import node_testing as right
    from actionlib_msgs.msg import GoalID
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
    from explore_3dnav.msg import ExplorationDecision, FollowerCommand, MappedSweep, RunEvent
    from geometry_msgs.msg import PointStamped, PoseStamped, Twist
    from move_base_msgs.msg import MoveBaseActionGoal
    from rosgraph_msgs.msg import Clock
    from std_msgs.msg import Bool

    from rigid_geometry import transform_from_rpy
    from ros_adapters.conversions import cloud_message, header, pose_message, ros_time, transform_stamped
    from ros_adapters.grid_messages import terrain_grid_message

    points, origins = (a[::20] for a in right.floor_and_walls(3.0, 0.12))
    level = pose_message(transform_from_rpy((0.0, 0.0, 0.132)))
    flat = np.zeros((20, 20), np.float32)

    def grid(t: float) -> Any:
        return terrain_grid_message(t, "map", flat.astype(np.int8), flat, (-1.0, -1.0), 0.1, flat + 1.0)

    def cloud(t: float) -> Any:
        return cloud_message(t, "base_link", points, origins)

    def goal(t: float) -> Any:
        message = MoveBaseActionGoal(header=header(t, "map"))
        message.goal.target_pose = PoseStamped(header(t, "map"), level)
        return message

    from tf2_msgs.msg import TFMessage

    def transforms(t: float) -> Any:
        return TFMessage([transform_stamped(t, "map", "odom", transform_from_rpy((0.0, 0.0, 0.0)))])

    return {
        "sensor_msgs/LaserScan": lambda t: right.scan(t),
        "sensor_msgs/JointState": lambda t: right.joints(t),
        "sensor_msgs/Imu": lambda t: right.imu(t),
        "sensor_msgs/PointCloud2": cloud,
        "nav_msgs/Odometry": lambda t: right.odometry(t),
        "tf2_msgs/TFMessage": transforms,
        "explore_3dnav/TerrainGrid": grid,
        "explore_3dnav/MappedSweep": lambda t: MappedSweep(header(t, "map"), 0, [level], 0, False, False, "", cloud(t), cloud(t)),
        "explore_3dnav/FollowerCommand": lambda t: FollowerCommand(header=header(t, "base_link"), state="idle"),
        "explore_3dnav/ExplorationDecision": lambda t: ExplorationDecision(header=header(t, "map"), kind="keep"),
        "explore_3dnav/RunEvent": lambda t: RunEvent(header=header(t, "odom"), state="driving"),
        "geometry_msgs/PoseStamped": lambda t: PoseStamped(header(t, "map"), level),
        "geometry_msgs/PointStamped": lambda t: PointStamped(header(t, "map"), level.position),
        "diagnostic_msgs/DiagnosticArray": lambda t: DiagnosticArray(
            header(t, ""), [DiagnosticStatus(0, "a", "b", "c", [KeyValue("d", "1")])]
        ),
        "move_base_msgs/MoveBaseActionGoal": goal,
        "actionlib_msgs/GoalID": lambda t: GoalID(ros_time(t), "a"),
        "geometry_msgs/Twist": lambda _: Twist(),
        "std_msgs/Bool": lambda _: Bool(True),
        "std_msgs/Header": lambda t: header(t, ""),
        "rosgraph_msgs/Clock": lambda t: Clock(ros_time(t)),
    }


def subscribed() -> dict[tuple[str, str], list[str]]:
    """(topic, type) to the nodes that listen to it."""
    import rosgraph

    master = rosgraph.Master("/fuzzer")
    types = dict(master.getTopicTypes())
    _, subscribers, _ = master.getSystemState()
    found = {}
    for topic, names in subscribers:
        own = [name.strip("/") for name in names if name.strip("/") in ROBOT_NODES]
        if own and types.get(topic, "*") != "*":
            found[topic, types[topic]] = own
    return found


def test_every_node_lives_through_wrong_messages_and_counts_them(nodes: Nodes) -> None:
    import rospy
    from roslib.message import get_message_class

    counts, make, rng = Counts(), makers(), random.Random(SEED)
    ready = "/simulation/ready"
    names: set[str] = set()
    from std_msgs.msg import String

    listener = rospy.Subscriber(ready, String, lambda m: names.add(m.data))
    until(lambda: names >= set(ROBOT_NODES), 600.0, "all nodes to be ready")
    listener.unregister()
    topics = subscribed()
    unknown = {kind for _, kind in topics} - make.keys()
    assert not unknown, f"no right message to begin with: {unknown}"
    publishers = {topic: rospy.Publisher(topic, get_message_class(kind), queue_size=1000) for topic, kind in topics}
    time.sleep(2.0)
    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline and any(publishers[topic].get_num_connections() < len(own) for (topic, _), own in topics.items()):
        time.sleep(0.1)
    stamp_s, sent = time.time(), 0
    for _ in range(MESSAGES):
        stamp_s += 0.01
        for topic, kind in topics:
            right = make[kind](stamp_s)
            wrong = mutated(right, rng)
            if can_be_sent(wrong):
                publishers[topic].publish(wrong)
                sent += 1
            if rng.random() < 0.3:
                publishers[topic].publish(right)
        time.sleep(0.01)
    print(f"{sent} wrong messages on {len(topics)} topics")
    assert sent >= LEAST, f"only {sent} wrong messages could be sent"
    told = {name for (topic, _), listeners in topics.items() for name in listeners if topic not in SILENT_ABOUT}
    before, deadline = {name: counts.of(name) for name in told}, time.monotonic() + 150.0
    while time.monotonic() < deadline and (silent := [name for name in sorted(told) if counts.of(name) <= before[name]]):
        stamp_s += 0.1
        for topic, kind in topics:
            publishers[topic].publish(of_no_numbers(make[kind](stamp_s)))
        time.sleep(0.3)
    dead = [name for name, process in nodes.running.items() if process.poll() is not None]
    printed = {name: nodes.log_of(name) for name in ROBOT_NODES}
    assert not dead, "\n".join(f"{name}: {printed[name][-3000:]}" for name in dead)
    assert not [name for name in ROBOT_NODES if "Traceback" in printed[name]], "\n".join(
        printed[name][printed[name].index("Traceback") - 500 :][:3000] for name in ROBOT_NODES if "Traceback" in printed[name]
    )
    assert not silent, f"wrong messages that were not counted on /diagnostics: {silent}\n" + "\n".join(map(nodes.stack_of, silent))
