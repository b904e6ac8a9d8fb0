"""Looks at a running robot for a while without a word or a motion, and judges every input that the nodes need."""

import time

import numpy as np
import rospy
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from sensor_msgs.msg import Imu, JointState, LaserScan, PointCloud2

from point_cloud2 import read_beams
from robot_body import RobotBody, contradictions, fixed_laser_problem, laser_mount
from ros_adapters.conversions import joint_position, odometry_twist, planar_pose, stamp_of
from ros_adapters.heard_topic import HeardTopic
from ros_adapters.mapping_mode import DRIVING
from ros_adapters.robot_graph import RobotGraph, TransformWatch
from ros_adapters.sensor_frames import SensorFrames
from sensor_checks import NEEDS, CheckLimits, ImuLimits, Level, Row, clock_rows, timing_rows
from sensor_checks.contents import (
    ScanLayout,
    frame_row,
    imu_rows,
    points_rows,
    scan_rows,
    senders_row,
    stands,
    tilt_rows,
    twist_rows,
    wheel_rows,
)
from sensor_checks.lidar import lidar_rows
from sensor_checks.wheel_twist import Pose
from sweep_assembly import LidarConfig, Revolution

Floats = NDArray[np.float64]
_POLL_S = 0.05
_CLOUDS = 10  # as many tell of layout and units


