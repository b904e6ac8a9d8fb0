"""Which files of a folder are read as one recording, which are named as left out, and in which order bags of ROS 1 are read."""

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import raw_recordings as raw
from recordings import odometry_message, write_bag
from rosbags import rosbag1
from rosbags.rosbag2 import StoragePlugin

from mapping_tools.bag_records import deserialize_ros1
from mapping_tools.indexed_records import IndexedRecords
from mapping_tools.recorded_sources import recording_in
from mapping_tools.recording import Recording, bags_of

T = np.eye(4)


def poses(*stamps_s: float, topic: str = "/odom") -> list[tuple[str, object]]:
    return [(topic, odometry_message(stamp_s, T)) for stamp_s in stamps_s]


def read(path: Path) -> list[tuple[str, float]]:
    recording = Recording(bags_of(path))
    return [(message.topic, 1e-9 * message.time_ns) for message in recording.messages(recording.topics)]


def test_last_part_that_was_never_closed_is_read_with_the_others(tmp_path: Path) -> None:
    write_bag(tmp_path / "run_0.bag", poses(1.0))
    write_bag(tmp_path / "run_1.bag", poses(2.0)).rename(tmp_path / "run_1.bag.active")
    assert read(tmp_path) == [("/odom", 1.0), ("/odom", 2.0)]


def test_parts_that_are_not_read_are_named_as_a_problem(tmp_path: Path) -> None:
    write_bag(tmp_path / "run_0.bag", poses(1.0))
    for name in ("a.mcap.zstd", "b.db3.zstd", "c.bag.gz", "d.db3-shm", "robot.yaml"):
        (tmp_path / name).touch()
    recording = recording_in(tmp_path)
    assert recording is not None and recording.problem == "not read: a.mcap.zstd, b.db3.zstd, c.bag.gz"


def test_folders_of_ros_2_in_a_folder_are_parts_of_one_recording(tmp_path: Path) -> None:
    messages, whole = raw.poses(raw.ROS2)[:30], tmp_path / "day"
    for name, storage, part in (
        ("run_9", StoragePlugin.MCAP, messages[:10]),
        ("run_10", StoragePlugin.SQLITE3, messages[10:20]),
        ("run_11", StoragePlugin.SQLITE3, messages[20:]),
    ):
        raw.write_ros2(whole / name, part, storage)
    (whole / "notes").mkdir()
    (whole / "notes" / "metadata.yaml").write_text("author: nobody")
    times_s = [time_s for _, time_s in read(whole)]
    assert len(times_s) == 30 and times_s == sorted(times_s)
    recording = recording_in(whole)
    assert recording is not None and recording.problem is None
    (whole / "run_11" / "metadata.yaml").unlink()  # as of a recorder that was killed
    recording = recording_in(whole)
    assert recording is not None and recording.problem == "not read: run_11"


def test_files_about_a_bag_are_no_parts_of_a_recording(tmp_path: Path) -> None:
    write_bag(tmp_path / "run.bag", poses(1.0))
    for name in ("run.bag.md5", "x.mcap.sha256", "run.bag.txt", "ramp.bag.png", "run.bag.orig.active", "y.mcap.active"):
        (tmp_path / name).touch()
    recording = recording_in(tmp_path)
    assert recording is not None and recording.problem is None


def test_folder_of_parts_none_of_which_can_be_read_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.mcap.zstd").touch()
    with pytest.raises(ValueError, match=r"a\.mcap\.zstd"):
        recording_in(tmp_path)


def test_bag_that_was_written_topic_by_topic_is_read_in_the_order_of_time(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "converted.bag", poses(1.0, 2.0, 3.0, topic="/a") + poses(1.1, 2.1, 3.1, topic="/b"))
    assert [topic for topic, _ in read(path)] == ["/a", "/b"] * 3


