"""What a robot's drivers sent becomes a map: bags of ROS 1 and ROS 2, split or not; what is missing is named."""

import json
import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import raw_recordings as raw
import yaml
from recordings import refusal
from rosbags.rosbag2 import StoragePlugin

from mapping_tools import calibrate_mount, map_bag
from mapping_tools.recorded_sources import robot_of
from mapping_tools.recording import Recording
from mapping_tools.sensor_chain import MeasuredSweep, Pose, SensorChain, SensorConfig
from mapping_tools.sweep_sources import Unreadable
from mount_calibration import RECORDED_FILE, TiltCalibration, read_calibration, write_calibration
from pose_graph_mapping.session.session_store import SessionStore
from rigid_geometry import transform_from_rpy
from robot_body import DESCRIPTION, RobotBody, load_robot, robot_mapping, urdf_file
from sweep_assembly import SweepAssemblyConfig

sys.path.append(str(Path(__file__).parents[1] / "sweep_assembly"))

from lidar_in_a_room import LIDAR, TILT, revolution


@pytest.fixture(scope="session")
def drive() -> raw.Messages:
    return raw.raw_messages()


@pytest.fixture(scope="session")
def drive_ros2() -> raw.Messages:
    return raw.raw_messages(raw.ROS2)


def robot_beside(folder: Path, robot: RobotBody | None = None) -> Path:
    """robot.yaml and the description, as --record leaves them; the Husky's by default."""
    robot = robot or RobotBody()
    (folder / "robot.yaml").write_text(yaml.safe_dump(robot_mapping(robot)))
    (folder / DESCRIPTION).write_text(urdf_file(robot).read_text())
    return folder


def mapped(recording: Path, out: Path, *words: str) -> dict[str, Any]:
    assert map_bag.main([str(recording), "--out", str(out), "--quiet", *words]) == 0
    return json.loads((out / map_bag.SUMMARY).read_text())


@pytest.fixture(scope="session")
def one_bag(tmp_path_factory: pytest.TempPathFactory, drive: raw.Messages) -> Path:
    return raw.write_ros1(robot_beside(tmp_path_factory.mktemp("raw")) / "run.bag", drive)


@pytest.fixture(scope="session")
def one_map(tmp_path_factory: pytest.TempPathFactory, one_bag: Path) -> Path:
    out = tmp_path_factory.mktemp("map")
    summary = mapped(one_bag, out)
    assert (summary["vertices"], summary["not_placed"], summary["notes"]) == (2, [], [])
    return out


def trajectory(out: Path) -> np.ndarray:
    return np.loadtxt(out / "trajectory.txt")


def test_sweeps_of_the_drive_lie_where_they_were_made(one_map: Path) -> None:
    first, second = trajectory(one_map)
    np.testing.assert_allclose(second[1:4] - first[1:4], [raw.DISTANCE_M, 0.0, 0.0], atol=0.01)
    assert [first[0], second[0]] == pytest.approx([t + raw.SWEEP_S for t in raw.SWEEPS_S], abs=0.03)
    points = SessionStore(one_map).load_sweep(0).points
    assert np.minimum(np.abs(points - raw.ROOM_LOW), np.abs(points - raw.ROOM_HIGH)).min(axis=1).max() < 0.02 and len(points) > 20_000


