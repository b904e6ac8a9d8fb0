"""What sweeps need of the odometry, as long as they may still ask for it; the next process of a node knows what this one knew."""

from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from node_life import Journal, Life
from rigid_geometry import OdometryHistory
from rigid_geometry.transforms import Transform

_Gravity = tuple[NDArray[np.float64], float]
_Note = tuple[float, Transform | None, _Gravity | None]


class AtSweep(NamedTuple):
    """T_odom_base (4, 4) at the end of a sweep, and up in base_link (3,) with its sigma."""

    T_odom_base: Transform
    up: NDArray[np.float64]
    up_sigma_rad: float


class OdometryRecord:
    """An `OdometryHistory` that the next process takes up."""

    def __init__(self, life: Life) -> None:
        """As the process before this one knew it."""
        self._journal = Journal(life, "odometry")
        self._history, notes = self._journal.taken_up(OdometryHistory[_Gravity]())
        for stamp_s, T_odom_base, gravity in cast(list[_Note], notes):
            if T_odom_base is not None:
                self._history.add_pose(stamp_s, T_odom_base)
            if gravity is not None:
                self._history.add_up(stamp_s, gravity)

    def add_pose(self, stamp_s: float, T_odom_base: Transform) -> None:
        """The (4, 4) pose of base_link. ValueError when it is not rigid."""
        if self._history.add_pose(stamp_s, T_odom_base):
            self._note(stamp_s, T_odom_base, None)

    def add_up(self, stamp_s: float, up: NDArray[np.float64], sigma_rad: float) -> None:
        """(3,) in base_link, with its sigma; as `OdometryHistory.add_up`."""
        if self._history.add_up(stamp_s, (up, sigma_rad)):
            self._note(stamp_s, None, (up, sigma_rad))

    def reaches(self, stamp_s: float) -> bool:
        """Whether both are known up to `stamp_s`."""
        return self._history.reaches(stamp_s)

    def at(self, stamp_s: float) -> AtSweep:
        """The pose at `stamp_s`, and the first that was told of up since. ValueError where either was silent around it, or is forgotten."""
        T_odom_base, (up, sigma_rad) = self._history.at(stamp_s)
        return AtSweep(T_odom_base, up, sigma_rad)

    def newest(self) -> Transform:
        """T_odom_base (4, 4) as it was told last; ValueError before it was."""
        return self._history.newest()

    def _note(self, stamp_s: float, T_odom_base: Transform | None, gravity: _Gravity | None) -> None:
        if self._journal.note((stamp_s, T_odom_base, gravity)):
            self._journal.keep(self._history)