def test_bag_without_a_whole_index_is_read_by_file(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "converted.bag", poses(1.0, 2.0, topic="/a") + poses(1.1, 2.1, topic="/b"))
    path.write_bytes(path.read_bytes()[:-10])
    assert [topic for topic, _ in read(path)] == ["/a", "/a", "/b", "/b"]


def test_bag_whose_clock_was_set_back_is_read_by_file(tmp_path: Path) -> None:
    """In the order of time what came before and after would be mixed."""
    path = write_bag(tmp_path / "run.bag", poses(10.0, 11.0, 12.0, 5.0, 6.0, 11.5))
    assert [time_s for _, time_s in read(path)] == pytest.approx([10.0, 11.0, 12.0, 5.0, 6.0, 11.5])


def test_index_of_topics_that_nobody_reads_is_given_back(tmp_path: Path) -> None:
    reader = rosbag1.Reader(write_bag(tmp_path / "run.bag", poses(1.0, 2.0, topic="/a") + poses(*range(100), topic="/b")))
    reader.open()
    with IndexedRecords(reader, deserialize_ros1) as records:
        assert [message.topic for message in records.messages(["/a"])] == ["/a", "/a"]
        assert [len(index) for index in reader.indexes.values()] == [2]


def killed_recorder(folder: Path) -> Path:
    """A bag of ROS 2 with all messages of a second, of which the later half is in the .db3-wal: its folder, with metadata.yaml."""
    (written,) = raw.write_ros2(folder / "whole", raw.poses(raw.ROS2)[:20], StoragePlugin.SQLITE3).glob("*.db3")
    killed = folder / "killed"
    with closing(sqlite3.connect(written, isolation_level=None)) as database:
        database.execute("PRAGMA journal_mode=WAL")
        database.execute("DELETE FROM messages WHERE id > 10")
        database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        database.execute("INSERT INTO messages SELECT id + 10, topic_id, timestamp + 1000, data FROM messages")
        shutil.copytree(written.parent, killed)
    return killed


@pytest.mark.parametrize("named", ["folder", "file", "folder without metadata.yaml"])
def test_bag_whose_recorder_was_killed_tells_that_its_end_is_missing(tmp_path: Path, named: str) -> None:
    path = killed_recorder(tmp_path)
    if named == "file":
        path = path / "whole.db3"
    elif named != "folder":
        (path / "metadata.yaml").unlink()
    recording = recording_in(path)
    assert recording is not None and len(list(recording.messages(["/odom"]))) == 10
    assert recording.problem is not None and recording.problem.startswith("whole.db3-wal of a recorder that was killed is not read")
    with closing(sqlite3.connect(tmp_path / "killed" / "whole.db3")) as database:  # what the problem advises
        database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    recording = recording_in(path)
    assert recording is not None and len(list(recording.messages(["/odom"]))) == 20 and recording.problem is None


def test_bag_all_of_which_its_recorder_had_not_yet_put_in_is_refused_with_that(tmp_path: Path) -> None:
    path = killed_recorder(tmp_path) / "whole.db3"
    path.write_bytes(path.read_bytes()[:4096])
    with pytest.raises(ValueError, match="not a ROS 2 bag that can be read.*whole.db3-wal of a recorder"):
        Recording([path])


@pytest.mark.parametrize("name", ["run#2", "run?immutable=0", "run%41", "run 100%", "Prüfstand"])
@pytest.mark.parametrize("named", ["folder", "file"])
def test_bag_of_ros_2_may_have_any_name(tmp_path: Path, name: str, named: str) -> None:
    path = raw.write_ros2(tmp_path / "run", raw.poses(raw.ROS2)[:20], StoragePlugin.SQLITE3)
    (path / "metadata.yaml").write_text((path / "metadata.yaml").read_text().replace("run.db3", f'"{name}.db3"'))
    (path / "run.db3").rename(path / f"{name}.db3")
    path = path.rename(tmp_path / name)
    assert len(read(path / f"{name}.db3" if named == "file" else path)) == 20
