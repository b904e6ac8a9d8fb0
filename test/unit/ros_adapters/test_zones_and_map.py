"""Zones that hold are kept and told whatever becomes of drawing them, and a map that was forgotten is not drawn."""

import threading
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rospy
from explore_3dnav.msg import Zone as ZoneMessage
from explore_3dnav.srv import SetZonesRequest
from geometry_msgs.msg import Point32, Polygon
from numpy.typing import NDArray

from map_zones import Zones, read_zones
from octomap_server_3dnav.exploration.decide import Explorer
from octomap_server_3dnav.octree.map_builder import MapBuilder
from octomap_server_3dnav.octree.shelf import Shelf
from robot_body import RobotBody
from ros_adapters.deciding_memory import DecidingMemory
from ros_adapters.octomap_server_config import OctomapServerConfig, OctomapServerSensorModel
from ros_adapters.served_map import ServedMap
from ros_adapters.stage_times import StageTimes
from ros_adapters.zone_keeper import FILE, ZoneKeeper

NO_GO = ZoneMessage(polygon=Polygon([Point32(x, y, 0.0) for x, y in ((1, 1), (2, 1), (2, 2))]))


class _Node:
    """Stands for a node: it keeps what is published, kept and told, and answers what is asked of it."""

    name = "octomap_server_3dnav_node"

    def __init__(self, folder: Path | None) -> None:
        self._folder, self.lock = folder, threading.RLock()
        self.topics: dict[str, list[Any]] = {}
        self.served: dict[str, Callable[[Any], Any]] = {}
        self.kept: dict[str, Any] = {}
        self.dropped: list[tuple[str, str]] = []
        self.life = SimpleNamespace(kept=lambda _, otherwise: otherwise, keep=self.kept.__setitem__)
        self.diagnostics = SimpleNamespace(on_terminal=lambda *_: None, dropped=lambda *what: self.dropped.append(what), values={})

    def run_folder(self) -> Path | None:
        return self._folder

    def publisher(self, topic: str, _type: type, **_more: object) -> SimpleNamespace:
        return SimpleNamespace(publish=self.topics.setdefault(topic, []).append)

    def serve(self, name: str, _type: type, answer: Callable[[Any], Any]) -> None:
        self.served[name] = answer


@pytest.fixture
def replans(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What move_base_node was asked for."""
    asked: list[str] = []
    monkeypatch.setattr(rospy, "get_param", lambda _, default=None: default)
    monkeypatch.setattr(rospy, "ServiceProxy", lambda name, _type: lambda: asked.append(name))
    return asked


def keeper_of(
    node: _Node, use: Callable[[Zones], None], draw: Callable[[], None], standing: NDArray[np.float64] | None = None
) -> Callable[[SetZonesRequest], Any]:
    """The service that takes new zones."""
    ZoneKeeper(node, use, draw, lambda: standing)  # type: ignore[arg-type]
    return node.served["explore/set_zones"]


def test_zones_are_kept_and_told_before_they_are_drawn(tmp_path: Path, replans: list[str]) -> None:
    node, done = _Node(tmp_path), list[str]()

    def draw() -> None:
        assert len(node.kept["zones"].no_go) == len(node.topics["explore/zone_list"][-1].no_go) == 1
        assert len(read_zones(tmp_path / FILE).no_go) == 1 and done == ["use", "use"] and replans == []
        done.append("draw")

    set_zones = keeper_of(node, lambda _: done.append("use"), draw)
    assert set_zones(SetZonesRequest(no_go=[NO_GO])).accepted
    assert done == ["use", "use", "draw"] and len(replans) == 1


def test_zones_of_a_session_that_goes_on_hold_again_until_somebody_sets_others(tmp_path: Path, replans: list[str]) -> None:
    assert keeper_of(_Node(tmp_path), lambda _: None, lambda: None)(SetZonesRequest(no_go=[NO_GO])).accepted
    resumed, used = _Node(tmp_path), list[Zones]()
    set_zones = keeper_of(resumed, used.append, lambda: None)
    assert len(used[-1].no_go) == len(read_zones(tmp_path / FILE).no_go) == 1
    assert set_zones(SetZonesRequest()).accepted and not (tmp_path / FILE).exists()
    keeper_of(_Node(tmp_path), used.append, lambda: None)
    assert not used[-1].are_set


def test_map_that_cannot_be_drawn_leaves_zones_that_hold_and_is_counted(tmp_path: Path, replans: list[str]) -> None:
    node, used = _Node(tmp_path), list[Zones]()

    def draw() -> None:
        raise ValueError("nan s is no ROS time")

    answer = keeper_of(node, used.append, draw)(SetZonesRequest(no_go=[NO_GO]))
    assert (answer.accepted, answer.message) == (True, "0 bounds, 1 no-go zones")
    assert len(used[-1].no_go) == len(node.kept["zones"].no_go) == len(node.topics["explore/zone_list"][-1].no_go) == 1
    assert len(replans) == 1 and node.dropped == [("map not drawn with new zones", "nan s is no ROS time")]


def test_zone_is_asked_about_the_ground_below_the_robot_and_not_about_its_base(tmp_path: Path, replans: list[str]) -> None:
    """Ground 0.13 m below base_link, and a zone that closes ground up to 0.05 m below it."""
    served = served_map()
    served.around = np.eye(4)
    served.around[:3, 3] = 1.7, 1.3, 0.0
    standing = served.standing()
    assert standing is not None and standing[2] == pytest.approx(-RobotBody().base_height_m)
    set_zones = keeper_of(_Node(tmp_path), lambda _: None, lambda: None, standing)
    low, high = (ZoneMessage(polygon=NO_GO.polygon, low=-3.0, high=z) for z in (-0.2, -0.05))
    assert set_zones(SetZonesRequest(no_go=[low])).accepted
    assert "lies in no_go[0]" in set_zones(SetZonesRequest(no_go=[high])).message


def served_map() -> ServedMap:
    model, robot = OctomapServerSensorModel(), RobotBody()
    builder = MapBuilder(OctomapServerConfig(), model, robot, Shelf(None))
    return ServedMap(_Node(None), builder, DecidingMemory(Explorer(), StageTimes()), None, SimpleNamespace(publish=lambda *_: None))  # type: ignore[arg-type]


def test_map_is_drawn_again_as_it_was_and_after_a_reset_not_at_all(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[tuple[float, Any]] = []
    monkeypatch.setattr(ServedMap, "draw", lambda _, *what: drawn.append(what))
    served, here = served_map(), np.eye(4)
    served.draw_again()
    assert drawn == []
    served.stamp_s, served.around = 3.0, here
    served.draw_again()
    assert drawn == [(3.0, here)]
    served.forget()
    served.draw_again()
    assert len(drawn) == 1 and served.around is None
