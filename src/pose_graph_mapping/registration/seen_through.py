"""What has gone: points of older sweeps that a later one looks through.

Between the match that says where a sweep was made and the areas that later ones are matched to. A thin thing is seen through, too, but
seen as well: it has not gone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pose_graph_mapping.registration.cloud import Array, PointCloud, viewpoints
from pose_graph_mapping.registration.match_quality import lies_in_front, range_image

_GONE_MARGIN_M = 0.2  # a beam has to see so much farther than the point, and nothing this near to it
_GONE_STANDPOINT_M = 0.2  # beams that start so near to each other have one standpoint then
_GONE_LEAST_COS = 0.4  # points whose surface they would meet at a smaller cosine are not asked for


class View:
    """What one sweep tells of the points of others, in its own frame."""

    def __init__(self, sweep: PointCloud) -> None:
        """A sweep whose beams' origins are not known sees through nothing."""
        self._images = list[tuple[Array, Array]]()
        self._points = cKDTree(sweep.points)
        if sweep.origins is not None and len(sweep):
            eyes, index = viewpoints(sweep.origins, _GONE_STANDPOINT_M)
            self._images = [(eye, range_image(sweep.points[index == k], eye)) for k, eye in enumerate(eyes)]

    def through(self, others: PointCloud) -> NDArray[np.bool_]:
        """(N,) whether its beams pass a point, end well beyond it, and none of them beside it."""
        found = np.zeros(len(others), dtype=np.bool_)
        for eye, image in self._images:
            found |= lies_in_front(others, eye, image, _GONE_MARGIN_M, _GONE_LEAST_COS)
        at = np.flatnonzero(found)
        beside = np.isfinite(self._points.query(others.points[at], distance_upper_bound=_GONE_MARGIN_M)[0])
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
