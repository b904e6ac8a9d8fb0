"""Memory of each node while a robot explores a world and then drives to and fro in it for hours, mapping all the way.

    python benchmarks/memory_over_hours.py [--world rooms] [--seed 1] [--hours 2] [--keep DIR]

Simulated hours, as fast as the machine goes. Goals are places where the robot was before. Memory is what the kernel calls resident.
Growth is that of the second half: a line through it, by least squares. Beside it stand the sweeps that came in the map meanwhile.
Measuring begins when all is explored. From then on Ctrl-C ends it with what was measured so far.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import actionlib
import numpy as np
import rospy
import tf2_ros
from actionlib_msgs.msg import GoalStatus
from explore_3dnav.msg import ExploreStatus, RunEvent
from geometry_msgs.msg import PoseStamped
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal
from registration_scores import text_table

from ros_adapters.memory_use import memory_mb
from roslaunch_process import free_port

HEADER = ("node", "MB after exploring", "half way", "at the end", "MB an hour")
EVERY_S, START_S, END_S = 20.0, 12.0, 120.0  # of wall time
APART_M = 1.0  # places that count as two


@dataclass
class Samples:
    """Memory by node at moments of simulated time, s, and how many sweeps there were."""

    hours: list[float] = field(default_factory=list)
    sweeps: list[int] = field(default_factory=list)
    mb: list[dict[str, float]] = field(default_factory=list)

    def add(self, stamp_s: float, sweeps: int, sizes: Mapping[str, Mapping[str, float]]) -> None:
        self.hours.append(stamp_s / 3600.0)
        self.sweeps.append(sweeps)
        self.mb.append({name: size["end"] for name, size in sizes.items()})

    def table(self) -> str:
        hours, half = np.array(self.hours), len(self.hours) // 2
        rows = []
        for name in sorted(self.mb[-1]):
            size = np.array([sample.get(name, np.nan) for sample in self.mb])
            is_there = np.isfinite(size[half:])
            slope = np.polyfit(hours[half:][is_there], size[half:][is_there], 1)[0] if is_there.sum() > 1 else np.nan
            rows.append((name, *(f"{size[i]:.1f}" for i in (0, half, -1)), f"{slope:.1f}"))
        told = f"{hours[-1]:.2f} h; sweeps: {self.sweeps[0]}, {self.sweeps[half]}, {self.sweeps[-1]}"
        return f"{text_table(HEADER, rows)}\n{told}"


class Driver:
    """Sends the robot to places where it was before, one after the other, once nothing is left to explore."""

    def __init__(self, seed: int) -> None:
        self.state, self.sweeps, self.reached, self.asked = "", 0, 0, 0
        self.places: list[tuple[float, float]] = []
        self._rng = np.random.default_rng(seed)
        self._tf = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._tf)
        self._actions = actionlib.SimpleActionClient("move_base", MoveBaseAction)
        rospy.Subscriber("/explore/status", ExploreStatus, self._on_status)
        rospy.Subscriber("/exploration/event", RunEvent, self._on_event)

    def _on_status(self, message: ExploreStatus) -> None:
        self.state = message.state

    def _on_event(self, message: RunEvent) -> None:
        self.sweeps = message.sweeps

    def note_place(self) -> None:
        try:
            at = self._tf.lookup_transform("map", "base_link", rospy.Time()).transform.translation
        except tf2_ros.TransformException:
            return
        if all(np.hypot(at.x - x, at.y - y) > APART_M for x, y in self.places):
            self.places.append((at.x, at.y))

    def drive_on(self) -> None:
        goal = MoveBaseGoal(PoseStamped())
        goal.target_pose.header.frame_id = "map"
        x, y = self.places[self._rng.integers(len(self.places))]
        goal.target_pose.pose.position.x, goal.target_pose.pose.position.y, goal.target_pose.pose.orientation.w = x, y, 1.0
        self._actions.send_goal(goal)
        self.asked += 1

    def has_arrived(self) -> bool:
        """Whether nothing is left of the goal: it is reached, or was given up."""
        state = self._actions.get_state()
        self.reached += state == GoalStatus.SUCCEEDED
        return state not in (GoalStatus.PENDING, GoalStatus.ACTIVE)


def driven(seed: int, until_s: float, launch: "subprocess.Popen[bytes]") -> Samples:
    """What was measured from the end of exploration until so many simulated seconds."""
    driver, samples, is_over = Driver(seed), Samples(), threading.Event()

    def measure() -> None:
        while not is_over.wait(EVERY_S):
            samples.add(rospy.get_time(), driver.sweeps, memory_mb(rospy.get_param("/revival", {})))

    while driver.state != ExploreStatus.DONE and launch.poll() is None:
        driver.note_place()
        time.sleep(0.2)
    sampler = threading.Thread(target=measure)
    sampler.start()
    try:
        while rospy.get_time() < until_s and launch.poll() is None:
            driver.drive_on()
            while not driver.has_arrived() and launch.poll() is None:
                time.sleep(0.05)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
    is_over.set()
    sampler.join()
    print(f"{driver.reached} of {driver.asked} goals were reached, among {len(driver.places)} places")
    return samples


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--world", default="rooms")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--hours", type=float, default=2.0, help="simulated")
    parser.add_argument("--keep", type=Path, help="a folder for the run")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        out = options.keep.absolute() if options.keep else Path(folder) / "run"
        port, limit_s = free_port(), 3600.0 * options.hours
        os.environ["ROS_MASTER_URI"] = f"http://localhost:{port}"
        words = f"world:={options.world}", f"seed:={options.seed}", f"out:={out}", f"max_sim_time:={2.0 * limit_s}"
        launch = subprocess.Popen(["roslaunch", "-p", str(port), "explore_3dnav", "explore.launch", *words], stdout=subprocess.DEVNULL)
        try:
            time.sleep(START_S)
            rospy.init_node("memory_over_hours", disable_signals=True)
            samples = driven(options.seed, limit_s, launch)
            print(samples.table() if samples.mb else "the run ended before anything was measured", flush=True)
        finally:
            launch.terminate()
            launch.wait(END_S)
    return 0 if samples.mb and launch.returncode == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
