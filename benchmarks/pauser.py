"""Pauses a robot that explores, at moments that a seed draws; prints as JSON how often, and how often it drove meanwhile.

    ROS_MASTER_URI=http://localhost:11311 python benchmarks/pauser.py SEED PAUSES

For asked_runs.py; ends with the last pause, or when the master is gone.
"""

import argparse
import json
import sys
import time
from dataclasses import asdict, dataclass

import numpy as np
import rospy
from explore_3dnav.msg import ExploreStatus
from geometry_msgs.msg import Twist
from std_srvs.srv import Trigger

BETWEEN_S = 2.0, 20.0  # of wall time
LONG_S = 0.5, 5.0
ANSWER_S, BEGIN_S = 60.0, 240.0
STANDS_S = 0.5  # after it says that it is paused


@dataclass
class Told:
    """What came of it."""

    pauses: int = 0
    drove_while_paused: int = 0


class Pauser:
    """Listens to what exploration says and to the wheels."""

    def __init__(self) -> None:
        self.state, self.drives = "", False
        rospy.Subscriber("/explore/status", ExploreStatus, self._on_status)
        rospy.Subscriber("/cmd_vel", Twist, self._on_wheels)
        self._ask = {name: rospy.ServiceProxy(f"/explore/{name}", Trigger) for name in ("pause", "resume")}

    def _on_status(self, message: ExploreStatus) -> None:
        self.state = message.state

    def _on_wheels(self, message: Twist) -> None:
        self.drives |= message.linear.x != 0.0 or message.angular.z != 0.0

    def wait_for(self, state: str, seconds: float) -> bool:
        """Whether it came to that in time."""
        deadline = time.monotonic() + seconds
        while self.state != state and time.monotonic() < deadline and not rospy.is_shutdown():
            time.sleep(0.02)
        return self.state == state

    def pause(self, seconds: float, told: Told) -> None:
        """Once, for so long, if it explores at all."""
        if not self._ask["pause"]().success:
            return
        is_paused = self.wait_for("paused", ANSWER_S)
        time.sleep(STANDS_S)
        self.drives = False
        time.sleep(seconds)
        told.drove_while_paused += self.drives
        told.pauses += self._ask["resume"]().success and self.wait_for("exploring", ANSWER_S) and is_paused


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seed", type=int)
    parser.add_argument("pauses", type=int)
    options = parser.parse_args()
    rospy.init_node("pauser", disable_rostime=True)
    rng, pauser, told = np.random.default_rng(options.seed), Pauser(), Told()
    try:
        if pauser.wait_for("exploring", BEGIN_S):
            for _ in range(options.pauses):
                time.sleep(rng.uniform(*BETWEEN_S))
                pauser.pause(rng.uniform(*LONG_S), told)
    except (rospy.ServiceException, rospy.ROSException) as error:
        print(f"it ended before the last pause: {error}", file=sys.stderr)
    print(json.dumps(asdict(told)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
