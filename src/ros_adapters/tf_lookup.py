"""Transforms at a stamp: never the latest, never the identity."""

import time

import numpy as np
import rospy
import tf2_ros
from numpy.typing import NDArray

from ros_adapters.conversions import ros_time, transform_from_message
from ros_adapters.node import heard_publishers

_POLL_S = 0.0003


class TransformLookup:
    """tf2 asked for exact stamps. It polls in wall time: a tf2 timeout would wait for a clock that waits for this node."""

    def __init__(self, wall_timeout_s: float = 2.0) -> None:
        self._buffer = tf2_ros.Buffer(rospy.Duration(30), debug=False)
        self._listener = tf2_ros.TransformListener(self._buffer, queue_size=None, tcp_nodelay=True)
        self._wall_timeout_s = wall_timeout_s

    def hears(self, publisher: str) -> bool:
        """True when the node `publisher` is connected: a transform that it sends from now on will arrive."""
        return publisher in heard_publishers(self._listener.tf_sub)

    def at(self, target: str, source: str, stamp_s: float) -> NDArray[np.float64]:
        """T_target_source at `stamp_s`; ValueError when it has not come within the wall time limit."""
        stamp = ros_time(stamp_s)
        deadline = time.monotonic() + self._wall_timeout_s
        while True:
            try:
                return transform_from_message(self._buffer.lookup_transform_core(target, source, stamp).transform)
            except tf2_ros.TransformException as error:
                if time.monotonic() > deadline or rospy.is_shutdown():
                    raise ValueError(f"no transform {target} <- {source} at {stamp_s:.3f} s: {error}") from error
            time.sleep(_POLL_S)
