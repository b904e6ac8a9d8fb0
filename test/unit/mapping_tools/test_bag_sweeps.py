"""Which odometry the finished clouds of a bag get, each by its own stamp, whatever other clouds and the clock do."""

from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recordings import STORE, cloud_message, odometry_message, write_bag

from mapping_tools import bag_sweeps
from mapping_tools.bag_sweeps import BagSweeps, BagTopics
from mapping_tools.recording import Recording
from mapping_tools.sweep_sources import SourceSweep, StoppedError, Unreadable
from rigid_geometry import transform_from_rpy

POINTS = np.ones((3, 3), np.float32)
FORWARD_MPS = 0.5
SIGMA_RAD_S = 0.01  # sigma of up grows with the stamp, which tells of which pose it is

Message = tuple[str, Any]


def cloud(stamp_s: float, frame: str = "base_link") -> Message:
    return "/sweep_cloud", cloud_message(stamp_s, POINTS, frame=frame)


def poses(*stamps_s: float, topic: str = "/odom") -> list[Message]:
    return [(topic, odometry_message(t, transform_from_rpy((FORWARD_MPS * t, 0.0, 0.0)), SIGMA_RAD_S * t)) for t in stamps_s]


def found_in(path: Path, timed: list[tuple[float, Message]], topics: BagTopics | None = None) -> list[SourceSweep | Unreadable]:
    """The sweeps of a bag of messages with the times of their recording."""
    (path / "run.bag").unlink(missing_ok=True)
    bag = write_bag(path / "run.bag", [message for _, message in timed], times_s=[time_s for time_s, _ in timed])
    return list(BagSweeps(Recording([bag]), topics or BagTopics(), None, None).sweeps())


def at_stamps(*messages: Message) -> list[tuple[float, Message]]:
    """Recorded at their stamps, in this order."""
    return [(m[1].header.stamp.sec + 1e-9 * m[1].header.stamp.nanosec, m) for m in messages]


def test_cloud_in_the_midst_of_a_silence_of_the_odometry_is_not_placed(tmp_path: Path) -> None:
    known, unknown = found_in(tmp_path, at_stamps(*poses(1.0), cloud(1.1), *poses(1.2), cloud(2.0), *poses(3.0)))
    assert isinstance(known, SourceSweep) and known.T_odom_base is not None
    assert known.T_odom_base[0, 3] == pytest.approx(1.1 * FORWARD_MPS)
    assert isinstance(unknown, Unreadable) and "for 1.8 s" in unknown.reason


def without_attitude(stamp_s: float, x: float) -> Message:
    """As of a filter that has not begun."""
    (topic, message), none = poses(stamp_s)[0], STORE.types["geometry_msgs/msg/Quaternion"](x, 0.0, 0.0, 0.0)
    message.pose.pose.orientation = none
    return topic, message


def test_poses_that_are_none_are_counted_with_the_reason_of_the_last(tmp_path: Path) -> None:
    none = [without_attitude(1.0, 0.0), without_attitude(1.3, np.nan), without_attitude(1.6, 0.0)]
    bag = write_bag(tmp_path / "run.bag", [*none[:2], cloud(1.5), none[2], *poses(1.7), cloud(1.8), *poses(1.9)])
    source = BagSweeps(Recording([bag]), BagTopics(), None, None)
    unknown, known = source.sweeps()
    assert isinstance(unknown, Unreadable) and isinstance(known, SourceSweep)
    assert source.notes == ["3 messages of /odom left out, the last one: not a unit quaternion: (0.0, 0.0, 0.0, 0.0)"]


def test_up_that_was_told_later_is_not_that_of_the_cloud(tmp_path: Path) -> None:
    topics = BagTopics(odometry="/odom_tracked", up="/odom")
    tracked = [poses(0.1 * k, topic="/odom_tracked")[0] for k in range(10, 30)]
    (found,) = found_in(tmp_path, at_stamps(*poses(1.0), *tracked[:6], cloud(1.5), *tracked[6:], *poses(2.9)), topics)
    assert isinstance(found, Unreadable) and "what was up at 1.500 s is not known: the odometry told it 1.4 s later" in found.reason


def test_up_is_known_as_long_as_poses_are(tmp_path: Path) -> None:
    """Of an odometry at 200 Hz, as of any other."""
    fast = [poses(1.0 + 0.005 * k)[0] for k in range(1000)]
    timed = [*at_stamps(*fast), (6.1, cloud(2.001)), (6.2, poses(6.1)[0])]
    (found,) = found_in(tmp_path, timed)
    assert isinstance(found, SourceSweep) and found.gravity_sigma_rad == pytest.approx(2.005 * SIGMA_RAD_S)


