"""./replay --export: one file with the whole run, read back by the reader of the format's own library and by rosbags' types."""

import weakref
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from recorded_runs import FIRST_S, LAST_S, SWEEP_STAMPS_S, T_WORLD_MAP, wall_world, write_run
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from octomap_server_3dnav.navigation.class_colours import CLASS_RGB
from octomap_server_3dnav.terrain.classify import TerrainClass
from pose_graph_mapping.session.session_store import SessionStore, tum_text
from rigid_geometry import inverse, transform_points
from run_replay import mcap_messages
from run_replay.__main__ import main
from run_replay.export import export
from run_replay.recorded_run import read_run

TYPES = get_typestore(Stores.EMPTY)
Read = dict[str, list[tuple[float, Any]]]


def read_back(path: Path) -> Read:
    """(seconds, message) by topic, by nothing but the definitions that are in the file."""
    found: Read = defaultdict(list)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros1"
        for schema, channel, message in reader.iter_messages():
            assert schema is not None and schema.encoding == "ros1msg" and channel.message_encoding == "ros1"
            name = schema.name.replace("/", "/msg/")
            if name not in TYPES.types:
                TYPES.register(get_types_from_msg(schema.data.decode(), name))
            found[channel.topic].append((message.log_time / 1e9, TYPES.deserialize_ros1(message.data, name)))
    return found


