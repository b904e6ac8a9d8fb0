"""Sweeps of a finished session, to be mapped again: onto another map, whose clock is another."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from mapping_tools.sweep_sources import SourceSweep, StoppedError, Unreadable, never
from pose_graph_mapping.graph.pose_graph import EdgeKind
from pose_graph_mapping.session.session_store import DamagedSweepError, SessionStore


class SessionSweeps:
    """See `SweepSource`. Sweeps of a session in the order that is asked for, which may be backwards; each is called by its file's name."""

    problem: str | None = None
    notes: tuple[str, ...] = ()

    def __init__(self, store: SessionStore, order: Sequence[int], begin_s: float) -> None:
        """`order`: vertices, at least one; `begin_s`: the first gets this stamp, and the others lie as far apart as they were."""
        self._store, self._order, self._begin_s = store, list(order), begin_s
        self._read = 0

    @property
    def progress(self) -> float:
        return self._read / len(self._order)

    def sweeps(self, is_stopping: Callable[[], bool] = never) -> Iterator[SourceSweep | Unreadable]:
        """In that order."""
        stored = self._store.sweeps
        first_s = stored[self._order[0]].stamp_s
        for before, vertex_id in zip([None, *self._order], self._order, strict=False):
            if is_stopping():
                raise StoppedError
            self._read += 1
            stamp_s = self._begin_s + abs(stored[vertex_id].stamp_s - first_s)
            try:
                yield self._sweep(before, vertex_id, stamp_s)
            except DamagedSweepError as error:
                yield Unreadable(stored[vertex_id].file, stamp_s, str(error))

    def _sweep(self, before: int | None, vertex_id: int, stamp_s: float) -> SourceSweep:
        stored, cloud, free = self._store.sweeps[vertex_id], self._store.load_sweep(vertex_id), self._store.load_free(vertex_id)
        m = stored.measured
        return SourceSweep(
            stored.file,
            stamp_s,
            *cloud.singles(),
            T_odom_base=None if m is None else m.T_odom_base,
            gravity_base=None if m is None else m.gravity_base,
            gravity_sigma_rad=None if m is None else m.gravity_sigma_rad,
            free=None if free is None or not len(free) else free.singles(),
            lost=before is not None and not self._knows_way(before, vertex_id),
        )

    def _knows_way(self, before: int, vertex_id: int) -> bool:
        """Whether odometry led all the way from one sweep to the other; a session that was stored without its graph does not tell."""
        first, last = sorted((before, vertex_id))
        changes = [self._store.sweeps[k].change for k in range(first + 1, last + 1)]
        return all(change is None or any(edge.kind is EdgeKind.ODOMETRY for edge in change.added) for change in changes)
