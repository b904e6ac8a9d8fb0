"""octomap_server's cloud_in: clouds of any sensor in any frame, which wait here until tf tells where they were made."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2

from point_cloud2 import read_points
from rigid_geometry import transform_points
from rigid_geometry.transforms import Transform
from ros_adapters.conversions import singles, stamp_of
from ros_adapters.frames import frames
from ros_adapters.node import Node
from ros_adapters.octomap_server_config import OctomapServerConfig
from ros_adapters.tf_lookup import NoTransformError, TransformsWhenAsked

PATIENCE_S = 0.5
_MOST_WAITING = 5  # as in octomap_server


@dataclass(frozen=True, eq=False)
class PlacedCloud:
    """A cloud in map: (N, 3) float32 hits and where their beams started; the robot's pose at its stamp, None where tf does not tell it."""

    stamp_s: float
    points: NDArray[np.float32]
    origins: NDArray[np.float32]
    T_map_base: Transform | None


class CloudInput:
    """Hands clouds on in the order they came, with what tf tells at their stamps; one that tf does not place in time is dropped."""

    def __init__(self, node: Node, transforms: TransformsWhenAsked, config: OctomapServerConfig, min_range_m: float) -> None:
        """`min_range_m`: nearer points are left out; 0 or less: none."""
        self._node, self._transforms, self._config, self._min_range_m = node, transforms, config, min_range_m
        self._waiting: deque[tuple[float, PointCloud2]] = deque()

    def configure(self, config: OctomapServerConfig, min_range_m: float) -> None:
        """From the next cloud on."""
        self._config, self._min_range_m = config, min_range_m

    def add(self, message: PointCloud2) -> None:
        """Takes a cloud. Of more than five that wait the oldest is dropped. ValueError for a stamp that would end tf's C++."""
        stamp_of(message)
        self._waiting.append((time.monotonic(), message))
        while len(self._waiting) > _MOST_WAITING:
            self._waiting.popleft()
            self._node.diagnostics.dropped(
                "cloud without tf", f"more than {_MOST_WAITING} clouds wait for the transform to {frames().map!r}"
            )

    def take(self, hand_on: Callable[[PlacedCloud], None]) -> None:
        """Hands on those whose place is known by now. What cannot be used is dropped and counted."""
        while self._waiting:
            arrived_s, message = self._waiting[0]
            frame, stamp = message.header.frame_id, message.header.stamp
            try:
                T_map_cloud, T_map_sensor = (self._transforms.at(of, stamp) for of in (frame, self._config.sensor_frame_id or frame))
            except NoTransformError as error:
                if time.monotonic() - arrived_s < PATIENCE_S:
                    return
                self._node.diagnostics.dropped("cloud without tf", str(error))
                self._waiting.popleft()
                continue
            self._waiting.popleft()
            self._node.dropping(partial(self._hand_on, hand_on, T_map_cloud, T_map_sensor[:3, 3]))(message)

    def _hand_on(
        self, hand_on: Callable[[PlacedCloud], None], T_map_cloud: Transform, sensor_map: NDArray[np.floating], message: PointCloud2
    ) -> None:
        hand_on(self._placed(message, T_map_cloud, sensor_map))

    def _placed(self, message: PointCloud2, T_map_cloud: Transform, sensor_map: NDArray[np.floating]) -> PlacedCloud:
        table = read_points(message)
        if table.origins is not None:
            origins = transform_points(T_map_cloud, table.origins)
        else:
            origins = np.broadcast_to(sensor_map, table.points.shape)
        points = transform_points(T_map_cloud, table.points)
        kept = self._counts(points, origins)
        return PlacedCloud(stamp_of(message), singles(points[kept]), singles(origins[kept]), self._robot(message))

    def _robot(self, message: PointCloud2) -> Transform | None:
        """At the cloud's stamp, else the newest, half a second older at most: a cloud in the map's own frame waits for nobody."""
        try:
            return self._transforms.at(frames().base, message.header.stamp)
        except NoTransformError:
            return self._transforms.newest(frames().base, stamp_of(message) - PATIENCE_S)

    def _counts(self, points: NDArray[np.floating], origins: NDArray[np.floating]) -> NDArray[np.bool_]:
        """(N,) whether a point lies where the parameters want it."""
        c = self._config
        low = (c.pointcloud_min_x, c.pointcloud_min_y, c.pointcloud_min_z)
        high = (c.pointcloud_max_x, c.pointcloud_max_y, c.pointcloud_max_z)
        inside = ((points >= low) & (points <= high)).all(axis=1)
        return np.asarray(inside & (np.linalg.norm(points - origins, axis=1) >= self._min_range_m))
