"""Messages in the order of time, by the index of a bag: of ROS 2, a folder with metadata.yaml, or a .db3 or .mcap; or of ROS 1."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from itertools import pairwise
from pathlib import Path
from types import TracebackType
from urllib.parse import quote

from rosbags import rosbag1, rosbag2
from rosbags.interfaces import Connection
from rosbags.rosbag2.reader import DirectoryReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader
from rosbags.typesys import Stores, get_typestore

from mapping_tools.bag_records import BagMessage, deserialize_ros1
from rigid_geometry import JUMP_BACK_S

SUFFIXES = (".db3", ".mcap")


class IndexedRecords:
    """A bag that is read once from its beginning; `problem` says what of it is not read, None as far as it is whole."""

    def __init__(
        self, reader: rosbag1.Reader | rosbag2.Reader, deserialize: Callable[[bytes, str], object], problem: str | None = None
    ) -> None:
        """Takes over a reader that is open; `problem`: what it does not read."""
        self.problem = problem
        self._reader, self._deserialize = reader, deserialize
        self.topics = {connection.topic: connection.msgtype for connection in reader.connections}
        self.size = max(reader.message_count, 1)
        self.position = 0

    def __enter__(self) -> IndexedRecords:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._reader.close()

    def messages(self, topics: Collection[str]) -> Iterator[BagMessage]:
        """The messages of some topics, up to the end or to where the bag is damaged."""
        wanted = max(sum(connection.msgcount for connection in self._reader.connections if connection.topic in topics), 1)
        try:
            for number, (connection, time_ns, data) in enumerate(self._read(topics)):
                self.position = number * self.size // wanted
                yield BagMessage(connection.topic, connection.msgtype, time_ns, bytes(data), self._deserialize)
        except Exception as error:  # as above: the reader is in other people's code, and gives what it holds up to there
            broken = f"it breaks off after {self.position} of {self.size} messages: {_one_line(error)}"
            self.problem = "; ".join(filter(None, (self.problem, broken)))
            return
        self.position = self.size

    def _read(self, topics: Collection[str]) -> Iterator[tuple[Connection, int, bytes]]:
        connections = [connection for connection in self._reader.connections if connection.topic in topics]
        if isinstance(self._reader, rosbag1.Reader):  # whose index has an entry for every message
            for number in self._reader.indexes.keys() - {connection.id for connection in connections}:
                del self._reader.indexes[number]
        return self._reader.messages(connections) if connections else iter(())


class _Database(Sqlite3Reader):
    """A .db3 at any path: its reader puts the path into a URI as it is, where #, ? and %41 mean something else."""

    def __init__(self, path: Path) -> None:
        super().__init__(Path(quote(bytes(path))))


class _Folder(DirectoryReader):
    STORAGE_PLUGINS = {**DirectoryReader.STORAGE_PLUGINS, "sqlite3": _Database}


class _Ros2Reader(rosbag2.Reader):
    STORAGE_PLUGINS = {**rosbag2.Reader.STORAGE_PLUGINS, "dir": _Folder, ".db3": _Database}


def ros2_records(path: Path) -> IndexedRecords:
    """A bag of ROS 2; ValueError when it is none, or a damaged one; OSError when it cannot be opened."""
    unread = _unread_logs(path)
    try:
        reader = _Ros2Reader(path)
        reader.open()
    except OSError:
        raise
    except Exception as error:  # whatever the libraries below raise for a file that is none of theirs
        raise ValueError("; ".join(filter(None, (f"not a ROS 2 bag that can be read: {_one_line(error)}", unread)))) from error
    return IndexedRecords(reader, get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr, unread)


def _unread_logs(path: Path) -> str | None:
    """What recorders that were killed left beside the databases of a bag, which its reader passes over; None where that is nothing."""
    databases = sorted(path.glob("*.db3")) if path.is_dir() else [path]
    logs = [database.with_name(f"{database.name}-wal") for database in databases]
    found = [log.name.removesuffix("-wal") for log in logs if log.is_file() and log.stat().st_size]
    advice = "sqlite3 {} 'PRAGMA wal_checkpoint(TRUNCATE)' puts it in"
    return "; ".join(f"{name}-wal of a recorder that was killed is not read: {advice.format(name)}" for name in found) or None


def ros1_records(path: Path) -> IndexedRecords | None:
    """A bag of ROS 1; None where it has no whole index, or the clock was set back, and the order of time would mix before and after."""
    try:
        reader = rosbag1.Reader(path)
        reader.open()
    except Exception:  # whatever the library raises for an index that is damaged or not there: then it is not believed
        return None
    if _is_set_back(reader):
        reader.close()
        return None
    return IndexedRecords(reader, deserialize_ros1)


def _is_set_back(reader: rosbag1.Reader) -> bool:
    """Whether a topic's times jump back in the order in which they were written."""
    for index in reader.indexes.values():
        written = sorted(index, key=lambda entry: (entry.chunk_pos, entry.offset))
        if any(later.time < before.time - 1e9 * JUMP_BACK_S for before, later in pairwise(written)):
            return True
    return False


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
