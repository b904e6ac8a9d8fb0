"""Two sessions of a place become one: what B saw lies where it truly is, seen from A; and what is not of that place is named."""

import json
from pathlib import Path

import numpy as np
import pytest
import recordings
from recordings import pose
from synthetic_sweeps import furnished_room, sweep, world_of

from mapping_tools import map_bag, merge_maps
from pose_graph_mapping.graph.pose_graph import PoseGraph
from pose_graph_mapping.session.session_store import SessionStore
from rigid_geometry import inverse, transform_from_rpy, translation_distance

FAST = ("--set", "num_icp_tries=1")
ELSEWHERE = transform_from_rpy((40.0, -7.0, 0.0), (0, 0, 2.0))  # the second robot's odometry begins anywhere
BEHIND_THE_DOOR = [
    ((9.0, 3.5, 1.25), (9.0, 0.1, 2.5)),
    ((9.0, -3.5, 1.25), (9.0, 0.1, 2.5)),
    ((13.5, 0.0, 1.25), (0.1, 7.0, 2.5)),
    ((9.0, 0.0, -0.05), (10.0, 8.0, 0.1)),
    ((10.0, 2.2, 0.5), (1.2, 0.5, 1.0)),
    ((12.0, -1.5, 0.7), (0.6, 0.8, 1.4)),
]


def two_rooms() -> list[tuple[tuple[float, float, float], tuple[float, float, float]]]:
    """The furnished room, a door of 2 m in its wall at x = 4.5 m, and another room behind it."""
    wall = [((4.5, y, 1.25), (0.1, 2.5, 2.5)) for y in (-2.25, 2.25)]
    return [item for item in furnished_room() if item[0] != (4.5, 0, 1.25)] + wall + BEHIND_THE_DOOR


A = [pose(-2.5, -1, 0.0), pose(-1.2, -1, 0.2), pose(0.5, -0.6, 0.3)]
B = [pose(10.5, -0.5, 3.0), pose(8.5, 0.0, 3.1), pose(6.5, 0.0, 3.1), pose(4.6, 0.0, 3.1), pose(2.5, 0.0, 3.1), pose(0.5, 0.3, 2.9)]


def recorded(path: Path, truth: list[np.ndarray], begin: np.ndarray, boxes: list) -> Path:
    """A session that ./map_bag makes of sweeps at true poses, whose odometry begins at `begin`."""
    rng, scene = np.random.default_rng(5), world_of(boxes)
    clouds = [tuple(a.astype(np.float32) for a in sweep(scene, T, rng)) for T in truth]
    odometry = [begin @ inverse(truth[0]) @ T for T in truth]
    for k in range(1, len(odometry)):
        odometry[k] = odometry[k - 1] @ inverse(truth[k - 1]) @ truth[k] @ transform_from_rpy((0.03, -0.02, 0.0), (0, 0, 0.02))
    bag = recordings.write_bag(path.parent / f"{path.name}.bag", recordings.drive(clouds, odometry))
    assert map_bag.main([str(bag), "--out", str(path), "--quiet", *FAST]) == 0
    return path


