#!/usr/bin/env python3
"""exploration_monitor_node alone, started anew in every test, for each ends with its node: the reasons for which a run ends."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import rosgraph
import rospy
from explore_3dnav.msg import ExplorationDecision, RunEvent
from nav_msgs.msg import Odometry
from node_testing import Inbox, feed, odometry, one_line_of, run_misconfigured, slowness, wait_until
from std_msgs.msg import Bool
from std_srvs.srv import Trigger, TriggerResponse

import rostest
from node_life.life import MEMORY
from ros_adapters.conversions import header

NODE = "exploration_monitor_node"
VICTIM = "victim_node"
DEATH_LIMIT_S = 10.0
HEARD_S = 1.5  # what was sent before is heard by then: topics are not ordered among each other


class Monitor:
    """A running monitor and the folder that it writes to."""

    def __init__(self, out: Path, command: list[str]) -> None:
        self.out, self._command = out, command
        self.process = self._started()
        self.events = feed("/exploration/event", RunEvent)
        self.odometry = feed("/odom", Odometry)
        self.decisions = feed("/exploration/decision", ExplorationDecision)

    def _started(self) -> subprocess.Popen[str]:
        environment = {**os.environ, MEMORY: str(self.out / "memory")}
        (self.out / "memory").mkdir(exist_ok=True)
        return subprocess.Popen(self._command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment)

    def is_killed_and_started_again(self) -> None:
        """As by node_revival."""
        self.process.kill()
        self.process.communicate()
        self.process = self._started()

    def say(self, state: str, reason: str) -> None:
        self.events.publish(RunEvent(header(110.0, "odom"), state, reason, 3, False, "", 0.0, False, 0.0))

    def end(self, timeout_s: float = 90.0) -> tuple[dict[str, object], str]:
        """The summary and what was printed, once the node has ended."""
        output, _ = self.process.communicate(timeout=timeout_s)
        assert self.process.returncode == 0, f"exit code {self.process.returncode}: {output}"
        return json.loads((self.out / "summary.json").read_text()), output


@contextmanager
def monitor(*parameters: str, required: bool = True) -> Iterator[Monitor]:
    with tempfile.TemporaryDirectory() as folder:
        command = [
            "rosrun",
            "explore_3dnav",
            NODE,
            f"_out:={folder}",
            "_sim:=false",
            f"_required:={str(required).lower()}",
            *(f"_{p}" for p in parameters),
        ]
        run = Monitor(Path(folder), command)
        try:
            yield run
        finally:
            run.process.kill()
            run.process.communicate()
            if rospy.has_param(f"/{NODE}"):  # parameters outlive their node
                rospy.delete_param(f"/{NODE}")


class ExplorationMonitorTest(unittest.TestCase):
    saved: list[str] = []
    may_save = threading.Event()

    @classmethod
    def setUpClass(cls) -> None:
        for node in ("pose_graph_mapping_node", "octomap_server_3dnav_node"):
            rospy.Service(f"/{node}/save", Trigger, partial(cls.save, node))
        cls.may_save.set()

    @classmethod
    def save(cls, node: str, _request: object) -> TriggerResponse:
        cls.saved.append(node)
        cls.may_save.wait(120.0)
        return TriggerResponse(True, "")

    def test_explored_world_is_a_success_with_its_counters_and_a_saved_map(self) -> None:
        self.saved.clear()
        with monitor() as run:
            run.odometry.publish(odometry(100.0))
            run.odometry.publish(odometry(142.5, x=3.0))
            run.decisions.publish(ExplorationDecision(header=header(110.0, "map"), kind="explored", local_classifications=7))
            time.sleep(HEARD_S)
            run.say("finished", "explored: nothing is left")
            summary, output = run.end()
        self.assertIs(summary["success"], True)
        self.assertEqual((summary["stop_reason"], summary["sim_time_s"]), ("explored: nothing is left", 42.5))
        self.assertEqual(summary["local_classifications"], 7)
        self.assertEqual(set(self.saved), {"pose_graph_mapping_node", "octomap_server_3dnav_node"})
        self.assertIn("[explore]", output)

    def test_monitor_that_is_not_required_ends_the_run_and_lives_on(self) -> None:
        resume = Inbox("/explore/resume", Bool)
        victim = subprocess.Popen([sys.executable, "-c", f"import rospy; rospy.init_node('{VICTIM}'); rospy.spin()"])
        try:
            with monitor(f"watch:={VICTIM}", required=False) as run:
                resume.wait_until_connected()
                run.odometry.publish(odometry(100.0))
                run.odometry.publish(odometry(110.0, x=3.0))
                time.sleep(HEARD_S)
                run.say("finished", "explored: nothing is left")
                path = run.out / "summary.json"
                wait_until(path.exists, "the summary")
                self.assertFalse(resume.wait_for().data)
                run.say("driving", "to a goal after exploration")
                time.sleep(2.0)
                run.say("finished", "told to stop")  # somebody had it go on exploring
                wait_until(lambda: len(resume.messages) == 2, "that exploration is paused again")
                self.assertFalse(resume.messages[-1].data)
                self.assertEqual((run.process.poll(), victim.poll()), (None, None))
                run.process.send_signal(signal.SIGINT)
                summary, output = run.end()
        finally:
            victim.kill()
            victim.wait()
        self.assertEqual((summary["success"], summary["stop_reason"]), (True, "explored: nothing is left"))
        self.assertIn("the nodes live on", output)

    def test_monitor_that_dies_after_the_run_ended_is_started_again_and_ends_it_for_the_same_reason(self) -> None:
        self.saved.clear()
        self.may_save.clear()
        with monitor() as run:
            run.odometry.publish(odometry(100.0))
            run.odometry.publish(odometry(142.5, x=3.0))
            time.sleep(HEARD_S)
            run.say("finished", "explored: nothing is left")
            wait_until(lambda: bool(self.saved), "a map that is being saved")
            run.is_killed_and_started_again()  # nobody tells it anything any more
            self.may_save.set()
            summary, output = run.end()
        found = summary["success"], summary["stop_reason"], summary["sim_time_s"]
        self.assertEqual(found, (True, "explored: nothing is left", 42.5), output)

    def test_failed_run_is_no_success_and_says_why(self) -> None:
        with monitor() as run:
            run.say("failed", "the sweep did not begin within 3.0 s")
            summary, output = run.end()
        self.assertIs(summary["success"], False)
        self.assertIn("did not begin", summary["stop_reason"])
        self.assertIn("did not begin", output)

    def test_time_limit_ends_the_run(self) -> None:
        with monitor("max_sim_time:=50.0") as run:
            run.odometry.publish(odometry(100.0))
            run.odometry.publish(odometry(149.0))
            time.sleep(HEARD_S)
            self.assertIsNone(run.process.poll())
            run.odometry.publish(odometry(151.0))
            summary, output = run.end()
        self.assertTrue(str(summary["stop_reason"]).startswith("time limit"), output)

    def test_watched_node_that_dies_ends_the_run_with_its_name(self) -> None:
        victim = subprocess.Popen([sys.executable, "-c", f"import rospy; rospy.init_node('{VICTIM}'); rospy.spin()"])
        master = rosgraph.Master("/exploration_monitor_test")
        try:
            wait_until(lambda: any(f"/{VICTIM}" in nodes for _, nodes in master.getSystemState()[0]), VICTIM)
            with monitor(f"watch:={VICTIM}") as run:
                time.sleep(2.0)  # the monitor looks every second
                self.assertIsNone(run.process.poll())
                os.kill(victim.pid, signal.SIGKILL)
                died = time.monotonic()
                summary, output = run.end()
                self.assertLess(time.monotonic() - died, DEATH_LIMIT_S * slowness())
        finally:
            victim.kill()
            victim.wait()
        self.assertIs(summary["success"], False)
        self.assertIn(VICTIM, summary["stop_reason"])
        self.assertIn(VICTIM, output)

    def test_interrupt_leaves_a_summary(self) -> None:
        with monitor() as run:
            for name in ("map.bt", "trajectory.txt", "cloud.ply"):  # as the mapping and terrain nodes do when they are interrupted
                (run.out / name).write_text("a map")
            run.process.send_signal(signal.SIGINT)
            summary, _ = run.end()
        self.assertEqual((summary["stop_reason"], summary["success"]), ("interrupted", False))

    def test_bad_odometry_and_time_that_jumps_back_do_not_end_it(self) -> None:
        with monitor("max_sim_time:=50.0") as run:
            for message in (odometry(100.0), odometry(101.0, x=float("nan")), odometry(20.0), odometry(21.0)):
                run.odometry.publish(message)
            time.sleep(HEARD_S)
            self.assertIsNone(run.process.poll())
            run.say("finished", "explored: all")
            self.assertEqual(run.end()[0]["stop_reason"], "explored: all")

    def test_wrong_parameter_ends_the_node_with_the_nearest_name(self) -> None:
        for parameter, expected in (("status_peroid_s:=2.0", "did you mean status_period_s?"), ("max_sim_time:=-5.0", "is below")):
            code, stderr = run_misconfigured(NODE, parameter)
            self.assertEqual(code, 2, stderr)
            self.assertIn(expected, one_line_of(stderr))


if __name__ == "__main__":
    rospy.init_node("exploration_monitor_test")
    rostest.rosrun("explore_3dnav", "exploration_monitor", ExplorationMonitorTest, sys.argv)
