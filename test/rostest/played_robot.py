"""A robot that only talks: each sensor in a thread of its own, on its own phase and with jitter, as drivers send; one may be wrong."""

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from node_testing import imu, joints, scan, wheels
from sensor_msgs.msg import Imu, JointState, LaserScan
from std_srvs.srv import Trigger, TriggerResponse

LATE_S = 0.05  # what a busy machine has not sent by then is left out: a driver stamps what it sends now
Change = Callable[[Any], Any]
SENSORS: dict[str, tuple[str, type, float, float]] = {  # topic, type, rate in Hz, latency in seconds
    "scan": ("/scan", LaserScan, 40.0, 0.025),
    "joints": ("/joint_states", JointState, 50.0, 0.012),
    "imu": ("/imu/data", Imu, 100.0, 0.003),
    "wheels": ("/wheel_odom", Odometry, 20.0, 0.012),
}


class PlayedRobot:
    """Publishes for good; `change[sensor]` makes of a message another one, a list, or None, and `rates` slows a sensor down."""

    def __init__(self) -> None:
        self.change: dict[str, Change] = {}
        self.rates: dict[str, float] = {}
        self._rng = np.random.default_rng(0)
        self._lock = threading.Lock()
        self._publishers = {name: rospy.Publisher(topic, kind, queue_size=100) for name, (topic, kind, _, _) in SENSORS.items()}
        self._listener = rospy.Subscriber("/cmd_vel", Twist, lambda _: None)
        self._service = rospy.Service("start_sweep", Trigger, lambda _: TriggerResponse(True, ""))
        for name in SENSORS:
            threading.Thread(target=self._play, args=(name,), daemon=True).start()

    def _noise(self, sigma: float, count: int) -> np.ndarray:
        with self._lock:
            return self._rng.normal(0.0, sigma, count)

    def _message(self, name: str, stamp_s: float) -> Any:
        if name == "scan":
            return scan(stamp_s, 2.0 + self._noise(0.01, 1081))
        if name == "joints":
            return joints(stamp_s, 0.002)
        if name == "imu":
            gyro, accel = self._noise(0.005, 3), self._noise(0.05, 3) + [0.0, 0.0, 9.81]
            return imu(stamp_s, tuple(gyro), tuple(accel))
        return wheels(stamp_s)

    def _play(self, name: str) -> None:
        _, _, rate_hz, latency_s = SENSORS[name]
        due = time.time() + float(self._noise(0.1, 1)[0] % 0.1)
        while not rospy.is_shutdown():
            time.sleep(max(due - time.time(), 0.0))
            message = self._message(name, due - latency_s)
            for one in _as_list(self.change.get(name, lambda m: m)(message)):
                self._publishers[name].publish(one)
            due += (1.0 + 0.015 * float(self._noise(1.0, 1)[0])) / self.rates.get(name, rate_hz)
            if due < time.time() - LATE_S:
                due = time.time()


def _as_list(message: Any) -> list[Any]:
    if message is None:
        return []
    return message if isinstance(message, list) else [message]
