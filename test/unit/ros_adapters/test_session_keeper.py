"""What the mapping node does with its folder: a disk that is slow or full stops nobody, and the terminal says so."""

import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from sensor_msgs.msg import PointCloud2

from mapping_tools.cloud_files import read_cloud
from pose_graph_mapping.graph.pose_graph import EdgeKind, PoseGraph
from pose_graph_mapping.session import session_store
from pose_graph_mapping.session.session_record import Measured
from rigid_geometry import transform_from_rpy
from ros_adapters import session_keeper
from ros_adapters.asking import is_waiting
from ros_adapters.session_keeper import SessionKeeper


class Told:
    """In the place of a node's diagnostics."""

    def __init__(self) -> None:
        self.values: dict[str, object] = {}
        self.said: dict[str, str] = {}

    def on_terminal(self, what: str, text: str) -> None:
        self.said[what] = text


def keep_one(keeper: SessionKeeper, graph: PoseGraph) -> None:
    graph.add_vertex(np.eye(4))
    points = np.random.default_rng(len(graph)).normal(size=(50, 3)).astype(np.float32)
    keeper.keep(
        graph, float(len(graph)), (points, np.zeros_like(points)), PointCloud2(), Measured(np.eye(4), np.array([0.0, 0.0, 1.0]), 0.01)
    )


def test_node_that_waits_for_its_disk_is_not_hung(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    waited, write = [], session_store.write_whole
    monkeypatch.setattr(session_store, "write_whole", lambda path, data: (waited.append(is_waiting()), write(path, data)))
    keep_one(SessionKeeper(tmp_path, Told()), PoseGraph())  # type: ignore[arg-type]
    assert waited == [True] and not is_waiting()


def test_slow_disk_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told, clock_s = Told(), iter([0.0, 0.1, 10.0, 17.0])
    monkeypatch.setattr(session_keeper, "time", SimpleNamespace(monotonic=lambda: next(clock_s)))  # other threads have their own
    keeper, graph = SessionKeeper(tmp_path, told), PoseGraph()  # type: ignore[arg-type]
    keep_one(keeper, graph)
    assert "its disk is slow" not in told.said
    keep_one(keeper, graph)
    assert told.said["its disk is slow"] == f"{tmp_path}: a sweep took 7 s: name a folder elsewhere"


def test_full_disk_is_told_until_it_takes_the_sweeps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(28, os.strerror(28))

    told, graph = Told(), PoseGraph()
    keeper = SessionKeeper(tmp_path, told)  # type: ignore[arg-type]
    with monkeypatch.context() as patch:
        patch.setattr(session_store, "write_whole", refuse)
        keep_one(keeper, graph)
        keep_one(keeper, graph)
        assert "sweeps 0 to 1 are not on disk" in told.said["the session is not on disk"]
        assert "is full: make room there" in told.said["the session is not on disk"] and told.values["sweeps not on disk"] == 2
    keep_one(keeper, graph)
    assert told.said["the session is not on disk"] == "" and told.values["sweeps not on disk"] == 0


def test_run_begins_only_in_a_folder_without_a_session_and_goes_on_only_with_one(tmp_path: Path) -> None:
    keeper = SessionKeeper(tmp_path, Told())  # type: ignore[arg-type]
    assert keeper.why_not(resumes=False) == "" and "no session to go on with" in keeper.why_not(resumes=True)
    keep_one(keeper, PoseGraph())
    again = SessionKeeper(tmp_path, Told())  # type: ignore[arg-type]
    assert again.why_not(resumes=True) == ""
    assert f"{tmp_path} holds a session, sweeps 1: resume:=true goes on with it" in again.why_not(resumes=False)
    nowhere = SessionKeeper(None, Told())  # type: ignore[arg-type]
    assert nowhere.why_not(resumes=False) == nowhere.why_not(resumes=True) == ""


def test_cloud_has_the_voxels_that_are_asked_for(tmp_path: Path) -> None:
    saved = {}
    for voxel_m in (0.04, 1.0):
        graph, folder = PoseGraph(), tmp_path / str(voxel_m)
        keeper = SessionKeeper(folder, Told(), voxel_m)  # type: ignore[arg-type]
        keep_one(keeper, graph)
        mapper = SimpleNamespace(graph=graph, gone=lambda: None)
        assert keeper.save(mapper)[0]  # type: ignore[arg-type]
        saved[voxel_m] = len(read_cloud(folder / "cloud.ply").points)
    assert saved[1.0] < saved[0.04] == 50


def test_graph_that_was_solved_once_more_is_saved_once_more(tmp_path: Path) -> None:
    keeper, graph = SessionKeeper(tmp_path, Told()), PoseGraph()  # type: ignore[arg-type]
    keep_one(keeper, graph)
    keep_one(keeper, graph)
    mapper = SimpleNamespace(graph=graph, gone=lambda: None)
    assert keeper.save(mapper)[1] == "2 vertices saved" and keeper.save(mapper)[1] == "nothing new to save"  # type: ignore[arg-type]
    graph.add_edge(0, 1, transform_from_rpy((0.5, 0.0, 0.0)), np.eye(6), EdgeKind.MATCH)
    graph.solve()
    assert keeper.save(mapper)[1] == "2 vertices saved"  # type: ignore[arg-type]
    assert "0.5" in (tmp_path / "graph.g2o").read_text()
