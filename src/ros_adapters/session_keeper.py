"""The session folder of the mapping node: sweeps go to disk as they come, and a session that ended, however it ended, goes on."""

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rospy
from explore_3dnav.msg import MappedSweep
from explore_3dnav.srv import RestoreSweep
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2

from pose_graph_mapping.config import MappingConfig
from pose_graph_mapping.graph.finished_map import FinishedMap, Mapper
from pose_graph_mapping.graph.light_clouds import Counts
from pose_graph_mapping.graph.localisation import Placement, localise
from pose_graph_mapping.graph.loop_closure import Match
from pose_graph_mapping.graph.mapper import PoseGraphMapper
from pose_graph_mapping.graph.pose_graph import PoseGraph
from pose_graph_mapping.registration.cloud import PointCloud
from pose_graph_mapping.session.session_record import Measured
from pose_graph_mapping.session.session_resume import resume
from pose_graph_mapping.session.session_store import DamagedSweepError, NotOnDiskError, SessionStore
from ros_adapters.asking import AskedService, waiting_for
from ros_adapters.conversions import Singles, cloud_message, free_arrays, header, pose_message
from ros_adapters.diagnostics import Diagnostics
from ros_adapters.frames import frames
from whole_files import refusal

_NOT_ON_DISK = "the session is not on disk"
_SLOW_S = 2.0  # the robot's next sweep comes after as long
_SERVICE, _WAIT_S = "octomap_server_3dnav_node/restore_sweep", 30.0
_MOVED_M = 0.001


class SessionKeeper:
    """What the node does with its run's folder; without a folder nothing is kept."""

    def __init__(
        self, folder: Path | None, diagnostics: Diagnostics, map_voxel_m: float = MappingConfig.map_voxel_m, *, is_finished: bool = False
    ) -> None:
        """`map_voxel_m`: voxels of the saved cloud. `is_finished`: what is there is read, and nothing is written."""
        self._is_finished, self._map_voxel_m = is_finished, map_voxel_m
        self._store = SessionStore(folder) if folder else None
        self._diagnostics = diagnostics
        self._saved: NDArray[np.float64] | None = None  # (V, 4, 4) poses that the files have

    def why_not(self, *, resumes: bool) -> str:
        """Why a run may not begin in its folder: a session is there that it is not to go on with, or none; empty when it may."""
        count = len(self._store.sweeps) if self._store else 0
        if self._store is None or resumes == bool(count):
            return ""
        if count:
            return f"out {self._store.folder} holds a session, sweeps {count}: resume:=true goes on with it, out:=FOLDER names another"
        return f"out {self._store.folder} holds no session to go on with: out:=FOLDER names one"

    def resumed(
        self, config: MappingConfig, match: Match, looked_through: Sequence[Counts] = (), *, terrain_has_it: bool = False
    ) -> PoseGraphMapper | None:
        """The mapper of the session on disk, whose map the terrain node then has too; None where there are no sweeps."""
        if not self._store or not self._store.sweeps:
            return None
        found = resume(self._store, config, match, looked_through)
        for note in (*found.notes, *([] if terrain_has_it else self.hand_over(found.mapper.graph))):
            rospy.logwarn("session: %s", note)
            self._diagnostics.dropped("session", note)
        rospy.loginfo("session of %d sweeps goes on", len(self._store.sweeps))
        return found.mapper

    def hand_over(self, graph: PoseGraph) -> list[str]:
        """Gives all sweeps to the terrain node; what could not be given, a sentence each."""
        return _hand_over_map(self._store, graph) if self._store else ["there is no folder with sweeps: set ~out"]

    def last_sweep(self, mapper: Mapper) -> MappedSweep | None:
        """The newest sweep, as it is published; None where there is none. One that was placed in a finished map has no cloud any more."""
        if isinstance(mapper, FinishedMap):
            return _visit_message(mapper)
        if not self._store or not self._store.sweeps:
            return None
        last = self._store.sweeps[-1]
        return _message(self._store, mapper.graph, last.vertex_id, last.stamp_s)

    def last_odometry(self, mapper: Mapper) -> NDArray[np.float64] | None:
        """(4, 4) T_odom_base of the newest sweep."""
        if isinstance(mapper, FinishedMap):
            return None if mapper.visits.last is None else mapper.visits.last.T_odom_base
        measured = self._store.sweeps[-1].measured if self._store and self._store.sweeps else None
        return None if measured is None else measured.T_odom_base

    def keep(
        self,
        graph: PoseGraph,
        stamp_s: float,
        cloud: tuple[Singles, Singles],
        free: PointCloud2,
        measured: Measured,
    ) -> None:
        """Puts the newest vertex's sweep on disk; a disk that takes nothing stops nobody, and is named."""
        if not self._store or self._is_finished:
            return
        beams, problem, begun_s = PointCloud.of_finite(*free_arrays(free)), "", time.monotonic()
        with waiting_for("disk"):
            try:
                self._store.add_sweep(len(graph) - 1, stamp_s, *cloud, graph, measured, free=beams)
            except NotOnDiskError as error:
                problem = str(error)
        self._diagnostics.on_terminal(_NOT_ON_DISK, problem)
        if (took_s := time.monotonic() - begun_s) > _SLOW_S:
            self._diagnostics.on_terminal("its disk is slow", f"{self._store.folder}: a sweep took {took_s:.0f} s: name a folder elsewhere")
        self._diagnostics.values["sweeps not on disk"] = self._store.not_on_disk

    def save(self, mapper: Mapper) -> tuple[bool, str]:
        """Writes graph, trajectory and cloud when the last save did not have all vertices, or had them more than a millimetre elsewhere."""
        if self._is_finished:
            return True, "the map is finished: nothing is saved"
        poses = mapper.graph.poses()
        is_saved = self._saved is not None and self._saved.shape == poses.shape and np.allclose(poses, self._saved, rtol=0.0, atol=_MOVED_M)
        if not self._store or is_saved or not len(poses):
            return True, "nothing new to save"
        try:
            with waiting_for("disk"):
                left_out = self._store.save(mapper.graph, self._map_voxel_m, mapper.gone())
        except OSError as error:
            problem = str(error) if isinstance(error, NotOnDiskError) else refusal(error, self._store.folder)
            self._diagnostics.on_terminal(_NOT_ON_DISK, problem)
            return False, problem
        self._diagnostics.on_terminal(_NOT_ON_DISK, "")
        self._saved = poses
        return True, "; ".join((f"{len(poses)} vertices saved", *left_out))