@pytest.mark.parametrize("storage", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
@pytest.mark.parametrize("named", ["folder", "file"])
def test_ros_2_gives_the_same_map(tmp_path: Path, one_map: Path, drive_ros2: raw.Messages, storage: StoragePlugin, named: str) -> None:
    folder = raw.write_ros2(tmp_path / "run", drive_ros2, storage)
    if named == "file":
        (folder,) = (path for path in folder.iterdir() if path.suffix in (".db3", ".mcap"))
    robot_beside(tmp_path)
    mapped(folder, tmp_path / "out", "--robot", str(tmp_path / "robot.yaml"))
    np.testing.assert_allclose(trajectory(tmp_path / "out"), trajectory(one_map), atol=1e-6)


def test_split_bags_are_one_in_the_order_of_time_whatever_their_names(tmp_path: Path, one_map: Path, drive: raw.Messages) -> None:
    parts, third = robot_beside(tmp_path), len(drive) // 3
    for name, part in {"run_9": drive[:third], "run_10": drive[third : 2 * third], "run_1": drive[2 * third :]}.items():
        raw.write_ros1(parts / f"{name}.bag", part)
    (parts / "cloud.ply").write_text("not a sweep: the folder holds bags")
    mapped(parts, tmp_path / "out")
    np.testing.assert_allclose(trajectory(tmp_path / "out"), trajectory(one_map), atol=1e-9)


def test_odometry_of_the_robot_s_own_stands_in_for_imu_and_wheels(tmp_path: Path, one_map: Path, drive: raw.Messages) -> None:
    messages = [message for message in drive if message[0] != "/imu/data"] + raw.poses()
    messages.sort(key=lambda message: (message[2].header.stamp.sec, message[2].header.stamp.nanosec))
    mapped(raw.write_ros1(robot_beside(tmp_path) / "run.bag", messages), tmp_path / "out")
    np.testing.assert_allclose(trajectory(tmp_path / "out"), trajectory(one_map), atol=0.01)


def test_odometry_that_is_named_comes_before_imu_and_wheels(tmp_path: Path, drive: raw.Messages) -> None:
    """The poses of the robot's own are 40 m off."""

    def carried(message: Any) -> Any:
        at = message.pose.pose.position
        pose = replace(message.pose.pose, position=replace(at, x=at.x + 40.0))
        return replace(message, pose=replace(message.pose, pose=pose))

    there = [(topic, kind, carried(message)) for topic, kind, message in raw.poses()]
    path = raw.write_ros1(robot_beside(tmp_path) / "run.bag", drive + there)
    mapped(path, tmp_path / "wheels")
    mapped(path, tmp_path / "named", "--raw", "--odom-topic", "/odom")
    stored = [SessionStore(tmp_path / name).sweeps[0].measured for name in ("wheels", "named")]
    assert [round(m.T_odom_base[0, 3] / 40.0) for m in stored if m is not None] == [0, 1]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("--no-odometry",), "--no-odometry: has no effect on messages of the drivers"),
        (("--raw", "--cloud-topic", "/c"), "--cloud-topic: has no effect on messages of the drivers"),
        (("--odom-topic", "/odom", "--imu-topic", "/imu"), "--imu-topic: has no effect with --odom-topic"),
        (("--scan-topic", "/s", "--points-topic", "/p"), "--scan-topic: has no effect with --points-topic"),
        (("--points-topic", "/p"), "no sensor_msgs/msg/PointCloud2 on topic /p"),
        (("--imu-topic", "/i"), "no sensor_msgs/msg/Imu on topic /i"),
    ],
)
def test_option_that_says_nothing_of_drivers_is_refused(
    tmp_path: Path, off_bag: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], reason: str
) -> None:
    assert reason in refusal(capsys, off_bag, "--out", tmp_path / "out", *words)


def test_finished_clouds_come_first_unless_raw_is_asked_for(
    tmp_path: Path, drive: raw.Messages, capsys: pytest.CaptureFixture[str]
) -> None:
    cloud = ("/sweep_cloud", "nav_msgs/msg/Odometry", raw.Drivers(raw.ROS1).pose(raw.BEGIN_S))
    path = raw.write_ros1(robot_beside(tmp_path) / "both.bag", [cloud, *drive])
    assert "topic /sweep_cloud holds nav_msgs/msg/Odometry" in refusal(capsys, path, "--out", tmp_path / "out")
    assert mapped(path, tmp_path / "out", "--raw")["vertices"] == 2


