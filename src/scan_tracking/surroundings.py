"""What bundles are matched to: the map around the robot, and the surfaces that the tracker put down where the map has none."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigid_geometry import inverse
from scan_tracking.alignment import MIN_POINTS, NORMAL_SIGMA_RAD, PATCH_M, Alignment, align
from scan_tracking.bundle import Bundle
from scan_tracking.config import ScanTrackingConfig
from scan_tracking.estimate import Estimate
from scan_tracking.local_map import LocalMap, supported
from scan_tracking.own_surfaces import surfaces_of
from scan_tracking.pose_error import moved_by, way_of

Array = NDArray[np.float64]
_NORMAL_SIGMAS = 3.0  # a normal farther from its patch's mean is left out of the map
_OWN_SIGMA_M = 0.003  # error in position of own surfaces, beside the pose's
_OWN_SIGMA_RAD = 0.001  # and in attitude


class Surroundings:
    """Surfaces in the tracked odometry frame, of the map and of the tracker's own."""

    def __init__(self, config: ScanTrackingConfig) -> None:
        self._config = config
        self._mapped = LocalMap.empty(config.cell_m)
        self._own = LocalMap.empty(config.cell_m)
        self._put_down_at: Array | None = None

    def __reduce__(self) -> tuple[type["Surroundings"], tuple[ScanTrackingConfig]]:
        """Without its surfaces, which are many and seldom change: who keeps a tracker keeps the map beside it."""
        return Surroundings, (self._config,)

    @property
    def known(self) -> bool:
        """Whether a map came that is not empty."""
        return len(self._mapped) > 0

    def set_map(self, points: ArrayLike, normals: ArrayLike, T_map_tracked: Array) -> None:
        """Takes (N, 3) points and normals in map. Own surfaces are forgotten: the map is newer. ValueError as `LocalMap` raises it."""
        config = self._config
        found = LocalMap(points, normals, config.cell_m)
        found = found.chosen(supported(found.points, found.normals, PATCH_M, _NORMAL_SIGMAS * NORMAL_SIGMA_RAD))
        found.move(inverse(T_map_tracked))
        self._mapped, self._own, self._put_down_at = found, LocalMap.empty(self._config.cell_m), None

    def match(self, bundle: Bundle, prior: Estimate) -> Alignment:
        """Where the bundle lies. Surfaces that it shows and nobody knew are put down for the next ones."""
        found = align(bundle, self._mapped, self._own, prior, self._config)
        if found.own_error.any():
            self._own.move(_about(prior.T, found.own_error))
        return self._extended(bundle, found)

    def _extended(self, bundle: Bundle, found: Alignment) -> Alignment:
        """With own surfaces of the points that had no partner, every so many metres."""
        T, every_m = found.estimate.T, self._config.own_every_m
        if not every_m or (self._put_down_at is not None and way_of(inverse(self._put_down_at) @ T) < every_m):
            return found
        self._put_down_at = T
        points, origins = (rows @ T[:3, :3].T + T[:3, 3] for rows in (bundle.points, bundle.origins))
        which, normals = surfaces_of(points, origins, self._config)
        new = np.isin(which, found.alone)
        if new.sum() < MIN_POINTS:
            return found
        self._own = self._own.joined(points[which[new]], normals[new])
        sigmas = np.repeat([_OWN_SIGMA_M, _OWN_SIGMA_RAD], 3)
        return found.with_estimate(found.estimate.anchored(sigmas))


def _about(T: Array, error: Array) -> Array:
    """(4, 4) motion of all that stands around T when a robot there is moved by an error."""
    return np.asarray(moved_by(T, error) @ inverse(T))
