"""What has gone: points of older sweeps that a later one looks through.

Between the match that says where a sweep was made and the areas that later ones are matched to. A thin thing is seen through, too, but
seen as well: it has not gone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pose_graph_mapping.config import MappingConfig
from pose_graph_mapping.registration.cloud import Array, PointCloud, viewpoints
from pose_graph_mapping.registration.match_quality import lies_in_front, range_image


class View:
    """What one sweep tells of the points of others, in its own frame."""

    def __init__(self, sweep: PointCloud, config: MappingConfig) -> None:
        """A sweep whose beams' origins are not known sees through nothing."""
        self._config, self._images = config, list[tuple[Array, Array]]()
        self._points = cKDTree(sweep.points)
        if sweep.origins is not None and len(sweep):
            eyes, index = viewpoints(sweep.origins, config.gone_standpoint_m)
            self._images = [(eye, range_image(sweep.points[index == k], eye)) for k, eye in enumerate(eyes)]

    def through(self, others: PointCloud) -> NDArray[np.bool_]:
        """(N,) whether its beams pass a point, end well beyond it, and none of them beside it."""
        found, config = np.zeros(len(others), dtype=np.bool_), self._config
        for eye, image in self._images:
            found |= lies_in_front(others, eye, image, config.gone_margin_m, config.gone_least_cos)
        at = np.flatnonzero(found)
        beside = np.isfinite(self._points.query(others.points[at], distance_upper_bound=config.gone_margin_m)[0])
        found[at[beside]] = False
        return found


@dataclass(frozen=True, eq=False)
class Gone:
    """Of every vertex's cloud, which is one of voxel means, the points (K, 3) that have gone, in its body frame."""

    points: tuple[Array, ...]
    voxel_m: float

    def left_of(self, vertex_id: int, points: Array) -> Array:
        """The points (N, 3) of a vertex's whole sweep but for those in voxels that have gone."""
        gone = self.points[vertex_id]
        if not len(gone) or not len(points):
            return points
        cells = np.floor(np.concatenate([gone, points]) / self.voxel_m).astype(np.int64)
        x, y, z = (cells - cells.min(axis=0)).T
        keys = (x << 42) + (y << 21) + z
        return points[~np.isin(keys[len(gone) :], keys[: len(gone)])]
