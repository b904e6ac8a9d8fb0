"""A recording, whatever it is made of: one bag or many of ROS 1, split or not, or a bag of ROS 2; its messages in the order of time."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from pathlib import Path

from rosbags.rosbag1 import Reader

from mapping_tools.bag_records import BagMessage, BagRecords
from mapping_tools.ros2_records import SUFFIXES, Ros2Records

METADATA = "metadata.yaml"


def bags_of(path: Path) -> list[Path]:
    """The bags that a path names: itself, or those that a folder holds; empty for a folder without any."""
    if not path.is_dir() or (path / METADATA).is_file():
        return [path]
    return sorted(file for file in path.iterdir() if file.suffix in (".bag", *SUFFIXES) and file.is_file())


class Recording:
    """Bags that are read once, together, from their beginning."""

    def __init__(self, paths: list[Path]) -> None:
        """ValueError when one is no bag, OSError when it cannot be opened."""
        self._bags: list[tuple[Path, BagRecords | Ros2Records]] = []
        self.topics: dict[str, str] = {}
        for path in paths:
            try:
                bag = Ros2Records(path) if path.is_dir() or path.suffix in SUFFIXES else BagRecords(path)
            except ValueError as error:
                raise ValueError(f"{path.name}: {error}" if len(paths) > 1 else str(error)) from error
            self._bags.append((path, bag))
            self.topics |= bag.topics if isinstance(bag, Ros2Records) else _ros1_topics(path)

    @property
    def problem(self) -> str | None:
        """What is damaged in it; None when it is whole."""
        found = [f"{path.name}: {bag.problem}" if len(self._bags) > 1 else bag.problem for path, bag in self._bags if bag.problem]
        return "; ".join(found) or None

    @property
    def progress(self) -> float:
        """Share that has been read, 0 to 1."""
        return sum(bag.position / bag.size for _, bag in self._bags) / len(self._bags)

    def messages(self, topics: Collection[str]) -> Iterator[BagMessage]:
        """The messages of some topics, of all bags in the order in which they were recorded."""
        with ExitStack() as stack:
            for _, bag in self._bags:
                stack.enter_context(bag)
            yield from heapq.merge(*(bag.messages(topics) for _, bag in self._bags), key=lambda message: message.time_ns)

    def check(self, topic: str, msgtype: str, advice: str = "") -> None:
        """ValueError when there is no such topic, or it holds something else."""
        if topic not in self.topics:
            raise ValueError(f"no {msgtype} on topic {topic}; topics in it: {self.described()}{advice}")
        if self.topics[topic] != msgtype:
            raise ValueError(f"topic {topic} holds {self.topics[topic]}, not {msgtype}")

    def described(self) -> str:
        """Its topics with their types."""
        return ", ".join(f"{topic} ({self.topics[topic]})" for topic in sorted(self.topics)) or "none"


def _ros1_topics(path: Path) -> dict[str, str]:
    """By the bag's index; of a bag without one, that was cut or never closed, by all that it holds."""
    try:
        with Reader(path) as indexed:
            return {connection.topic: connection.msgtype for connection in indexed.connections}
    except Exception:  # whatever the library raises for an index that is damaged or not there: then it is not believed
        pass
    with BagRecords(path) as records:
        for _ in records.messages():
            pass
        return records.topics
