"""What the filter knows at an instant, of the robot, its wheels and its stops: the track of which estimates are made."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from odometry_fusion.error_state import State
from rigid_geometry import renormalised

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Wheels:
    """A wheel message, and since when the wheels have not turned (None while they turn)."""

    stamp_s: float
    forward_mps: float
    yaw_rate: float
    still_since_s: float | None


@dataclass(frozen=True, eq=False)
class Anchor:
    """The end of the latest stop: position, covariance (6, 6) of the pose in the filter, and that summed up from stop to stop."""

    position: FloatArray
    filter_covariance: FloatArray
    track_covariance: FloatArray


@dataclass(frozen=True, eq=False)
class Track:
    """All that is known at the latest processed instant.

    `rocked_s`: when the body last moved. `standing`: wheels and body are still, and the accelerometer told so. `anchor`: of the latest
    stop. `displaced`: why odometry knows nothing of the way, "" where it does.
    """

    state: State
    wheels: Wheels
    rate: FloatArray
    rocked_s: float
    standing: bool
    anchor: Anchor | None
    displaced: str = ""


def anchored(track: Track) -> Track:
    """The track as the robot leaves: a stop that ends becomes the anchor."""
    if not track.standing:
        return track
    state = track.state
    anchor = Anchor(state.position, state.covariance[:6, :6], track_covariance(track))
    return replace(track, state=replace(state, anchor_cross=state.covariance[:, :6]), standing=False, anchor=anchor)


def carried(lever: FloatArray) -> FloatArray:
    """(6, 6) matrix that takes the error of a pose to that of a pose (3,) `lever` metres away in odom: a turn moves it along."""
    carry = np.eye(6)
    carry[:3, 3:] = np.cross(np.eye(3), lever).T
    return carry


def track_covariance(track: Track) -> FloatArray:
    """(6, 6) the anchor's covariance carried on, and what was gained since.

    The difference of the filter's own covariances is not what was gained: an error that lasts, as slip does, grows on the way out and
    shrinks on the way back. Its covariance with the anchor's error gives the gain exactly (stochastic cloning, Roumeliotis 2002).
    """
    P = track.state.covariance[:6, :6]
    if track.anchor is None:
        return P.copy()
    carry = carried(track.state.position - track.anchor.position)
    cross = carry @ track.state.anchor_cross[:6].T
    gained = P + carry @ track.anchor.filter_covariance @ carry.T - cross - cross.T
    total = carry @ track.anchor.track_covariance @ carry.T + gained
    return np.asarray(0.5 * (total + total.T), dtype=np.float64)


def at_stamp(state: State, stamp_s: float) -> State:
    """The state with an exact stamp and rotation, after sums of many steps."""
    return replace(state, stamp_s=stamp_s, R_odom_base=renormalised(state.R_odom_base))