def columns(cloud: Any) -> dict[str, np.ndarray]:
    table = np.frombuffer(cloud.data.tobytes(), np.float32).reshape(cloud.width, -1)
    assert cloud.point_step == 4 * table.shape[1] and cloud.row_step == cloud.data.size
    return {field.name: table[:, field.offset // 4] for field in cloud.fields}


def points(cloud: Any) -> np.ndarray:
    return np.column_stack([columns(cloud)[axis] for axis in "xyz"])


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Read:
    folder = write_run(tmp_path_factory.mktemp("run"))
    np.savez(folder / "path.npz", points=np.array([[0.0, 0.0, 0.0], [1.0, 0.5, 0.1]]))
    (folder / "events.csv").write_text("stamp_s,wall_s,state,reason,sweeps\n1.0,0.5,sweeping,first,0\n4.0,1.5,driving,goal,1\n")
    target = folder / "run.mcap"
    assert export(folder, target) > 100
    return read_back(target)


def test_every_sweep_is_there_at_its_time_and_place(exported: Read) -> None:
    assert [s for s, _ in exported["/sweep"]] == SWEEP_STAMPS_S.tolist()
    wall = transform_points(inverse(T_WORLD_MAP), wall_world())
    for _, cloud in exported["/sweep"]:
        assert cloud.header.frame_id == "map"
        gaps = np.linalg.norm(points(cloud)[:, None] - wall[None], axis=2)
        assert gaps.min(axis=1).max() < 0.05 and gaps.min(axis=0).max() < 0.1


def test_way_and_graph_grow_by_a_vertex_a_sweep(exported: Read) -> None:
    assert [len(path.poses) for _, path in exported["/trajectory"]] == [1, 2, 3, 4, 5]
    x = [pose.pose.position.x for pose in exported["/trajectory"][-1][1].poses]
    np.testing.assert_allclose(x, [0.0, 1.0, 2.0, 3.0, 4.0], atol=1e-3)
    last = {marker.ns: marker for marker in exported["/pose_graph"][-1][1].markers}
    assert (len(last["vertices"].points), len(last["match"].points), len(last["loop"].points)) == (5, 8, 0)


def test_robot_drives_in_tf_ten_times_a_second(exported: Read) -> None:
    stamps = [s for s, _ in exported["/tf"]]
    assert (stamps[0], stamps[-1], len(stamps)) == (FIRST_S, LAST_S, 81)
    moved = exported["/tf"][40][1].transforms[0]
    assert (moved.header.frame_id, moved.child_frame_id) == ("map", "base_link")
    assert moved.transform.translation.x == pytest.approx(2.0, abs=1e-2)


def test_map_plan_and_coloured_classes_are_there_at_the_end(exported: Read) -> None:
    for topic in ("/cloud_map", "/terrain", "/occupied", "/plan"):
        assert [s for s, _ in exported[topic]] == [LAST_S], topic
    terrain = columns(exported["/terrain"][0][1])
    rgb = terrain["rgb"].view(np.uint32)
    for value in np.unique(terrain["class"]).astype(int):
        red, green, blue = (round(255 * share) for share in CLASS_RGB.get(TerrainClass(value), (0.6, 0.6, 0.6)))
        assert set(rgb[terrain["class"] == value].tolist()) == {red << 16 | green << 8 | blue}
    assert [(p.pose.position.x, p.pose.position.y) for p in exported["/plan"][0][1].poses] == [(0.0, 0.0), (1.0, 0.5)]
    assert exported["/cloud_map"][0][1].width >= exported["/sweep"][0][1].width > 100


def test_what_the_robot_did_is_told_with_its_time(exported: Read) -> None:
    assert [(s, log.msg) for s, log in exported["/events"]] == [(1.0, "sweeping"), (4.0, "driving")]


def test_run_that_was_killed_is_exported_without_what_it_lacks(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    for name in ("terrain.npz", "occupied.npz", "graph.g2o", "trajectory_truth.txt"):
        (folder / name).unlink()
    export(folder, tmp_path / "run.mcap")
    found = read_back(tmp_path / "run.mcap")
    assert len(found["/sweep"]) == 5 and "/terrain" not in found and "/events" not in found


def paused_run(folder: Path, pause_s: float) -> Path:
    """A run without truth whose robot stood so long before its third sweep, as two bags that were joined leave it."""
    moving = read_run(write_run(folder.with_name("moving")))
    stamps = SWEEP_STAMPS_S + np.where(SWEEP_STAMPS_S > 4.0, pause_s, 0.0)
    store = SessionStore(folder)
    for k, stamp_s in enumerate(stamps.tolist()):
        cloud = moving.sweeps.load_sweep(k)
        store.add_sweep(k, stamp_s, cloud.points, cloud.origins)
    (folder / "trajectory.txt").write_text(tum_text(stamps, moving.vertex_poses))
    events = f"1.0,0.5,sweeping,first,0\n4.0,1.5,paused,a day,2\n{8.0 + pause_s},1.5,driving,goal,4\n{20.0 + pause_s},1.5,saving,,5\n"
    (folder / "events.csv").write_text("stamp_s,wall_s,state,reason,sweeps\n" + events)
    return folder


def test_day_s_pause_between_two_sweeps_lasts_a_second(tmp_path: Path) -> None:
    export(paused_run(tmp_path / "run", 86400.0), tmp_path / "run.mcap")
    found = read_back(tmp_path / "run.mcap")
    assert [s for s, _ in found["/sweep"]] == [1.0, 3.0, 4.0, 6.0, 8.0] and len(found["/tf"]) == 71
    assert [s for s, _ in found["/events"]] == pytest.approx([1.0, 3.0, 7.0, 19.0], abs=1e-4)


def test_pause_of_half_a_minute_is_kept(tmp_path: Path) -> None:
    export(paused_run(tmp_path / "run", 30.0), tmp_path / "run.mcap")
    assert [s for s, _ in read_back(tmp_path / "run.mcap")["/sweep"]] == [1.0, 3.0, 35.0, 37.0, 39.0]


def test_sweeps_that_a_later_bag_added_to_a_run_with_truth_follow_it_by_a_second(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    poses, stamps = read_run(folder).vertex_poses, [*SWEEP_STAMPS_S.tolist(), 1.7e9]
    store = SessionStore(folder)
    cloud = store.load_sweep(4)
    store.add_sweep(5, stamps[-1], cloud.points, cloud.origins)
    (folder / "trajectory.txt").write_text(tum_text(stamps, np.concatenate([poses, poses[-1:]])))
    run = read_run(folder)
    assert run.path.T_world_map is not None and run.sweep_stamps_s.tolist() == [*SWEEP_STAMPS_S.tolist(), LAST_S + 1.0]


def test_one_sweep_s_way_and_graph_are_held_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They grow with the sweeps: all of them would be their square."""
    made: list[weakref.ref[Any]] = []
    alive, path_of, serialized = [0], mcap_messages.path, mcap_messages.TYPES.serialize_ros1

    def path(*given: Any) -> object:
        message = path_of(*given)
        made.append(weakref.ref(message))
        return message

    def serialize(*given: Any) -> Any:
        alive.append(sum(message() is not None for message in made))
        return serialized(*given)

    monkeypatch.setattr(mcap_messages, "path", path)
    monkeypatch.setattr(mcap_messages.TYPES, "serialize_ros1", serialize)
    export(write_run(tmp_path / "run"), tmp_path / "run.mcap")
    assert len(made) == 5 and max(alive) <= 2


def test_command_writes_the_file_and_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    folder, target = write_run(tmp_path / "run"), tmp_path / "run.mcap"
    monkeypatch.setattr("sys.argv", ["./replay", str(folder), "--export", str(target)])
    assert main() == 0
    assert str(target) in capsys.readouterr().out and target.stat().st_size > 1000


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--export", "{}/run.mcap"], "folder of a run"),
        (["{}/run", "--export", "{}/run.bag"], "ends with .mcap"),
        (["{}/run", "--export", "{}/nowhere/run.mcap"], "no such folder"),
        (["{}/run", "--export", "{}/run/own.mcap"], "only read"),
        (["{}/run", "--export", "{}/run.mcap", "--speed", "3"], "--speed"),
        (["{}/empty", "--export", "{}/run.mcap"], "not the folder of a run"),
        (["{}/damaged", "--export", "{}/run.mcap"], "sweeps"),
    ],
)
def test_what_cannot_be_exported_is_told_in_a_line_and_leaves_nothing(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    write_run(tmp_path / "run")
    damaged = write_run(tmp_path / "damaged")
    (damaged / "sweeps" / "000002.npz").write_bytes(b"no sweep")
    (tmp_path / "run" / "own.mcap").write_text("of the run")
    (tmp_path / "empty").mkdir()
    monkeypatch.setattr("sys.argv", ["./replay", *(word.format(tmp_path) for word in words)])
    assert main() == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
    assert not [p for p in tmp_path.iterdir() if "mcap" in p.name]
