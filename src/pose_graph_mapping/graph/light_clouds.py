"""What the mapper keeps of every sweep for later matches, and which of its points later sweeps have looked through.

Beside the graph in the mapper. Normals are estimated when a cloud is asked for: a session that is gone on with needs those near the robot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pose_graph_mapping.config import MappingConfig
from pose_graph_mapping.registration.cloud import NORMAL_NEIGHBOURS, Array, PointCloud, with_normals
from pose_graph_mapping.registration.seen_through import Gone, View

Counts = NDArray[np.uint8]


class LightClouds:
    """The light cloud of every vertex, in its body frame."""

    def __init__(self, config: MappingConfig, clouds: Sequence[PointCloud] = (), looked_through: Sequence[Counts] = ()) -> None:
        """`looked_through`: `counts()` of before; what does not fit its cloud begins at zero."""
        self._config, self._clouds = config, list(clouds)
        self._counts = [np.zeros(len(cloud), dtype=np.uint8) for cloud in clouds]
        for k, counts in enumerate(looked_through[: len(self._counts)]):
            if len(counts) == len(self._counts[k]):
                self._counts[k] = counts

    def __len__(self) -> int:
        return len(self._clouds)

    def copy(self) -> LightClouds:
        """The same clouds and counts, to go back to."""
        return LightClouds(self._config, self._clouds, self._counts)

    def add(self, cloud: PointCloud) -> None:
        """The cloud of the next vertex."""
        self._clouds.append(cloud)
        self._counts.append(np.zeros(len(cloud), dtype=np.uint8))

    def counts(self) -> tuple[Counts, ...]:
        """Of every point of every cloud, by how many later sweeps it was looked through."""
        return tuple(self._counts)

    def cloud(self, vertex_id: int) -> PointCloud:
        """A vertex's cloud with normals, without what has gone."""
        return self._whole(vertex_id).selected(self._stays(vertex_id))

    def finish_last(self) -> None:
        """Estimates the normals of the last cloud, for whoever has time before it is asked for."""
        if self._clouds:
            self._whole(len(self._clouds) - 1)

    def look_through(self, vertex_id: int, T_vertex_others: dict[int, Array]) -> None:
        """Counts what a sweep looks through of the clouds of others: T_vertex_others[k] (4, 4) takes cloud k to its frame."""
        view = View(self._clouds[vertex_id])
        for k, T_vertex_k in T_vertex_others.items():
            through = view.through(self._whole(k).transformed(T_vertex_k))
            self._counts[k] = self._counts[k] + (through & self._stays(k))

    def gone(self) -> Gone:
        """What later sweeps looked through."""
        points = tuple(cloud.points[~self._stays(k)] for k, cloud in enumerate(self._clouds))
        return Gone(points, self._config.vertex_voxel_m)

    def _whole(self, vertex_id: int) -> PointCloud:
        cloud = self._clouds[vertex_id]
        if cloud.normals is None:  # by one thread: others classify meanwhile
            cloud = self._clouds[vertex_id] = with_normals(cloud, NORMAL_NEIGHBOURS, threads=1)
        return cloud

    def _stays(self, vertex_id: int) -> NDArray[np.bool_]:
        return np.asarray(self._counts[vertex_id] < (self._config.gone_sweeps or math.inf))
