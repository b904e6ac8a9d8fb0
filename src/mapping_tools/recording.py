"""A recording, whatever it is made of: one bag or many of ROS 1, split or not, or a bag of ROS 2; its messages in the order of time."""

from __future__ import annotations

import heapq
import os
import re
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

from mapping_tools.bag_records import BagMessage, BagRecords
from mapping_tools.indexed_records import SUFFIXES, IndexedRecords, ros1_records, ros2_records
from mapping_tools.sweep_sources import StoppedError, never

METADATA = "metadata.yaml"
_READ = (".bag", ".bag.active", *SUFFIXES)  # active: the part that was being written when its recorder ended
_COMPRESSED = re.compile(r"\.(bag|db3|mcap)\.(zstd|zst|lz4|gz|bz2|xz|zip)$")


def bags_of(path: Path) -> list[Path]:
    """The bags that a path names: itself, or those that a folder holds, folders of ROS 2 among them; empty for a folder without any."""
    if not path.is_dir() or _has_metadata(path):
        return [path]
    return sorted(
        part
        for part in path.iterdir()
        if (part.name.endswith(_READ) and part.is_file()) or (_has_metadata(part) and _has_files_of_ros2(part))
    )


def unread_of(path: Path) -> list[Path]:
    """Parts of a folder of bags that are not read: files that are compressed, and beside folders of ROS 2 those that were never closed."""
    bags = bags_of(path)
    if path in bags:
        return []
    others, has_folders = [part for part in path.iterdir() if part not in bags], any(bag.is_dir() for bag in bags)
    return sorted(
        part for part in others if (_COMPRESSED.search(part.name) and part.is_file()) or (has_folders and _has_files_of_ros2(part))
    )


def _has_metadata(folder: Path) -> bool:
    """Whether it was closed; False of a folder that may not be looked into."""
    return os.path.isfile(folder / METADATA)


def _has_files_of_ros2(folder: Path) -> bool:
    return any(any(folder.glob(f"*{suffix}*")) for suffix in SUFFIXES)  # compressed ones, too


class Recording:
    """Bags that are read once, together, from their beginning."""

    def __init__(self, paths: Sequence[Path], unread: Sequence[Path] = ()) -> None:
        """`unread`: parts of it that cannot be read, a problem. ValueError when a path is no bag, OSError when it cannot be opened."""
        self._bags: list[tuple[Path, BagRecords | IndexedRecords]] = []
        self._unread = unread
        self.topics: dict[str, str] = {}
        for path in paths:
            try:
                bag = ros2_records(path) if path.is_dir() or path.suffix in SUFFIXES else _ros1(path)
            except ValueError as error:
                raise ValueError(f"{path.name}: {error}" if len(paths) > 1 else str(error)) from error
            self._bags.append((path, bag))
            self.topics |= bag.topics

    @property
    def problem(self) -> str | None:
        """What is damaged in it; None when it is whole."""
        found = [f"{path.name}: {bag.problem}" if len(self._bags) > 1 else bag.problem for path, bag in self._bags if bag.problem]
        if self._unread:
            found.append(f"not read: {', '.join(path.name for path in self._unread)}")
        return "; ".join(found) or None

    @property
    def progress(self) -> float:
        """Share that has been read, 0 to 1."""
        return sum(bag.position / bag.size for _, bag in self._bags) / len(self._bags)

    def messages(self, topics: Collection[str], is_stopping: Callable[[], bool] = never) -> Iterator[BagMessage]:
        """The messages of some topics, of all bags in the order in which they were recorded; StoppedError when `is_stopping`."""
        with ExitStack() as stack:
            for _, bag in self._bags:
                stack.enter_context(bag)
            for message in heapq.merge(*(bag.messages(topics) for _, bag in self._bags), key=lambda message: message.time_ns):
                if is_stopping():
                    raise StoppedError
                yield message

    def check(self, topic: str, msgtype: str, advice: str = "") -> None:
        """ValueError when there is no such topic, or it holds something else."""
        if topic not in self.topics:
            raise ValueError(f"no {msgtype} on topic {topic}; topics in it: {self.described()}{advice}")
        if self.topics[topic] != msgtype:
            raise ValueError(f"topic {topic} holds {self.topics[topic]}, not {msgtype}")

    def described(self) -> str:
        """Its topics with their types."""
        return ", ".join(f"{topic} ({self.topics[topic]})" for topic in sorted(self.topics)) or "none"


def _ros1(path: Path) -> IndexedRecords | BagRecords:
    """By its index; without one, of a bag that was cut or never closed, by file, and its topics by all that it holds."""
    if (indexed := ros1_records(path)) is not None:
        return indexed
    with BagRecords(path) as records:
        for _ in records.messages():
            pass
    bag = BagRecords(path)
    bag.topics = records.topics
    return bag