def test_cloud_of_a_bad_stamp_holds_up_no_other(tmp_path: Path) -> None:
    ahead = (1.05, cloud(3601.0))
    others = [m for k in range(5) for m in at_stamps(cloud(1.1 + 0.2 * k), *poses(1.2 + 0.2 * k))]
    source, names = [*at_stamps(*poses(1.0)), ahead, *others], [f"/sweep_cloud {k}" for k in range(6)]
    found = found_in(tmp_path, source)
    assert [sweep.name for sweep in found] == [*names[1:], names[0]]
    assert all(isinstance(sweep, SourceSweep) for sweep in found[:-1])
    assert isinstance(found[-1], Unreadable) and "odometry does not reach its stamp" in found[-1].reason


def test_clouds_from_before_the_clock_was_set_back_are_named_at_once(tmp_path: Path) -> None:
    before, after = at_stamps(*poses(50.0), cloud(50.05)), [*poses(20.0), cloud(20.1), *poses(20.2)]
    late, found = found_in(tmp_path, before + [(50.1 + 0.1 * k, message) for k, message in enumerate(after)])
    assert isinstance(late, Unreadable) and late.name == "/sweep_cloud 0" and "the clock was set back" in late.reason
    assert isinstance(found, SourceSweep) and found.stamp_s == pytest.approx(20.1)


def test_bag_is_left_between_two_messages(tmp_path: Path) -> None:
    """Not only at the next cloud, which may be minutes away."""
    bag = write_bag(tmp_path / "run.bag", [cloud(1.0), *poses(*(1.0 + 0.1 * k for k in range(50)))])
    asked = count()
    with pytest.raises(StoppedError):
        list(BagSweeps(Recording([bag]), BagTopics(), None, None).sweeps(lambda: next(asked) == 20))
    assert next(asked) == 21


def test_clouds_that_wait_do_not_pile_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of too many the one that is farthest ahead is given up, before the end of the bag: its stamp may be a bad one."""
    monkeypatch.setattr(bag_sweeps, "MOST_WAITING_BYTES", 60 * len(cloud(0.0)[1].data))
    ahead = [(1.0 + 0.01 * k, cloud(3600.0 + k)) for k in range(62)]
    found = found_in(tmp_path, [*at_stamps(*poses(0.9)), *ahead, *at_stamps(*poses(4.9), cloud(5.0), *poses(5.1))])
    assert [sweep.name for sweep in found[:4]] == ["/sweep_cloud 60", "/sweep_cloud 61", "/sweep_cloud 59", "/sweep_cloud 62"]
    assert isinstance(found[0], Unreadable) and "more clouds than 0 MB wait for odometry" in found[0].reason
    assert isinstance(found[3], SourceSweep)
    assert isinstance(found[-1], Unreadable) and "odometry does not reach its stamp" in found[-1].reason


def test_cloud_that_need_not_wait_may_be_of_any_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bag_sweeps, "MOST_WAITING_BYTES", 1)
    (found,) = found_in(tmp_path, at_stamps(cloud(1.0)), BagTopics(odometry=None))
    assert isinstance(found, SourceSweep)


def test_clouds_at_ten_hertz_wait_for_odometry_that_is_recorded_ten_seconds_late(tmp_path: Path) -> None:
    clouds = [(1.0 + 0.1 * k, cloud(1.0 + 0.1 * k)) for k in range(100)]
    late = [(11.0 + 0.1 * k, poses(0.95 + 0.1 * k)[0]) for k in range(102)]
    found = found_in(tmp_path, [*clouds, *late])
    assert len(found) == 100 and all(isinstance(sweep, SourceSweep) for sweep in found)


def test_one_cloud_of_another_frame_is_named_and_a_bag_of_them_is_refused(tmp_path: Path) -> None:
    messages = [m for k in range(3) for m in (*poses(1.0 + k), cloud(1.05 + k, "base_link" if k != 1 else "camera"), *poses(1.1 + k))]
    first, strange, last = found_in(tmp_path, at_stamps(*messages))
    assert isinstance(first, SourceSweep) and isinstance(last, SourceSweep)
    assert isinstance(strange, Unreadable) and "clouds are in frame 'camera'" in strange.reason
    with pytest.raises(ValueError, match="--mount has to say"):
        found_in(tmp_path, at_stamps(*poses(1.0), cloud(1.05, "camera"), *poses(1.1), cloud(1.15), *poses(1.2)))