class RobotCheck:
    """Subscribes when it is made; then `wait`, `look`, `rows`."""

    def __init__(
        self, robot: RobotBody, urdf: str, sensor: str, mapping: str, limits: tuple[CheckLimits, ImuLimits], lidar: LidarConfig
    ) -> None:
        """`urdf`: the text of the robot's description, `sensor` and `mapping` as in the launch file. ValueError when it cannot be read."""
        self._robot, self._urdf, (self._limits, self._imu_limits), self._lidar = robot, urdf, limits, lidar
        self._frames = SensorFrames(robot, urdf)
        self._laser_frame = robot.mount("laser").frame
        try:
            joint, self._joint_fault = laser_mount(urdf, robot.mount("laser"))[0], ""
        except ValueError as error:
            joint, self._joint_fault = "", str(error)
        self._sensor, self._mapping, spinning = sensor, mapping, sensor == "spinning"
        self._scan = HeardTopic("scan", LaserScan, _scan_content, duration_of=_scan_duration_s) if not spinning else None
        self._points = HeardTopic("points", PointCloud2, _revolution, _CLOUDS, _turn_s) if spinning else None
        self._joint = joint or ""
        self._tilt = None if joint is None else HeardTopic("joint_states", JointState, self._tilt_of)
        self._imu = HeardTopic("imu/data", Imu, _imu_content)
        self._wheels = HeardTopic("wheel_odom", Odometry, _wheel_content)
        self._tf = TransformWatch(self._frames)
        self._looked_s = 0.0

    @property
    def _watches(self) -> list[HeardTopic]:
        return [watch for watch in (self._scan, self._points, self._tilt, self._imu, self._wheels) if watch]

    def _tilt_of(self, message: JointState) -> float | None:
        """The tilt; None in a message about other joints. ValueError when it has no position."""
        if self._joint not in message.name:
            return None
        return joint_position(message, self._joint)

    def wait(self, timeout_s: float) -> None:
        """Until every input has come, and start_sweep is served where a joint tilts the laser, at most so long."""
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline and not rospy.is_shutdown():
            swept = self._tilt is None or rospy.resolve_name("start_sweep") in RobotGraph().services
            if swept and all(watch.heard for watch in self._watches):
                return
            time.sleep(10 * _POLL_S)

    def look(self, seconds: float) -> None:
        """Listens for so long, by the clock of the robot if that is simulated, at most ten times as long by that of the wall."""
        for watch in self._watches:
            watch.forget()
        begun_s, started = rospy.get_time(), time.monotonic()
        simulated = bool(rospy.get_param("/use_sim_time", False))
        while not rospy.is_shutdown():
            wall_s = time.monotonic() - started
            self._looked_s = rospy.get_time() - begun_s if simulated and rospy.get_time() > begun_s else wall_s
            if self._looked_s >= seconds or wall_s >= 10.0 * seconds or (simulated and wall_s >= seconds and not rospy.get_time()):
                break
            time.sleep(_POLL_S)
        self._tf.stop()
        for watch in self._watches:
            watch.stop()

    def rows(self) -> list[Row]:
        """All answers, input by input."""
        graph = RobotGraph()
        rows = self._clock() + self._laser(graph) + self._of_tilt(graph) + self._of_imu(graph) + self._of_wheels(graph)
        laser = self._scan or self._points
        tilt = (self._tilt.topic, laser.topic) if self._tilt and laser else None
        rows += clock_rows({watch.topic: watch.heard for watch in self._watches if self._stamped(watch)}, self._limits, tilt)
        if self._tilt is not None:
            rows += [graph.service_row("start_sweep", "std_srvs/Trigger", "one sweep, ending level")]
        if self._tilt is not None and self._mapping == DRIVING:
            what = "nod in front of the robot, or come to rest level; without it, map with mapping:=stop_and_go"
            rows += [graph.service_row("nod", "std_srvs/SetBool", what)]
        rows += [*graph.command_rows("cmd_vel"), *self._tf.rows()]
        return rows + self._description()

    @staticmethod
    def _stamped(watch: HeardTopic) -> bool:
        return bool(watch.heard) and all(h.stamp_s > 0.0 for h in watch.heard)

    def _clock(self) -> list[Row]:
        if not rospy.get_param("/use_sim_time", False):
            return []
        clock = rospy.resolve_name("/clock")
        if rospy.get_time() > 0.0:
            return [Row(Level.OK, clock, "time", "simulated")]
        return [Row(Level.ERROR, clock, "time", f"/use_sim_time is true, and no {clock} comes", "rosparam set /use_sim_time false")]

    def _timing(self, watch: HeardTopic, needed: str, graph: RobotGraph) -> list[Row]:
        if not watch.heard:
            return graph.silence_rows(watch.topic, watch.type_name, watch.other_messages)
        rows = timing_rows(watch.topic, watch.heard, NEEDS[needed], self._looked_s, self._limits)
        advice = "such messages are dropped; docs/sensors.md has what is read"
        return rows + [Row(Level.ERROR, watch.topic, "message", f"{n} x {text}", advice) for text, n in sorted(watch.faults.items())[:3]]

    def _laser(self, graph: RobotGraph) -> list[Row]:
        watch = self._scan or self._points
        assert watch is not None
        rows = self._timing(watch, "points" if self._points else "scan", graph)
        if watch.heard:
            rows.append(frame_row(watch.topic, watch.frames, self._laser_frame))
        if self._scan and self._scan.contents:
            layouts, ranges = zip(*self._scan.contents, strict=True)
            rows += scan_rows(watch.topic, layouts, ranges, self._limits)
        if self._points and self._points.contents:
            rows += self._of_turns(self._points.topic, self._points.contents, np.array([h.stamp_s for h in self._points.heard]))
        return rows

    def _twists(self) -> Floats:
        """(N, 2) m/s and rad/s of the wheels' messages."""
        return np.array([twist for _, _, twist in self._wheels.contents]).reshape(-1, 2)

    def _of_turns(self, topic: str, turns: list[Revolution], stamps_s: Floats) -> list[Row]:
        points, rings = [turn.points.astype(np.float64) for turn in turns], np.concatenate([turn.rings for turn in turns])
        rows = points_rows(topic, points, [turn.times_s for turn in turns], len(np.unique(rings)), self._limits)
        return rows + lidar_rows(topic, stamps_s, (np.vstack(points), rings), self._lidar.elevations, self._lidar.rate_hz)

    def _of_tilt(self, graph: RobotGraph) -> list[Row]:
        if self._tilt is None:
            return [self._of_fixed()]
        rows = self._timing(self._tilt, "joint_states", graph)
        if self._joint_fault:
            return [*rows, Row(Level.ERROR, "robot_description", "tilt", self._joint_fault, "give the laser one joint that tilts about y")]
        if self._tilt.heard or self._tilt.other_messages:
            rows += tilt_rows(self._tilt.topic, np.array(self._tilt.contents), self._joint, self._limits)
        if self._tilt.senders:
            rows.append(senders_row(self._tilt.topic, self._tilt.senders, self._joint))
        return rows

    def _of_fixed(self) -> Row:
        if problem := fixed_laser_problem(self._robot, self._sensor, self._mapping):
            return Row(Level.ERROR, "robot_description", "tilt", problem, "or give the laser one joint that tilts about y")
        return Row(Level.OK, "robot_description", "tilt", "the lidar is fixed")

    def _of_imu(self, graph: RobotGraph) -> list[Row]:
        rows, topic = self._timing(self._imu, "imu/data", graph), self._imu.topic
        samples = np.array([(*gyro, *accel) for _, gyro, accel in self._imu.contents]).reshape(-1, 6)
        standing = stands(self._twists())
        for frame in sorted(self._imu.frames):
            own = samples[[content[0] == frame for content in self._imu.contents]]
            try:
                R = self._frames.rotation_in_base(frame.lstrip("/"))
            except ValueError as error:
                rows.append(
                    Row(Level.ERROR, topic, "frame", repr(frame), f"{error}; set the driver's frame_id, or add the frame to the URDF")
                )
                continue
            rows.append(Row(Level.OK, topic, "frame", repr(frame)))
            rows += imu_rows(topic, own[:, :3] @ R.T, own[:, 3:] @ R.T, frame, standing, self._imu_limits)
        return rows

    def _of_wheels(self, graph: RobotGraph) -> list[Row]:
        rows = self._timing(self._wheels, "wheel_odom", graph)
        if self._wheels.contents:
            rows += wheel_rows(self._wheels.topic, self._twists(), self._robot)
            rows += twist_rows(self._wheels.topic, self._wheels.contents)
        return rows

    def _description(self) -> list[Row]:
        found = contradictions(self._robot, self._urdf)
        advice = "correct robot.yaml or the URDF; ./check_robot --robot FILE looks with another"
        rows = [Row(Level.ERROR, "robot.yaml", "against the URDF", text, advice) for text in found]
        return rows or [Row(Level.OK, "robot.yaml", "against the URDF", f"{self._robot.name}: the two agree")]


