"""What ./map_bag maps of a recording: clouds of a folder, finished clouds of a bag, or what a robot's drivers sent."""

from __future__ import annotations

import argparse
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from explore_command.arguments import ArgumentProblem
from mapping_tools.bag_sweeps import BagSweeps, BagTopics
from mapping_tools.folder_sweeps import FolderSweeps
from mapping_tools.raw_sweeps import DescribedRobot, RawSweeps, RawTopics
from mapping_tools.recording import Recording, bags_of, unread_of
from mapping_tools.sensor_chain import SensorConfig
from mapping_tools.sweep_sources import SweepSource
from mount_calibration import RECORDED_FILE, named_calibration
from robot_body import DESCRIPTION, contradictions, load_robot, robot_file, urdf_file

Array = NDArray[np.float64]

ROBOT_FILE = "robot.yaml"
_DRIVERS = ("scan", "points", "joints", "imu", "wheels")
_OF_DRIVERS = ("--robot", "--mount-calibration", *(f"--{name}-topic" for name in _DRIVERS))


@dataclass(frozen=True, eq=False)
class Wanted:
    """What is asked of a recording: `cloud`, `odometry` None where no such topic was named; T_base_cloud (4, 4); `sensor` (3,).

    `calibration`: as of `named_calibration`, None for the one that lies beside the robot's file, if there is one.
    """

    recording: Path
    cloud: str | None
    odometry: str | None
    without_odometry: bool
    raw: RawTopics
    from_raw: bool
    robot: Path | None
    calibration: str | None
    T_base_cloud: Array | None
    sensor: Array | None


def source_of(wanted: Wanted, config: SensorConfig) -> SweepSource:
    """The sweeps of a recording. ValueError when it is none that can be mapped, OSError when it cannot be opened."""
    recording = recording_in(wanted.recording)
    if recording is None:
        _refuse(wanted, "clouds of a folder", "--cloud-topic", "--odom-topic", "--no-odometry", "--raw", *_OF_DRIVERS)
        return FolderSweeps(wanted.recording, np.eye(4) if wanted.T_base_cloud is None else wanted.T_base_cloud, wanted.sensor)
    if wanted.from_raw or (wanted.cloud is None and _is_raw(recording, wanted.raw)):
        _refuse(wanted, "messages of the drivers", "--cloud-topic", "--no-odometry", "--mount", "--sensor")
        return RawSweeps(recording, wanted.raw, robot_of(wanted.recording, wanted.robot, wanted.calibration), config)
    _refuse(wanted, "finished clouds", *_OF_DRIVERS)
    topics = BagTopics(wanted.cloud or BagTopics.cloud, None if wanted.without_odometry else wanted.odometry or BagTopics.odometry)
    if wanted.odometry is None:
        topics = topics.tracked(recording.topics)
    return BagSweeps(recording, topics, wanted.T_base_cloud, wanted.sensor)


def recording_in(path: Path) -> Recording | None:
    """The bag or bags that a path names; None for a folder without any. ValueError and OSError as of `Recording`."""
    bags, unread = bags_of(path), unread_of(path)
    if unread and not bags:
        raise ValueError(f"its bags are compressed: {', '.join(file.name for file in unread)}")
    return Recording(bags, unread) if bags else None


def _refuse(wanted: Wanted, mapped: str, *options: str) -> None:
    """ValueError for an option that says nothing of what is mapped."""
    given = {
        "--cloud-topic": wanted.cloud is not None,
        "--odom-topic": wanted.odometry is not None,
        "--no-odometry": wanted.without_odometry,
        "--raw": wanted.from_raw,
        "--robot": wanted.robot is not None,
        "--mount-calibration": bool(wanted.calibration),
        "--mount": wanted.T_base_cloud is not None,
        "--sensor": wanted.sensor is not None,
        **{f"--{name}-topic": name in wanted.raw.named for name in _DRIVERS},
    }
    if found := [option for option in options if given[option]]:
        raise ValueError(f"{found[0]}: has no effect on {mapped}, which are mapped here")


def add_raw_arguments(p: argparse.ArgumentParser) -> None:
    """The options that say where drivers publish, and which robot recorded."""
    p.add_argument(
        "--robot",
        type=robot_file,
        metavar="R",
        help="the robot that sent it, by name or FILE as in ./explore; default robot.yaml beside the bag",
    )
    p.add_argument("--odom-topic", metavar="T", help="nav_msgs/Odometry; default /odom, or /odom_tracked where the bag has it")
    for name in _DRIVERS:
        p.add_argument(f"--{name}-topic", metavar="T", help=f"of the drivers; default {getattr(RawTopics, name)}")


def raw_topics(a: argparse.Namespace) -> RawTopics:
    """The topics that the options name; ArgumentProblem where one of them makes another one useless."""
    given = {name: getattr(a, f"{name}_topic") for name in _DRIVERS} | {"odometry": a.odom_topic}
    named = {name: topic for name, topic in given.items() if topic is not None}
    for name, other, option in (("scan", "points", "points"), ("imu", "odometry", "odom"), ("wheels", "odometry", "odom")):
        if {name, other} <= named.keys():
            raise ArgumentProblem(f"--{name}-topic: has no effect with --{option}-topic, which is mapped in its place")
    return replace(RawTopics(), **named, named=frozenset(named))


def _is_raw(recording: Recording, raw: RawTopics) -> bool:
    return BagTopics.cloud not in recording.topics and bool({raw.scan, raw.points} & recording.topics.keys())


def robot_of(recording: Path, robot: Path | None, calibration: str | None) -> DescribedRobot:
    """The robot of --robot, or the one whose files lie beside the recording, with its calibration as of `Wanted`.

    ValueError when there is none, or it contradicts its URDF, or the calibration is none.
    """
    folder = recording if recording.is_dir() else recording.parent
    path = robot or folder / ROBOT_FILE
    if not path.is_file():
        raise ValueError(f"--robot FILE.yaml has to say how the sensors are mounted: there is no {path}")
    body, beside = load_robot(path), path.parent / DESCRIPTION
    description = beside if beside.is_file() else urdf_file(body)
    urdf = _text_of(description)
    if found := contradictions(body, urdf):
        raise ValueError(f"{path} contradicts {description}: {'; '.join(found)}")
    if calibration is None:
        calibration = str(path.parent / RECORDED_FILE) if (path.parent / RECORDED_FILE).exists() else ""
    return DescribedRobot(body, urdf, named_calibration(calibration))


def _text_of(description: Path) -> str:
    """What a URDF says, whose encoding is that of its XML declaration; ValueError, with its name, where it is no XML."""
    try:
        return ElementTree.tostring(ElementTree.fromstring(description.read_bytes()), encoding="unicode")
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise ValueError(f"{description} cannot be read: {error}") from error
