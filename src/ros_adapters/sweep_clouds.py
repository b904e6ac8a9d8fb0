"""Whether sweeps become clouds: for who stands and waits for what is made of one."""

import math
import struct

import rospy

from sweep_assembly import SweepAssemblyConfig


class SweepClouds:
    """Hears the stamps of sweep_cloud, of which nothing else is read. In lock-step nobody listens: the clock waits for the cloud."""

    def __init__(self, *, listens: bool, is_first: bool) -> None:
        """`is_first`: no cloud can have come to a process before this one."""
        self.newest_s: float | None = -math.inf if listens and is_first else None
        if listens:
            self._subscriber = rospy.Subscriber("sweep_cloud", rospy.AnyMsg, self._on_cloud, queue_size=1, buff_size=2**25)

    @property
    def whole_sweep_rad(self) -> float | None:
        """The tilt that a whole sweep has to go beyond; None where the assembler takes any."""
        if rospy.get_param("sweep_assembler_node/windows", SweepAssemblyConfig.windows) != "turning_points":
            return None
        return float(rospy.get_param("sweep_assembler_node/whole_sweep_rad", SweepAssemblyConfig.whole_sweep_rad))

    def _on_cloud(self, message: rospy.AnyMsg) -> None:
        _, seconds, nanoseconds = struct.unpack_from("<3I", message._buff)  # every message with a header begins so
        self.newest_s = seconds + 1e-9 * nanoseconds
