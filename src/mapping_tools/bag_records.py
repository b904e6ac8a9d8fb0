"""Messages of a bag of ROS 1 in the order of the file. It needs no index: a bag that was cut short gives everything it holds."""

from __future__ import annotations

import bz2
import io
import os
import struct
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from lz4.frame import LZ4FrameDecompressor
from rosbags.rosbag1 import ReaderError
from rosbags.rosbag1.reader import Header, RecordType, read_bytes, read_uint32
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.msg import normalize_msgtype

_MAGIC = b"#ROSBAG V2.0\n"
_LONGEST_HEADER = 1 << 20

_TYPES = get_typestore(Stores.ROS1_NOETIC)
_TYPES.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))  # it has no tf2
deserialize_ros1 = _TYPES.deserialize_ros1


@dataclass(frozen=True)
class BagMessage:
    """A message as it was recorded: serialised, of type "sensor_msgs/msg/PointCloud2" or like, with the time of its recording."""

    topic: str
    msgtype: str
    time_ns: int
    data: bytes
    deserialize: Callable[[bytes, str], object] = deserialize_ros1

    def message(self) -> object:
        """The message; ValueError when its bytes are damaged."""
        try:
            return self.deserialize(self.data, self.msgtype)
        except (SerdeError, struct.error, IndexError, ValueError, AssertionError, KeyError) as error:
            raise ValueError("the message is damaged") from error


class BagRecords:
    """A bag that is read once from its beginning; `problem` says why it ended early, None while it has not or when it is whole."""

    def __init__(self, path: Path) -> None:
        """Open a bag; ValueError when it is none, or none of version 2.0; OSError when it cannot be opened."""
        self._file: BinaryIO = open(path, "rb")
        self.size = os.fstat(self._file.fileno()).st_size
        self.problem: str | None = None
        self.position = 0  # bytes up to the record that is being read
        self.topics: dict[str, str] = {}
        self._connections: dict[int, tuple[str, str]] = {}
        self._closed_by_recorder = False
        if self._file.readline(len(_MAGIC)) != _MAGIC:
            self._file.close()
            raise ValueError("not a rosbag of version 2.0, by its first line")

    def __enter__(self) -> BagRecords:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._file.close()

    def messages(self, topics: Collection[str] | None = None) -> Iterator[BagMessage]:
        """Every message, or those of some topics, up to the end or to where the file breaks off."""
        yield from (message for message in self._messages() if topics is None or message.topic in topics)

    def _messages(self) -> Iterator[BagMessage]:
        while (begin := self._file.tell()) < self.size:
            self.position = begin
            try:
                yield from self._record()
            except (ReaderError, ValueError, OSError, EOFError, RuntimeError) as error:
                self.problem = f"it breaks off after {begin} of {self.size} bytes: {' '.join(str(error).split())}"
                return
        self.position = self.size
        if not self._closed_by_recorder:
            self.problem = "its recorder never closed it, so something may be missing at its end"

    def _record(self) -> Iterator[BagMessage]:
        header = self._header(self._file)
        kind, length = header.get_uint8("op"), read_uint32(self._file)
        if kind == RecordType.CHUNK:
            begin = self._file.tell()
            data = self._file.read(length)
            yield from self._chunk(data, header.get_string("compression"))
            self._check_end(begin + length)
            return
        if kind == RecordType.BAGHEADER:
            self._closed_by_recorder = header.get_uint64("index_pos") != 0
        self._check_end(self._file.tell() + length)
        self._file.seek(length, os.SEEK_CUR)

    def _chunk(self, data: bytes, compression: str) -> Iterator[BagMessage]:
        """The messages of a chunk, as many of them as are whole."""
        records = io.BytesIO(_decompressed(data, compression))
        size = len(records.getbuffer())
        while records.tell() < size:
            header = self._header(records)
            body = read_bytes(records, read_uint32(records))
            kind, connection = header.get_uint8("op"), header.get_uint32("conn")
            if kind == RecordType.CONNECTION:
                msgtype = normalize_msgtype(_described(body).get_string("type"))
                self._connections[connection] = header.get_string("topic"), msgtype
                self.topics[header.get_string("topic")] = msgtype
            elif kind == RecordType.MSGDATA:
                yield BagMessage(*self._connection(connection), header.get_time("time"), body)

    def _connection(self, number: int) -> tuple[str, str]:
        if number not in self._connections:
            raise ValueError(f"a message of connection {number}, which nothing described")
        return self._connections[number]

    def _header(self, source: BinaryIO) -> Header:
        """The header of the next record, unless it claims a length that none has."""
        begin, length = source.tell(), read_uint32(source)
        if length > _LONGEST_HEADER:
            raise ValueError(f"a header of {length} bytes")
        source.seek(begin)
        return Header.read(source)

    def _check_end(self, end: int) -> None:
        if end > self.size:
            raise ValueError(f"a record that would end at byte {end}")


def _described(body: bytes) -> Header:
    """The data of a connection record, which has the form of a header without its length."""
    return Header.read(io.BytesIO(len(body).to_bytes(4, "little") + body))


def _decompressed(data: bytes, compression: str) -> bytes:
    """Also of data that were cut: what can be had of them."""
    if compression == "bz2":
        return bz2.BZ2Decompressor().decompress(data)
    if compression == "lz4":
        return bytes(LZ4FrameDecompressor().decompress(data))
    if compression != "none":
        raise ValueError(f"compression {compression!r} is not known")
    return data
