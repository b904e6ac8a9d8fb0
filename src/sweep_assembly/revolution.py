"""One turn of a spinning lidar, and where its beams point: what a driver of such a lidar gives in place of a laser's scan."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from point_cloud2 import BeamCloud
from point_cloud2.driver_fields import Use, fields_for
from stage_config import check_below, check_ranges, parameter

FloatArray = NDArray[np.float64]

ENOUGH_TO_FIT = 500  # beams tell well enough how a revolution turned
LEAST_TO_TELL = 100  # pairs of beams tell how fast it turned
APART_TURNS = 0.03, 0.09  # of such a pair: rings of one instant look up to 0.02 turns aside, and a turn ten times as fast is told
FASTEST_TURNS = 1.1  # a motor's speed is not exact


@dataclass(frozen=True)
class LidarConfig:
    """What a spinning lidar is like, a Velodyne VLP-16 by default."""

    rings: int = parameter(16, "-", "beams that turn together", low=2, high=256)
    lowest_rad: float = parameter(math.radians(-15.0), "rad", "angle of ring 0 above the plane of rotation", low=-1.5, high=1.5)
    highest_rad: float = parameter(math.radians(15.0), "rad", "angle of the last ring; those between are evenly spaced", low=-1.5, high=1.5)
    rate_hz: float = parameter(10.0, "Hz", "revolutions a second", low=1.0, high=50.0)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self) + check_below(self, "lowest_rad", "highest_rad")

    @property
    def duration_s(self) -> float:
        """Seconds that a revolution takes."""
        return 1.0 / self.rate_hz

    @property
    def elevations(self) -> FloatArray:
        """(rings,) angles above the plane of rotation in rad."""
        return np.linspace(self.lowest_rad, self.highest_rad, self.rings)


@dataclass(frozen=True, eq=False)
class Revolution:
    """Beams of one turn in the order in which they were fired; ValueError for shapes that do not agree.

    `points` (N, 3) float32 metres in `laser`, a row of NaN where the beam met nothing in range; `rings` (N,), 0 looks down the most;
    `times_s` (N,) seconds after the revolution's stamp. Beams of which nothing is known have no row.
    """

    points: NDArray[np.float32]
    rings: NDArray[np.integer]
    times_s: FloatArray

    def __post_init__(self) -> None:
        count = len(self.points)
        if self.points.shape != (count, 3) or self.rings.shape != (count,) or self.times_s.shape != (count,):
            shapes = self.points.shape, self.rings.shape, self.times_s.shape
            raise ValueError(f"a revolution has (N, 3) points, (N,) rings and (N,) times, not {shapes}")
        object.__setattr__(self, "times_s", self.times_s.astype(np.float64))  # stamps are added to them

    @classmethod
    def of(cls, cloud: BeamCloud) -> "Revolution":
        """The beams of a driver's cloud in the order of their times; ValueError when it does not tell rings and times."""
        if cloud.rings is None or cloud.times_s is None:
            missing = [" or ".join(f.names[0] for f in fields_for(u)) for u in _untold(cloud)]
            raise ValueError(f"cloud without fields {', '.join(missing)}: a lidar that moves is mapped by the time of every beam")
        order = np.argsort(cloud.times_s, kind="stable")
        return cls(cloud.points[order].astype(np.float32), cloud.rings[order], cloud.times_s[order])

    @property
    def met_nothing(self) -> NDArray[np.bool_]:
        """(N,) whether nothing was in the beam's range."""
        return np.asarray(np.isnan(self.points[:, 0]))

    def kept(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> "Revolution":
        """The beams where `rows` (N,) is true, or whose numbers they are."""
        return Revolution(self.points[rows], self.rings[rows], self.times_s[rows])


def _untold(cloud: BeamCloud) -> list[Use]:
    return ([Use.RING] if cloud.rings is None else []) + ([Use.TIME, Use.TIME_OF_DAY] if cloud.times_s is None else [])


def counted_from_below(revolution: Revolution, config: LidarConfig) -> Revolution:
    """The same with rings that count upwards, as some drivers count downwards; ValueError for more rings than the lidar has."""
    if len(revolution.rings) and revolution.rings.max() >= config.rings:
        raise ValueError(f"cloud of ring {revolution.rings.max()}, of a lidar with {config.rings} rings: set lidar/rings and its angles")
    seen = np.flatnonzero(~revolution.met_nothing)[:: 1 + int((~revolution.met_nothing).sum()) // ENOUGH_TO_FIT]
    rings = revolution.rings[seen].astype(np.float64)
    heights = revolution.points[seen, 2] / np.linalg.norm(revolution.points[seen], axis=1)
    if not len(seen) or ((rings - rings.mean()) * heights).sum() >= 0.0:
        return revolution
    return Revolution(revolution.points, config.rings - 1 - revolution.rings, revolution.times_s)


def check_rate(revolution: Revolution, config: LidarConfig) -> None:
    """ValueError for beams that turn faster than the lidar: their times are no whole turn of it, and free beams would be placed wrong."""
    seen = np.flatnonzero(~revolution.met_nothing)
    seen = seen[:: 1 + seen.size // ENOUGH_TO_FIT]
    azimuths, times_s = np.arctan2(revolution.points[seen, 1], revolution.points[seen, 0]).astype(np.float64), revolution.times_s[seen]
    least_s, most_s = (turns * config.duration_s for turns in APART_TURNS)
    later = np.minimum(np.searchsorted(times_s, times_s + least_s), len(seen) - 1)
    apart_s = times_s[later] - times_s
    pairs = (apart_s >= least_s) & (apart_s <= most_s)
    if pairs.sum() < LEAST_TO_TELL:
        return
    turned = np.angle(np.exp(1j * (azimuths[later] - azimuths)))[pairs] / (2.0 * math.pi)
    rate_hz = abs(float(np.median(turned / apart_s[pairs])))
    if rate_hz > FASTEST_TURNS * config.rate_hz:
        raise ValueError(f"lidar that turns {rate_hz:.1f} times a second, and is told to turn {config.rate_hz:g}: set lidar/rate_hz")


def free_directions(revolution: Revolution, config: LidarConfig) -> FloatArray:
    """(M, 3) unit directions of the beams that met nothing, from their rings and from how the others turn.

    Where no beam met anything it is not known where the revolution began: x and y are NaN then.
    """
    nothing = revolution.met_nothing
    if not nothing.any():
        return np.zeros((0, 3))
    elevations = config.elevations[np.minimum(revolution.rings[nothing], config.rings - 1)]
    seen = np.flatnonzero(~nothing)
    azimuths = _azimuths(revolution.kept(seen[:: 1 + seen.size // ENOUGH_TO_FIT]), revolution.times_s[nothing], config.rate_hz)
    flat = np.cos(elevations)
    return np.stack([flat * np.cos(azimuths), flat * np.sin(azimuths), np.sin(elevations)], axis=1)


def _azimuths(seen: Revolution, times_s: FloatArray, rate_hz: float) -> FloatArray:
    """Azimuths at other times: the one that fits best to those seen, for a lidar that turns evenly to either side."""
    if not len(seen.points):
        return np.full(times_s.shape, np.nan)
    measured, turned = np.arctan2(seen.points[:, 1], seen.points[:, 0]), 2.0 * math.pi * rate_hz * seen.times_s
    sides = {sign: np.exp(1j * (measured - sign * turned)).mean() for sign in (1.0, -1.0)}
    sign = max(sides, key=lambda side: abs(sides[side]))
    return np.asarray(sign * 2.0 * math.pi * rate_hz * times_s + np.angle(sides[sign]))
