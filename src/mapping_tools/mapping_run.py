"""Maps a recording sweep by sweep into a session folder, and keeps account of what became of every one of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mapping_tools.map_origin import MapOrigin
from mapping_tools.sweep_sources import SourceSweep, StoppedError, SweepSource, Unreadable
from pose_graph_mapping.graph.localisation import localise
from pose_graph_mapping.graph.loop_closure import Match
from pose_graph_mapping.graph.mapper import MappingUpdate, PoseGraphMapper
from pose_graph_mapping.registration.cloud import PointCloud
from pose_graph_mapping.session.session_record import Measured
from pose_graph_mapping.session.session_store import NotOnDiskError, SessionStore
from rigid_geometry import JUMP_BACK_S, inverse, rotation_angle

Array = NDArray[np.float64]
Say = Callable[[str], None]

_TURNED_RAD = 0.5
_SAME_S = 1e-6


@dataclass(frozen=True)
class NotPlaced:
    """A sweep that is not in the map."""

    sweep: str
    stamp_s: float | None
    reason: str


@dataclass
class Account:
    """What became of the sweeps: read, known to the session already, passed by as too near to the last, not placed, on odometry alone.

    `known_until_s`: the stamp of the last that is known, `read_until_s`: of the last that was read.
    """

    read: int = 0
    known: int = 0
    known_until_s: float | None = None
    passed_by: int = 0
    loop_closures: int = 0
    read_until_s: float | None = None
    not_placed: list[NotPlaced] = field(default_factory=list)
    by_odometry_alone: list[dict[str, object]] = field(default_factory=list)


class _Known:
    """The sweeps of a recording that a session has: those in it, and those before the last of it, which was not placed or passed by."""

    def __init__(self, stamps_s: Sequence[float]) -> None:
        self._stamps_s, self._is_behind = np.array(stamps_s, dtype=np.float64), False

    def has(self, stamp_s: float, *, is_readable: bool) -> bool:
        """Of each sweep, in the order of the recording: its clock may have been set back. One that is unreadable may have a bad stamp."""
        if not len(self._stamps_s):
            return False
        is_in, last_s = bool(np.abs(self._stamps_s - stamp_s).min() <= _SAME_S), self._stamps_s[-1]
        is_known = is_in or (not self._is_behind and stamp_s <= last_s)
        if is_readable:
            self._is_behind = self._is_behind or not is_known or abs(stamp_s - last_s) <= _SAME_S
        return is_known


class MappingRun:
    """Owns the account of one recording; the mapper and its session belong to the caller.

    before_first: called before the first sweep is added to the session.
    """

    def __init__(
        self, mapper: PoseGraphMapper, match: Match, store: SessionStore, origin: MapOrigin, say: Say, *, min_travel_m: float = 0.0
    ) -> None:
        """origin: what odometry is relative to; say: one line of progress a sweep; min_travel_m: sweeps taken nearer to the last one, by
        odometry, are passed by."""
        self._mapper, self._match, self._store, self._origin, self._say = mapper, match, store, origin, say
        self._min_travel_m = min_travel_m
        self._last: SourceSweep | None = None
        self._stopping = False
        self.before_first: Callable[[], object] = lambda: None
        self.account = Account()

    def stop(self) -> None:
        """Ends `map` after the sweep or message that it is at, for a signal handler."""
        self._stopping = True

    @property
    def is_stopping(self) -> bool:
        """Whether it was told to."""
        return self._stopping

    def map(self, source: SweepSource, *, moved: bool = False) -> bool:
        """Map every sweep that the session does not have; False when it was stopped.

        moved: the first of them is looked for in the map, whatever odometry says. So is one before which the clock was set back, for
        odometry begins anew there, and one before which nobody knows the way.
        """
        try:
            self._map(source, moved)
        except StoppedError:
            return False
        return True

    def _map(self, source: SweepSource, moved: bool) -> None:
        known, goes_on = _Known(self._mapper.stamps_s), bool(self._mapper.stamps_s)
        lost = moved and goes_on
        for sweep in source.sweeps(lambda: self._stopping):
            if self._stopping:
                raise StoppedError
            self.account.read += 1
            if isinstance(sweep, SourceSweep):
                sweep, lost = self._near(sweep), self._goes_back(sweep.stamp_s) or lost or sweep.lost
            if sweep.stamp_s is not None and known.has(sweep.stamp_s, is_readable=isinstance(sweep, SourceSweep)):
                self.account.known, self.account.known_until_s = self.account.known + 1, sweep.stamp_s
                lost = moved and goes_on
            elif isinstance(sweep, Unreadable):
                self._not_placed(sweep.name, sweep.stamp_s, sweep.reason)
            elif not lost and self._is_near(sweep):
                self.account.passed_by += 1
            elif self._placed(sweep, source.progress, lost):
                self._last, lost = sweep, False

    def _goes_back(self, stamp_s: float) -> bool:
        """Whether the clock was set back before a sweep; one that is only late does not change how far was read."""
        before_s = self.account.read_until_s
        is_set_back = before_s is not None and stamp_s <= before_s - JUMP_BACK_S
        if before_s is None or stamp_s > before_s or is_set_back:
            self.account.read_until_s = stamp_s
        return is_set_back

    def _near(self, sweep: SourceSweep) -> SourceSweep:
        """The sweep with its odometry relative to the origin."""
        return sweep if sweep.T_odom_base is None else replace(sweep, T_odom_base=self._origin.relative(sweep.T_odom_base))

    def _is_near(self, sweep: SourceSweep) -> bool:
        if self._last is None or self._last.T_odom_base is None or sweep.T_odom_base is None:
            return False
        motion = inverse(self._last.T_odom_base) @ sweep.T_odom_base
        return float(np.linalg.norm(motion[:3, 3])) < self._min_travel_m and rotation_angle(motion) < _TURNED_RAD

    def _placed(self, sweep: SourceSweep, progress: float, lost: bool) -> bool:
        """Adds a sweep to map and session; False when it cannot be placed."""
        try:
            T_odom_base, update = self._add(sweep, lost)
        except ValueError as error:
            self._not_placed(sweep.name, sweep.stamp_s, str(error))
            return False
        self.account.loop_closures += update.loop_closures
        word = self._word(sweep, update)
        if self._last is None:
            self.before_first()
        try:
            self._store.add_sweep(
                update.vertex_id,
                sweep.stamp_s,
                sweep.points,
                sweep.origins,
                self._mapper.graph,
                Measured(T_odom_base, sweep.gravity_base, sweep.gravity_sigma_rad),
                None if sweep.free is None else PointCloud.of_finite(*sweep.free),
            )
        except NotOnDiskError as error:
            word = f"{word}; {error}"
        self._say(f"{100 * progress:3.0f} %  {sweep.name} at {sweep.stamp_s:.2f} s: vertex {update.vertex_id}, {word}")
        return True

    def _add(self, sweep: SourceSweep, lost: bool) -> tuple[Array, MappingUpdate]:
        """T_odom_base and what the sweep changed. Without odometry a match tells the place, the map's frame stands for odometry's."""
        placement = None
        if self._mapper.stamps_s and (lost or sweep.T_odom_base is None):
            cloud = PointCloud.of_finite(sweep.points, sweep.origins)
            placement = localise(self._mapper.graph, self._mapper.vertex_clouds(), cloud, self._match, gravity_base=sweep.gravity_base)
            if not placement.accepted:
                raise ValueError(placement.reason)
        T_odom_base = sweep.T_odom_base
        if T_odom_base is None:  # the first sweep makes the map's frame
            T_odom_base = placement.result.T_reference_reading if placement else np.eye(4)
        update = self._mapper.add_sweep(
            sweep.stamp_s,
            sweep.points,
            sweep.origins,
            T_odom_base,
            gravity_base=sweep.gravity_base,
            gravity_sigma_rad=sweep.gravity_sigma_rad,
            placement=placement,
        )
        return T_odom_base, update

    def _word(self, sweep: SourceSweep, update: MappingUpdate) -> str:
        if update.result is None:
            return "the first"
        closed = f", {update.loop_closures} loops closed" if update.loop_closures else ""
        if update.match_used:
            return f"{update.result.verdict.value}: {update.result.reason}{closed}"
        entry = {"vertex_id": update.vertex_id, "sweep": sweep.name, "stamp_s": sweep.stamp_s, "reason": update.result.reason}
        self.account.by_odometry_alone.append(entry)
        return f"by odometry alone: {update.result.reason}{closed}"

    def _not_placed(self, name: str, stamp_s: float | None, reason: str) -> None:
        self.account.not_placed.append(NotPlaced(name, stamp_s, reason))
        self._say(f"{name} could not be placed: {reason}")