@pytest.mark.parametrize(
    ("topic", "reason"),
    [
        ("/scan", "no sensor_msgs/msg/PointCloud2 on topic /sweep_cloud; topics in it: /imu/data (sensor_msgs/msg/Imu), /joint_states"),
        ("/joint_states", "no sensor_msgs/msg/JointState on topic /joint_states; topics in it: /imu/data (sensor_msgs/msg/Imu), /scan"),
        ("/imu/data", "no sensor_msgs/msg/Imu on topic /imu/data; topics in it: /joint_states (sensor_msgs/msg/JointState), /scan"),
        ("/wheel_odom", "no nav_msgs/msg/Odometry on topic /wheel_odom; topics in it: /imu/data"),
    ],
)
def test_what_is_missing_is_named(tmp_path: Path, drive: raw.Messages, capsys: pytest.CaptureFixture[str], topic: str, reason: str) -> None:
    path = raw.write_ros1(robot_beside(tmp_path) / "run.bag", [message for message in drive if message[0] != topic])
    assert reason in refusal(capsys, path, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_robot_is_needed_and_must_not_contradict_its_description(tmp_path: Path, one_bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "run.bag"
    shutil.copy(one_bag, path)
    assert "--robot FILE.yaml has to say how the sensors are mounted" in refusal(capsys, path, "--out", tmp_path / "out")
    robot_beside(tmp_path)
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(robot_mapping(RobotBody()) | {"length_m": 3.0}))
    assert "contradicts" in refusal(capsys, path, "--out", tmp_path / "out")


def test_description_is_read_as_its_declaration_says_or_named(tmp_path: Path, one_bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robot_beside(tmp_path)
    path, text = (
        tmp_path / "run.bag",
        (tmp_path / DESCRIPTION).read_text().partition("?>")[2].replace('<robot name="', '<robot name="prüfstand_'),
    )
    for encoding in ("ISO-8859-1", "UTF-16", "UTF-8"):
        (tmp_path / DESCRIPTION).write_bytes(f'<?xml version="1.0" encoding="{encoding}"?>{text}'.encode(encoding))
        assert "prüfstand" in robot_of(path, None, "").urdf
    shutil.copy(one_bag, path)
    (tmp_path / DESCRIPTION).write_bytes(f'<?xml version="1.0"?>{text}'.encode("ISO-8859-1"))
    for tool, words in ((map_bag, [path, "--out"]), (calibrate_mount, ["--from", path, "--out"])):
        assert tool.main([*map(str, words), str(tmp_path / "out")]) == 2
        said = capsys.readouterr().err
        assert f"{tmp_path / DESCRIPTION} cannot be read: not well-formed" in said and said.count("\n") == 1


def test_messages_that_cannot_be_used_are_counted_with_the_reason(
    tmp_path: Path, drive: raw.Messages, capsys: pytest.CaptureFixture[str]
) -> None:
    messages = [(topic, kind, replace(m, header=replace(m.header, frame_id="hokuyo"))) for topic, kind, m in drive]
    text = refusal(capsys, raw.write_ros1(robot_beside(tmp_path) / "run.bag", messages), "--out", tmp_path / "out")
    assert "no sweep came out" in text and "frame 'hokuyo', the robot's laser is 'laser': mounts/laser/frame of robot.yaml" in text


def test_mount_that_does_not_come_to_rest_is_told_how_its_nods_become_sweeps(
    tmp_path: Path, drive: raw.Messages, capsys: pytest.CaptureFixture[str]
) -> None:
    path = raw.write_ros1(robot_beside(tmp_path) / "run.bag", drive)
    text = refusal(capsys, path, "--out", tmp_path / "out", "--set", "max_duration_s=3.0")
    assert "2 x sweep_too_long (of a mount that nods: --set windows=turning_points, or the finished clouds of the bag)" in text


def test_raw_recording_of_a_fixed_lidar_is_told_what_is_mapped_of_it(
    tmp_path: Path, drive: raw.Messages, capsys: pytest.CaptureFixture[str]
) -> None:
    fixed = load_robot(Path(__file__).parents[3] / "config/robots/husky_vlp16.yaml")
    path = raw.write_ros1(robot_beside(tmp_path, fixed) / "run.bag", drive)
    text = refusal(capsys, path, "--out", tmp_path / "out")
    assert "no joint tilts laser" in text and "/sweep_cloud" in text and "without --raw" in text
    assert not (tmp_path / "out").exists()


def test_joint_states_without_positions_are_counted(tmp_path: Path, drive: raw.Messages, capsys: pytest.CaptureFixture[str]) -> None:
    messages = [(topic, kind, replace(m, position=np.zeros(0)) if topic == "/joint_states" else m) for topic, kind, m in drive]
    text = refusal(capsys, raw.write_ros1(robot_beside(tmp_path) / "run.bag", messages), "--out", tmp_path / "out")
    assert "messages of /joint_states left out" in text and f"names {raw.TILT_JOINT} and has no position of it" in text


def test_bag_that_was_cut_gives_the_sweep_that_it_holds(tmp_path: Path, one_bag: Path) -> None:
    cut = robot_beside(tmp_path) / "cut.bag"
    cut.write_bytes(one_bag.read_bytes()[: int(0.7 * one_bag.stat().st_size)])
    assert map_bag.main([str(cut), "--out", str(tmp_path / "out"), "--quiet"]) == 1
    summary = json.loads((tmp_path / "out" / map_bag.SUMMARY).read_text())
    assert summary["vertices"] == 1 and "breaks off" in summary["problems"][0]


@pytest.mark.parametrize("suffix", [".db3", ".mcap"])
def test_file_that_is_no_ros_2_bag_is_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"run{suffix}"
    path.write_bytes(b"no bag" * 100)
    with pytest.raises(ValueError, match="not a ROS 2 bag that can be read"):
        Recording([path])


def remounted(drive: raw.Messages, R_base_imu: np.ndarray, frame: str = raw.HUSKY.mount("imu").frame, unit: float = 1.0) -> raw.Messages:
    """The drive with its IMU in another attitude; `unit`: m/s^2 in the unit of its accelerations."""

    def turned(message: Any) -> Any:
        force = message.linear_acceleration
        x, y, z = R_base_imu.T @ [force.x, force.y, force.z] / unit
        return replace(message, header=replace(message.header, frame_id=frame), linear_acceleration=replace(force, x=x, y=y, z=z))

    return [(topic, kind, turned(m) if topic == "/imu/data" else m) for topic, kind, m in drive]


def test_imu_in_any_attitude_maps_as_a_level_one(tmp_path: Path, one_map: Path, drive: raw.Messages) -> None:
    rpy = (np.pi, 0.0, np.pi / 2)
    robot_beside(tmp_path)
    level, turned = (
        '<origin xyz="0 0 0.10"/>\n  </joint>\n  <link name="imu_link">',
        f'<origin xyz="0 0 0.10" rpy="{rpy[0]} {rpy[1]} {rpy[2]}"',
    )
    text = (tmp_path / DESCRIPTION).read_text()
    assert level in text
    (tmp_path / DESCRIPTION).write_text(text.replace(level, level.replace('<origin xyz="0 0 0.10"', turned)))
    messages = remounted(drive, transform_from_rpy((0.0, 0.0, 0.0), rpy)[:3, :3])
    assert mapped(raw.write_ros1(tmp_path / "run.bag", messages), tmp_path / "out")["notes"] == []
    np.testing.assert_allclose(trajectory(tmp_path / "out"), trajectory(one_map), atol=1e-6)


def test_imu_s_frame_may_be_told_by_tf_static(tmp_path: Path, one_map: Path, drive: raw.Messages) -> None:
    told = raw.Drivers(raw.ROS1).static("base_link", "/xsens", (1.0, 0.0, 0.0, 0.0))
    messages = remounted(drive, np.diag([1.0, -1.0, -1.0]), frame="xsens")
    path = raw.write_ros1(robot_beside(tmp_path) / "run.bag", [("/tf_static", "tf2_msgs/msg/TFMessage", told), *messages])
    assert mapped(path, tmp_path / "out")["notes"] == []
    np.testing.assert_allclose(trajectory(tmp_path / "out"), trajectory(one_map), atol=1e-6)


@pytest.mark.parametrize(
    ("R_base_imu", "frame", "unit", "reason"),
    [
        (np.eye(3), "imu_link", raw.GRAVITY, "the IMU feels 1.00 m/s^2, gravity is 9.81: it is in g; let the driver publish m/s^2"),
        (np.diag([1.0, -1.0, -1.0]), "imu_link", 1.0, "the IMU is upside down: as imu_link is mounted"),
        (np.eye(3), "xsens", 1.0, "where frame 'xsens' is mounted is not known"),
    ],
)
def test_imu_that_cannot_be_right_is_refused_with_its_line(
    tmp_path: Path, drive: raw.Messages, capsys: pytest.CaptureFixture[str], R_base_imu: np.ndarray, frame: str, unit: float, reason: str
) -> None:
    path = raw.write_ros1(robot_beside(tmp_path) / "run.bag", remounted(drive, R_base_imu, frame, unit))
    text = refusal(capsys, path, "--out", tmp_path / "out")
    assert reason in text and "messages of /imu/data left out" in text


def test_imu_that_goes_wrong_on_the_way_is_told_in_one_line(tmp_path: Path, drive: raw.Messages) -> None:
    begin, after = drive[:-400], drive[-400:]
    messages = [*begin, *remounted(after, np.eye(3), "xsens")]
    summary = mapped(raw.write_ros1(robot_beside(tmp_path) / "run.bag", messages), tmp_path / "out")
    (note,) = summary["notes"]
    assert note.endswith("it") and "messages of /imu/data left out, the last one: where frame 'xsens' is mounted is not known" in note


OFF = TiltCalibration(offset_rad=0.01, scale=1.005, covariance=np.diag([1e-8, 1e-8, np.inf, np.inf, np.inf]))


@pytest.fixture(scope="session")
def off_bag(tmp_path_factory: pytest.TempPathFactory, drive: raw.Messages) -> Path:
    """The drive of a mount that tells tilts which are `OFF`."""

    def told(message: Any) -> Any:
        return replace(message, position=(message.position - OFF.offset_rad) / OFF.scale)

    messages = [(topic, kind, told(m) if topic == "/joint_states" else m) for topic, kind, m in drive]
    return raw.write_ros1(robot_beside(tmp_path_factory.mktemp("off")) / "run.bag", messages)


def worst_off_walls_m(out: Path) -> float:
    points = SessionStore(out).load_sweep(0).points
    return float(np.minimum(np.abs(points - raw.ROOM_LOW), np.abs(points - raw.ROOM_HIGH)).min(axis=1).max())


def test_calibration_of_the_mount_is_applied(tmp_path: Path, off_bag: Path) -> None:
    mapped(off_bag, tmp_path / "described")
    assert worst_off_walls_m(tmp_path / "described") > 0.03
    write_calibration(OFF, tmp_path / "mine.yaml")
    mapped(off_bag, tmp_path / "named", "--mount-calibration", str(tmp_path / "mine.yaml"))
    assert worst_off_walls_m(tmp_path / "named") < 0.02


def test_calibration_that_the_run_left_beside_its_robot_is_applied_unless_none_is_wanted(tmp_path: Path, off_bag: Path) -> None:
    beside = robot_beside(tmp_path)
    shutil.copy(off_bag, beside / "run.bag")
    write_calibration(OFF, beside / RECORDED_FILE)
    mapped(beside / "run.bag", tmp_path / "out")
    assert worst_off_walls_m(tmp_path / "out") < 0.02
    mapped(beside / "run.bag", tmp_path / "described", "--mount-calibration", "")
    assert worst_off_walls_m(tmp_path / "described") > 0.03


def test_calibration_that_is_none_is_refused(tmp_path: Path, off_bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [off_bag, "--out", tmp_path / "out", "--mount-calibration", tmp_path / "none.yaml"]
    assert "none.yaml cannot be read: No such file or directory" in refusal(capsys, *words)
    (tmp_path / "none.yaml").write_text("offset_rad: 0.1\n")
    assert "none.yaml: has no section mount_calibration" in refusal(capsys, *words)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("words", [("--mount", 0, 0, 1, 0, 0, 0), ("--sensor", 0, 0, 0)], ids=lambda words: words[0])
def test_option_for_finished_clouds_is_refused(
    tmp_path: Path, off_bag: Path, capsys: pytest.CaptureFixture[str], words: tuple[object, ...]
) -> None:
    said = refusal(capsys, off_bag, "--out", tmp_path / "out", *words)
    assert f"{words[0]}: has no effect on messages of the drivers" in said and not (tmp_path / "out").exists()


def test_mount_is_calibrated_from_the_sweeps_of_a_recording(tmp_path: Path, off_bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert calibrate_mount.main(["--from", str(off_bag), "--out", str(tmp_path / "found.yaml")]) == 0
    assert "tilt offset" in capsys.readouterr().out
    found = read_calibration(tmp_path / "found.yaml")
    assert found.offset_rad == pytest.approx(OFF.offset_rad, abs=np.radians(0.05))
    assert found.scale == pytest.approx(OFF.scale, abs=1e-3)
    assert abs(found.mount_roll_rad) < np.radians(0.05) and found.backlash_rad < np.radians(0.05)


def test_recording_without_what_calibrates_is_refused(tmp_path: Path, drive: raw.Messages, capsys: pytest.CaptureFixture[str]) -> None:
    path = raw.write_ros1(robot_beside(tmp_path) / "run.bag", [message for message in drive if message[0] != "/scan"])
    for recording, reason in ((path, "no sensor_msgs/msg/LaserScan on topic /scan"), (tmp_path / "none.bag", "no such bag or folder")):
        assert calibrate_mount.main(["--from", str(recording), "--out", str(tmp_path / "found.yaml")]) == 2
        text = capsys.readouterr().err
        assert text.startswith("./calibrate_mount: ") and text.count("\n") == 1 and reason in text
    assert not (tmp_path / "found.yaml").exists()


def spun(reads: Callable[[float], bool], until_s: float) -> list[MeasuredSweep | Unreadable]:
    """What comes of a spinning lidar on a mount that sweeps from 2.5 to 3.8 s, where it reads only at some times."""

    def tilt(t: float) -> float:
        return float(np.interp(t, [2.0, 2.5, 3.8, 4.0], [0.0, 0.8, -0.61, 0.0]))

    config = SensorConfig(lidar=LIDAR, assembly=SweepAssemblyConfig(stray_neighbours=0))
    chain = SensorChain(config, RobotBody(), TILT, lambda _: np.eye(3), spinning=True)
    found = list[MeasuredSweep | Unreadable]()
    for k in range(round((until_s - 1.5) / 0.03)):
        t = round(1.5 + 0.03 * k, 6)
        chain.add_joint(t, tilt(t))
        chain.add_pose(Pose(t, transform_from_rpy((0.01 * t, 0.0, 0.0)), np.eye(6)))
        if k % 4 == 0 and reads(t):
            t = 1.5 + 0.1 * (k // 4)
            chain.add_reading(t, revolution(t, lambda t: transform_from_rpy((0.01 * t, 0.0, 0.0)), tilt))
        found += list(chain.poll())
    return found


def test_spinning_lidar_s_sweep_comes_out_with_odometry_at_its_stamp() -> None:
    (one,) = spun(lambda _: True, 5.1)
    assert isinstance(one, MeasuredSweep)
    assert one.sweep.stamp_s == pytest.approx(4.0, abs=0.04) and len(one.sweep.points) > 3000
    assert one.T_odom_base[0, 3] == pytest.approx(0.01 * one.sweep.stamp_s)


def test_sweep_that_ends_when_its_odometry_is_forgotten_is_unreadable() -> None:
    """A lidar that is silent for longer than poses are known."""
    (one,) = spun(lambda t: not 4.3 < t < 40.0, 60.0)
    assert isinstance(one, Unreadable) and one.stamp_s == pytest.approx(4.0, abs=0.04) and "lie outside the poses" in one.reason