@pytest.fixture(scope="module")
def sessions(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("sessions")
    return recorded(folder / "a", A, A[0], two_rooms()), recorded(folder / "b", B, ELSEWHERE, two_rooms())


def merged(first: Path, second: Path, out: Path) -> int:
    return merge_maps.main([str(first), str(second), "--out", str(out), "--quiet", *FAST])


def test_what_b_saw_lies_where_it_is_seen_from_a_also_what_came_before_the_first_that_a_knows(
    sessions: tuple[Path, Path], tmp_path: Path
) -> None:
    first, second = sessions
    (first / "robot.yaml").write_text("# whose it is\n")
    before = {path: path.read_bytes() for folder in sessions for path in folder.rglob("*") if path.is_file()}
    assert merged(first, second, tmp_path / "both") == 0
    summary = json.loads((tmp_path / "both" / merge_maps.SUMMARY).read_text())
    assert (summary["sweeps_of_first"], summary["sweeps_of_second"], summary["not_placed"]) == (len(A), len(B), [])
    poses, store = PoseGraph.load_g2o(tmp_path / "both" / "graph.g2o").poses(), SessionStore(tmp_path / "both")
    assert (np.diff([s.stamp_s for s in store.sweeps]) > 0).all()
    sizes = [s.points for s in SessionStore(second).sweeps]
    order = [sizes.index(s.points) for s in store.sweeps[len(A) :]]
    assert sorted(order) == list(range(len(B))) and order[0] > 0 and order[-1] == 0, order  # from the first that A knows, then backwards
    for T, k in zip(poses[len(A) :], order, strict=True):
        assert translation_distance(inverse(poses[0]) @ T, inverse(A[0]) @ B[k]) < 0.08
    assert (tmp_path / "both" / "robot.yaml").is_file()
    assert {path: path.read_bytes() for path in before} == before


def test_sessions_of_different_places_are_not_merged_and_nothing_is_left(
    sessions: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    far = [((x, 0.3 * x, 0.6), (0.9 + 0.1 * x, 0.5, 1.2)) for x in range(-4, 5, 2)] + [((0, 0, -0.05), (20.0, 20.0, 0.1))]
    other = recorded(tmp_path / "other", [pose(0.0, 1.5)], pose(0.0, 1.5), far)
    assert merged(sessions[0], other, tmp_path / "both") == 1
    assert "no sweep of" in capsys.readouterr().err.splitlines()[-1]
    assert not (tmp_path / "both").exists()


def test_wrong_folders_are_named_in_one_line(sessions: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "a.txt").write_text("mine")
    (tmp_path / "link").symlink_to(sessions[0])
    for first, second, out, reason in (
        (sessions[0], tmp_path / "empty", tmp_path / "both", "empty: no session there"),
        (tmp_path / "absent", sessions[1], tmp_path / "both", "absent: no session there"),
        (*sessions, tmp_path / "full", "full: is not empty"),
        (sessions[0], tmp_path / "full" / ".." / "link", tmp_path / "both", "link: is the same session as"),
        (*sessions, tmp_path / "full" / "a.txt", "a.txt is a file, expected a folder"),
        (*sessions, sessions[1] / "both", "--out"),
    ):
        assert merged(first, second, out) == 2
        said = capsys.readouterr().err.splitlines()
        assert len(said) == 1 and reason in said[0]
    assert not (tmp_path / "both").exists() and not list((tmp_path / "empty").iterdir()) and not (sessions[1] / "both").exists()
    assert [path.name for path in (tmp_path / "full").iterdir()] == ["a.txt"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError("odd"), OSError("full")], ids=str)
@pytest.mark.parametrize("is_there", [False, True])
def test_merge_that_does_not_come_to_its_end_leaves_nothing(
    sessions: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException, is_there: bool
) -> None:
    def ended(*_: object, **__: object) -> None:
        assert (tmp_path / "both" / "sweeps").is_dir()
        raise error

    if is_there:
        (tmp_path / "both").mkdir()
    monkeypatch.setattr(merge_maps.MappingRun, "map", ended)
    if error is KeyboardInterrupt:
        with pytest.raises(KeyboardInterrupt):
            merged(*sessions, tmp_path / "both")
    else:
        assert merged(*sessions, tmp_path / "both") == 2
    assert [path.name for path in tmp_path.rglob("*")] == (["both"] if is_there else [])


def test_parameter_of_the_sensors_is_refused(sessions: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [*map(str, sessions), "--out", str(tmp_path / "both"), "--set", "windows=turning_points"]
    assert merge_maps.main(words) == 2
    assert "--set windows: has no effect" in capsys.readouterr().err and not (tmp_path / "both").exists()
