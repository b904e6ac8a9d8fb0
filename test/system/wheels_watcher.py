"""wheels_watcher.py PID NODE INPUT [killed]: stops or kills a process while the robot drives, and sees that the wheels stand and go on.

Exit code 0 when they stood within 0.9 s, NODE named INPUT on /diagnostics within 1.5 s, and the robot drove again after the process
went on; a line says how long what took. The 0.3 s of silence themselves are held by the nodes' rostests, in simulated time.
"""

import math
import os
import signal
import sys
import threading
import time
from contextlib import suppress

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from slow_machine import patience_s, slowness

DRIVES_MPS, STANDS_MPS = 0.15, 0.03
SILENT_S = {signal.SIGSTOP: 3.0, signal.SIGKILL: 1.0}  # a node that was killed is not there again before
STAND_WITHIN_S = 0.9  # 0.3 of silence, 0.05 each of the node that notices and of the base, 0.23 of braking, and as much for the machine
NAMED_WITHIN_S, GOES_ON_WITHIN_S = 1.5, 120.0


def wake_up(pid: int) -> None:
    """Lets a stopped process go on; on a busy machine the one above it may have taken it for hung, and has another in its place."""
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGCONT)


class Watcher:
    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.speeds: list[tuple[float, float]] = []  # steady time, m/s
        self.said: list[tuple[float, str, str]] = []  # steady time, node, message
        rospy.Subscriber("/ground_truth/odom", Odometry, self._on_truth, queue_size=None, tcp_nodelay=True)
        rospy.Subscriber("/diagnostics", DiagnosticArray, self._on_diagnostics, queue_size=None)

    def _on_truth(self, message: Odometry) -> None:
        v = message.twist.twist.linear
        self.speeds.append((time.monotonic(), math.sqrt(v.x**2 + v.y**2 + v.z**2)))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.said.extend((time.monotonic(), status.name, status.message) for status in message.status)

    def drives(self, ticks: int = 12) -> bool:
        """For so many ticks of the simulator, 0.6 s of its time, and until now; how many there are in a second depends on the machine."""
        newest = self.speeds[-ticks:]
        is_now = len(newest) == ticks and newest[-1][0] > time.monotonic() - 0.6
        return is_now and min(speed for _, speed in newest) > DRIVES_MPS

    def wait_until_it_drives(self) -> None:
        deadline = time.monotonic() + patience_s(GOES_ON_WITHIN_S)
        while not self.drives():
            if time.monotonic() > deadline:
                sys.exit(f"it did not drive within {patience_s(GOES_ON_WITHIN_S):.0f} s")
            time.sleep(0.01)

    def stood_after(self, since_s: float) -> float:
        """Seconds after which the wheels stood, for the rest of the silence."""
        moving = [at for at, speed in list(self.speeds) if at > since_s and speed > STANDS_MPS]
        return max(moving, default=since_s) - since_s

    def named_after(self, since_s: float, node: str, topic: str) -> float:
        """Seconds after which the node named the input; infinite when it did not."""
        return min(
            (at - since_s for at, name, text in list(self.said) if at > since_s and name == node and topic in text), default=math.inf
        )


def main() -> None:
    pid, node, topic = int(sys.argv[1]), sys.argv[2], sys.argv[3]
    number = signal.SIGKILL if sys.argv[4:] else signal.SIGSTOP
    rospy.init_node("wheels_watcher", anonymous=True, disable_rostime=True)
    watcher = Watcher()
    watcher.wait_until_it_drives()
    stopped_s = time.monotonic()
    os.kill(pid, number)
    time.sleep(SILENT_S[number])
    stood_s, named_s = watcher.stood_after(stopped_s), watcher.named_after(stopped_s, node, topic) if node else 0.0
    if number == signal.SIGSTOP:
        wake_up(pid)
    slack = slowness()  # promised for a machine that does little else
    if stood_s > min(slack * STAND_WITHIN_S, SILENT_S[number] - 0.1) or named_s > slack * NAMED_WITHIN_S:
        sys.exit(f"the wheels stood after {stood_s:.2f} s, {topic or 'what is silent'} was named after {named_s:.2f} s")
    begun_s = time.monotonic()
    watcher.wait_until_it_drives()
    print(f"stood after {stood_s:.2f} s, named after {named_s:.2f} s, drove again after {time.monotonic() - begun_s:.1f} s")


if __name__ == "__main__":
    main()
