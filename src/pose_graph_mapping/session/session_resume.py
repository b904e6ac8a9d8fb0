"""Goes on with a session where it ended, however it ended: the mapper that its folder tells of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pose_graph_mapping.config import MappingConfig
from pose_graph_mapping.graph.dead_reckoning import gravity_sigma
from pose_graph_mapping.graph.light_clouds import Counts
from pose_graph_mapping.graph.loop_closure import Match
from pose_graph_mapping.graph.mapper import PoseGraphMapper, empty_graph
from pose_graph_mapping.registration.cloud import PointCloud, voxel_downsample
from pose_graph_mapping.registration.matching import RegistrationResult, refused
from pose_graph_mapping.session.session_record import Measured
from pose_graph_mapping.session.session_store import DamagedSweepError, SessionStore

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Resumed:
    """A mapper with the graph and the clouds of a session, and what of the session is damaged, a sentence each."""

    mapper: PoseGraphMapper
    notes: tuple[str, ...]


def resume(store: SessionStore, config: MappingConfig, match: Match, looked_through: Sequence[Counts] = ()) -> Resumed:
    """The mapper that a session's sweeps were placed by, as it was after the last of them.

    A sweep that is damaged keeps its vertex and edges, has no points, and is named in the notes. Its next sweep goes to `add_sweep` with a
    placement found by `localise`; without one where odometry has gone on all the while. looked_through: what the mapper before knew of
    it, which need not be found out again. ValueError for a session without sweeps, or one that was stored without its graph.
    """
    if not store.sweeps:
        raise ValueError("the session holds no sweeps that could be gone on with")
    measured = [_measured(store, k) for k in range(len(store.sweeps))]
    notes = list(store.notes)
    clouds = [_light_cloud(store, k, config, notes) for k in range(len(store.sweeps))]
    graph = store.graph_on_disk(empty_graph(config))
    stamps_s = [s.stamp_s for s in store.sweeps]
    for vertex_id, m in enumerate(measured):
        if config.use_gravity and m.gravity_base is not None:
            graph.add_gravity(vertex_id, m.gravity_base, gravity_sigma(m.gravity_sigma_rad, stamps_s, vertex_id, config))
    graph.optimise()
    mapper = PoseGraphMapper(config, _without_empty_clouds(match))
    mapper.restore(graph, clouds, stamps_s, measured[-1].T_odom_base, looked_through)
    return Resumed(mapper, tuple(dict.fromkeys(notes)))


def _measured(store: SessionStore, vertex_id: int) -> Measured:
    measured = store.sweeps[vertex_id].measured
    if measured is None:
        raise ValueError(f"sweep {vertex_id} was stored without its odometry and edges; such a session can be looked at only")
    return measured


def _light_cloud(store: SessionStore, vertex_id: int, config: MappingConfig, notes: list[str]) -> PointCloud:
    """What the mapper keeps of a sweep; no points where the file is damaged."""
    try:
        return voxel_downsample(store.load_sweep(vertex_id), config.vertex_voxel_m)
    except DamagedSweepError as error:
        notes[:] = [note for note in notes if not note.startswith(store.sweeps[vertex_id].file)]
        notes.append(f"{error}; vertex {vertex_id} stays without its points")
        none = np.zeros((0, 3))
        return PointCloud(none, none, none)


def _without_empty_clouds(match: Match) -> Match:
    """Refuses what a vertex without points would be asked for."""

    def refusing(reference: PointCloud, reading: PointCloud, T_guess: Array, covariance: Array | None) -> RegistrationResult:
        if len(reference) and len(reading):
            return match(reference, reading, T_guess, covariance)
        return refused(T_guess, "the sweep that it would be matched with is damaged on disk")

    return refusing