def _scan_content(message: LaserScan) -> tuple[ScanLayout, Floats]:
    layout = ScanLayout(
        message.angle_min, message.angle_increment, message.time_increment, len(message.ranges), message.range_min, message.range_max
    )
    return layout, np.asarray(message.ranges, dtype=np.float64)


def _revolution(message: PointCloud2) -> Revolution:
    return Revolution.of(read_beams(message, stamp_of(message)))


def _scan_duration_s(content: tuple[ScanLayout, Floats]) -> float:
    layout = content[0]
    duration_s = layout.time_increment * (layout.count - 1)
    return duration_s if 0.0 < duration_s < 1.0 else 0.0  # what is no duration has a row of its own


def _turn_s(turn: Revolution) -> float:
    end_s = float(turn.times_s.max(initial=0.0))
    return end_s if end_s < 1.0 else 0.0


def _wheel_content(message: Odometry) -> tuple[float, Pose, tuple[float, float]]:
    return stamp_of(message), planar_pose(message), odometry_twist(message)


def _imu_content(message: Imu) -> tuple[str, tuple[float, ...], tuple[float, ...]]:
    gyro, accel = message.angular_velocity, message.linear_acceleration
    return message.header.frame_id, (gyro.x, gyro.y, gyro.z), (accel.x, accel.y, accel.z)
