"""Messages of a ROS 2 bag: its folder with metadata.yaml, or one file of it, sqlite3 (.db3) or mcap."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from types import TracebackType

from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from mapping_tools.bag_records import BagMessage

SUFFIXES = (".db3", ".mcap")


class Ros2Records:
    """A bag that is read once from its beginning; `problem` says why it ended early, None while it has not or when it is whole."""

    def __init__(self, path: Path) -> None:
        """Open a bag; ValueError when it is none, or a damaged one; OSError when it cannot be opened."""
        self.problem: str | None = None
        self._types = get_typestore(Stores.ROS2_HUMBLE)
        try:
            self._reader = Reader(path)
            self._reader.open()
        except OSError:
            raise
        except Exception as error:  # whatever the libraries below raise for a file that is none of theirs
            raise ValueError(f"not a ROS 2 bag that can be read: {_one_line(error)}") from error
        self.topics = {connection.topic: connection.msgtype for connection in self._reader.connections}
        self.size = max(self._reader.message_count, 1)
        self.position = 0

    def __enter__(self) -> Ros2Records:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._reader.close()

    def messages(self, topics: Collection[str]) -> Iterator[BagMessage]:
        """The messages of some topics, up to the end or to where the bag is damaged."""
        connections = [connection for connection in self._reader.connections if connection.topic in topics]
        wanted = max(sum(connection.msgcount for connection in connections), 1)
        try:
            for number, (connection, time_ns, data) in enumerate(self._reader.messages(connections) if connections else ()):
                self.position = number * self.size // wanted
                yield BagMessage(connection.topic, connection.msgtype, time_ns, bytes(data), self._types.deserialize_cdr)
        except Exception as error:  # as above: the reader is in other people's code, and gives what it holds up to there
            self.problem = f"it breaks off after {self.position} of {self.size} messages: {_one_line(error)}"
            return
        self.position = self.size


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