def found_in_map(mapper: Mapper, cloud: tuple[Singles, Singles], up: NDArray[np.float64], match: Match) -> Placement:
    """Where in the map a sweep was made of which odometry knows nothing; ValueError when it does not tell."""
    placement = localise(mapper.graph, mapper.vertex_clouds(), PointCloud.of_finite(*cloud), match, up)
    if not placement.accepted:
        raise ValueError(f"the robot was not found in the map: {placement.reason}")
    rospy.loginfo("localised: %s", placement.reason)
    return placement


def _hand_over_map(store: SessionStore, graph: PoseGraph) -> list[str]:
    """Gives all sweeps of a session to the terrain node; what could not be given, a sentence each.

    By a service, so that none is lost however many there are. Damaged sweeps are left out. A node that dies meanwhile gets all once more.
    """
    try:
        rospy.wait_for_service(_SERVICE, _WAIT_S)
        restore = AskedService(_SERVICE, RestoreSweep, _WAIT_S)
        while True:
            broken, problems = restore.broken, _hand_over_sweeps(restore, store, graph)
            if restore.broken == broken:
                return problems
    except (rospy.ROSException, rospy.ServiceException) as error:
        return [f"the octomap lacks the session's sweeps: {error}"]


def _hand_over_sweeps(restore: AskedService, store: SessionStore, graph: PoseGraph) -> list[str]:
    problems: list[str] = []
    for stored in store.sweeps:
        if rospy.is_shutdown():
            return [*problems, f"the node ends before sweep {stored.vertex_id} was handed over"]
        try:
            answer = restore(_message(store, graph, stored.vertex_id, stored.stamp_s))
        except DamagedSweepError as error:
            problems.append(str(error))
            continue
        if not answer.accepted:
            problems.append(f"sweep {stored.vertex_id} is not in the octomap: {answer.message}")
    return problems


def _visit_message(finished: FinishedMap) -> MappedSweep | None:
    last, poses = finished.visits.last, finished.vertex_poses
    if last is None:
        return None
    message = MappedSweep(header=header(last.stamp_s, frames().map), vertex_id=len(poses) - 1, match_refused=not last.matched)
    message.vertex_poses = [pose_message(T) for T in poses]
    return message


def _message(store: SessionStore, graph: PoseGraph, vertex_id: int, stamp_s: float) -> MappedSweep:
    message = MappedSweep(header=header(stamp_s, frames().map), vertex_id=vertex_id)
    message.cloud = _cloud(stamp_s, store.load_sweep(vertex_id))
    free = store.load_free(vertex_id)
    if free is not None and len(free):
        message.free = _cloud(stamp_s, free)
    message.vertex_poses = [pose_message(T) for T in graph.poses()[: vertex_id + 1]]
    return message


def _cloud(stamp_s: float, cloud: PointCloud) -> PointCloud2:
    assert cloud.origins is not None
    return cloud_message(stamp_s, frames().base, cloud.points.astype(np.float32), cloud.origins.astype(np.float32))
