"""Where beams ended in columns, and how far what stands there extends around the mean place of its hits.

Used by `barriers` and `cliff_edges`. All places are in voxels: of the window, or from the middle of a column.
"""

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.surface_columns import DX, DY
from octomap_server_3dnav.surface_heights import SurfaceHeights
from octomap_server_3dnav.terrain_scene import Scene

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


def _together(hits: Floats, more: Floats) -> Floats:
    """(M, 6) the spread of two groups of hits as of one."""
    count, share = hits[:, :1] + more[:, :1], more[:, :1] / (hits[:, :1] + more[:, :1])
    off = more[:, 1:3] - hits[:, 1:3]
    between = share * (1 - share) * off[:, [0, 1, 0]] * off[:, [0, 1, 1]]
    return np.concatenate([count, hits[:, 1:3] + share * off, (1 - share) * hits[:, 3:] + share * more[:, 3:] + between], axis=1)


def of_things(heights: SurfaceHeights, scene: Scene, column: Ints, low: Ints, high: Ints, noise: float) -> Floats:
    """(M, 6) the spread of what stands in these columns.

    What sticks a centimetre into a column, beside one that as many beams met, are the beams that ended too soon: the hits of both are of
    one thing. But the tip of a corner, which lies farther beyond the end of that than beams err, stays where it is.
    """
    found, ahead = spread(heights, scene, column, low, high), np.stack([DX, DY], axis=1)
    at_rim, k = np.nonzero(found[:, 1:3] @ ahead.T > _AT_RIM)
    beyond = spread(heights, scene, column[at_rim] + DX[k] * scene.columns.ny + DY[k], low[at_rim], high[at_rim])
    beyond[:, 1:3] += ahead[k]
    many = np.flatnonzero(beyond[:, 0] >= found[at_rim, 0])
    many = many[np.argsort(beyond[many, 0], kind="stable")]  # of two the one with more hits is written last
    own, beyond, ahead = found[at_rim[many]], beyond[many], ahead[k[many]]
    one = _together(own, beyond)
    apart = ((beyond[:, 1:3] - own[:, 1:3]) * ahead).sum(axis=1)
    end = np.sqrt(3.0 * np.maximum((beyond[:, 3:5] * np.abs(ahead)).sum(axis=1) - noise**2, 0.0))
    is_tip = apart - end >= _STRAY * noise
    one[is_tip, 1:] = own[is_tip, 1:]
    found[at_rim[many]] = one
    return found


def _extent(variance: Floats, noise: float) -> tuple[Floats, Floats]:
    """(M,) how far hits of this variance along a line reach from their mean if spread evenly, and (M,) how much of it is no noise."""
    share = np.clip((variance / max(noise, _NO_NOISE) ** 2 - _NOISE_ALONE) / (1.0 - _NOISE_ALONE), 0.0, 1.0)
    return np.sqrt(3.0 * np.maximum(variance, 0.0)) * np.sqrt(share), share


def unmet(hits: Floats, few: float) -> Floats:
    """(M,) voxels beyond its hits that a part of something may lie that none met: `few` divided by their number, with the square of that
    where it is less than half a voxel."""
    share = few / np.maximum(hits, 1.0)
    return np.asarray(np.minimum(_UNMET, share * np.minimum(1.0, share / RIM)))


def reach_of(things: Floats, noise: float) -> Floats:
    """(M, 3) how far things extend around the mean place of their hits, as `terrain_kernels.inflate` takes it: what is spread evenly ends
    at the root of three standard deviations. Across a flat side the hits are spread by the noise of the beams alone, in voxels, which is
    not part of the thing. What spreads more is a corner or a flank, of which little may lie in the column: so much farther as the noise.

    What few beams met may end where none did.
    """
    xx, yy, xy = things[:, 3:].T
    mean, off, angle = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy), 0.5 * np.arctan2(2.0 * xy, xx - yy)
    (length, _), (width, share) = _extent(mean + off, noise), _extent(mean - off, noise)
    around = width + np.minimum(unmet(things[:, 0], _FEW) + share * noise, _UNMET)
    return np.column_stack([(length - width) * np.cos(angle), (length - width) * np.sin(angle), around])
