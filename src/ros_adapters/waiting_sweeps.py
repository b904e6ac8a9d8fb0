"""Sweeps that wait to be mapped, each with its other half: the beams that met nothing are a message of their own."""

from collections import deque
from collections.abc import Callable

from sensor_msgs.msg import PointCloud2

from ros_adapters.conversions import stamp_of

_MOST_WAITING = 5


class WaitingSweeps:
    """Clouds in the order in which they came, a few at most; the two halves of a sweep share their stamp."""

    def __init__(self, dropped: Callable[[str, str], None]) -> None:
        """`dropped` is told what was left out, and why, when sweeps come faster than they are mapped."""
        self._dropped = dropped
        self._clouds: deque[PointCloud2] = deque(maxlen=_MOST_WAITING)
        self._free: dict[int, PointCloud2] = {}

    def add_free(self, message: PointCloud2) -> None:
        """The beams of a sweep that met nothing."""
        self._free[message.header.stamp.to_nsec()] = message
        while len(self._free) > _MOST_WAITING:
            del self._free[min(self._free)]

    def add_cloud(self, message: PointCloud2) -> None:
        """A sweep's hits; of too many the oldest are dropped."""
        if len(self._clouds) == _MOST_WAITING:
            self._dropped("sweep that waited", "sweeps come faster than they are mapped, or without odometry; the oldest is dropped")
        self._clouds.append(message)

    def drop_later_than(self, stamp_s: float) -> list[float]:
        """Stamps of the sweeps from before the clock was set back to `stamp_s`: what they need of the odometry is forgotten."""
        late = [cloud for cloud in self._clouds if stamp_of(cloud) > stamp_s]
        for cloud in late:
            self._clouds.remove(cloud)
            self._free.pop(cloud.header.stamp.to_nsec(), None)
        return [stamp_of(cloud) for cloud in late]

    @property
    def first(self) -> PointCloud2 | None:
        """The hits of the sweep whose turn it is."""
        return self._clouds[0] if self._clouds else None

    def has_free(self, cloud: PointCloud2) -> bool:
        """Whether the other half of a sweep is here."""
        return cloud.header.stamp.to_nsec() in self._free

    def take_first(self) -> tuple[PointCloud2, PointCloud2]:
        """Both halves of the sweep whose turn it was, the second empty where it never came. IndexError when none waits."""
        cloud = self._clouds.popleft()
        return cloud, self._free.pop(cloud.header.stamp.to_nsec(), PointCloud2())
