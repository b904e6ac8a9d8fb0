"""Where beams ended in columns, and how far what stands there extends around the mean place of its hits.

Used by `barriers` and `cliff_edges`. All places are in voxels: of the window, or from the middle of a column.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.lean_kernels import lean_njit
from octomap_server_3dnav.octree.surface_heights import SurfaceHeights
from octomap_server_3dnav.terrain.scene import Scene
from octomap_server_3dnav.terrain.surface_columns import DX, DY

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

RIM = 0.5  # voxels from the middle of a column to its rim
_AT_RIM = 0.4  # where the hits at the rim of a voxel begin
_FEW = 14.0  # voxels, divided by the hits in a column: how far beyond them a part of a thing may stand that none met
_UNMET = 0.6  # of them at most, and where none met anything: it may hang over beside its column
_NOISE_ALONE = 0.8  # of the variance of the noise: hits that are spread less lie on a flat side
_NO_NOISE = 1e-6  # voxels
_STRAY = 3.0  # times the noise of the beams: a hit that lies farther beyond the end of a thing is no stray


def middles(column: NDArray[np.integer], level: NDArray[np.integer], ny: int) -> Floats:
    """(M, 3) the middles of some columns, at their levels."""
    places = np.empty((len(column), 3))
    places[:, 0], places[:, 1] = np.divmod(column, ny)
    places[:, :2] += RIM
    places[:, 2] = level
    return places


def spread(heights: SurfaceHeights, scene: Scene, column: Ints, low: Ints, high: Ints) -> Floats:
    """(M, 6) of the hits of some columns from one voxel to another, as `SurfaceHeights.spread` gives them."""
    ny = scene.columns.ny
    return heights.spread(column // ny + scene.key[0], column % ny + scene.key[1], low, high)


@lean_njit
def _is_tip(own: Any, beyond: Any, k: Any, noise: Any) -> Any:
    """Whether the hits of a column lie farther before the end of those `beyond` its rim k than beams err; (6,) each."""
    axis, sign = k % 2, DX[k] + DY[k]
    apart = (beyond[1 + axis] + sign - own[1 + axis]) * sign
    return apart - np.sqrt(3.0 * max(beyond[3 + axis] - noise**2, 0.0)) >= _STRAY * noise


@lean_njit
def _join(own: Any, beyond: Any, k: Any, is_tip: Any, out: Any) -> None:
    """Writes into `out` (6,) the spread of the hits of a column and those `beyond` its rim k as of one group; of a tip only how many."""
    out[0] = own[0] + beyond[0]
    share = 0.0 if is_tip else beyond[0] / out[0]
    dx, dy = beyond[1] + DX[k] - own[1], beyond[2] + DY[k] - own[2]
    out[1], out[2] = own[1] + share * dx, own[2] + share * dy
    for i, between in ((3, dx * dx), (4, dy * dy), (5, dx * dy)):
        out[i] = (1.0 - share) * own[i] + share * beyond[i] + share * (1.0 - share) * between


@njit(cache=True)
def _at_rims(found: Any) -> Any:
    """(R,) which of the columns (M, 6) have their hits at a rim, and (R,) at which, by its direction."""
    which, direction, n = np.empty(4 * len(found), np.int64), np.empty(4 * len(found), np.int64), 0
    for i in range(len(found)):
        for k in range(4):
            if found[i, 1] * DX[k] + found[i, 2] * DY[k] > _AT_RIM:
                which[n], direction[n] = i, k
                n += 1
    return which[:n], direction[:n]


@njit(cache=True)
def _with_beyond(found: Any, which: Any, direction: Any, beyond: Any, noise: Any) -> Any:
    """(M, 6) the columns `found`, those `which` are at a rim with what lies `beyond` (R, 6), if more beams met that: the most of two."""
    out, most = found.copy(), np.zeros(len(found))
    for r in range(len(which)):
        i, k = which[r], direction[r]
        if beyond[r, 0] >= max(found[i, 0], most[i]):
            most[i] = beyond[r, 0]
            _join(found[i], beyond[r], k, _is_tip(found[i], beyond[r], k, noise), out[i])
    return out


def of_things(heights: SurfaceHeights, scene: Scene, column: Ints, low: Ints, high: Ints, noise: float) -> Floats:
    """(M, 6) the spread of what stands in these columns.

    What sticks a centimetre into a column, beside one that as many beams met, are the beams that ended too soon: the hits of both are of
    one thing. But the tip of a corner, which lies farther beyond the end of that than beams err, stays where it is.
    """
    found = spread(heights, scene, column, low, high)
    which, k = _at_rims(found)
    beyond = spread(heights, scene, column[which] + DX[k] * scene.columns.ny + DY[k], low[which], high[which])
    return np.asarray(_with_beyond(found, which, k, beyond, noise))


@lean_njit
def _extent(variance: Any, noise: Any) -> Any:
    """How far hits of this variance along a line reach from their mean if spread evenly, and how much of it is no noise."""
    share = min(1.0, max(0.0, (variance / max(noise, _NO_NOISE) ** 2 - _NOISE_ALONE) / (1.0 - _NOISE_ALONE)))
    return np.sqrt(3.0 * max(variance, 0.0)) * np.sqrt(share), share


@lean_njit
def unmet(hits: Any, few: Any) -> Any:
    """Voxels beyond its hits that a part of something may lie that none met: `few` divided by their number, with the square of that
    where it is less than half a voxel."""
    share = few / max(hits, 1.0)
    return min(_UNMET, share * min(1.0, share / RIM))


@njit(cache=True)
def reach_of(things: Any, noise: Any) -> Any:
    """(M, 3) how far things extend around the mean place of their hits, as `terrain_kernels.inflate` takes it: what is spread evenly ends
    at the root of three standard deviations. Across a flat side the hits are spread by the noise of the beams alone, in voxels, which is
    not part of the thing. What spreads more is a corner or a flank, of which little may lie in the column: so much farther as the noise.

    What few beams met may end where none did.
    """
    out = np.empty((len(things), 3))
    for i in range(len(things)):
        xx, yy, xy = things[i, 3], things[i, 4], things[i, 5]
        mean, off, angle = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy), 0.5 * np.arctan2(2.0 * xy, xx - yy)
        (length, _), (width, share) = _extent(mean + off, noise), _extent(mean - off, noise)
        out[i, 0], out[i, 1] = (length - width) * np.cos(angle), (length - width) * np.sin(angle)
        out[i, 2] = width + min(unmet(things[i, 0], _FEW) + share * noise, _UNMET)
    return out
