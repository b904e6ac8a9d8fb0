"""Units and layouts of what messages say, both sides of each limit, and the table that shows the answers."""

import math

import numpy as np
import pytest

from robot_body import RobotBody
from sensor_checks import NEEDS, CheckLimits, ImuLimits, Level, Row, judged, table, worst
from sensor_checks.contents import ScanLayout, frame_row, imu_rows, points_rows, scan_rows, senders_row, stands, tilt_rows, wheel_rows
from sweep_assembly.assembly_config import SweepAssemblyConfig

LIMITS = CheckLimits()
UTM = ScanLayout(math.radians(-135), math.radians(0.25), 0.025 / 1440, 1081, 0.1, 30.0)


def test_what_passes_the_check_is_no_less_than_what_a_sweep_needs():
    assembly = SweepAssemblyConfig()
    assert LIMITS.level_rad <= assembly.horizontal_tolerance_rad
    assert NEEDS["joint_states"].max_gap_s <= assembly.max_joint_gap_s and NEEDS["wheel_odom"].max_gap_s <= assembly.max_odometry_gap_s


def by_question(found):
    return {row.asked: row for row in found}


def scan(ranges=2.0, **other):
    layout = ScanLayout(**{**UTM.__dict__, **other})
    return by_question(scan_rows("/scan", [layout], [np.broadcast_to(np.asarray(ranges, float), layout.count)], LIMITS))


def test_right_scan_is_ok_and_says_what_it_is():
    found = scan()
    assert worst([*found.values()]) is Level.OK
    assert found["layout"].found == "1081 beams, 0.250 deg apart, over 270 deg"
    assert found["beam times"].found == "18.8 ms a scan"


@pytest.mark.parametrize(
    "other, asked, level, said",
    [
        ({"angle_increment": 0.25}, "layout", Level.ERROR, "degrees"),
        ({"angle_increment": math.radians(0.333)}, "layout", Level.OK, ""),
        ({"angle_increment": 0.0}, "layout", Level.ERROR, "two beams"),
        ({"count": 1}, "layout", Level.ERROR, "two beams"),
        ({"time_increment": 0.0}, "beam times", Level.WARN, "time_increment is 0"),
        ({"time_increment": 0.017}, "beam times", Level.ERROR, "not in seconds"),
        ({"time_increment": -1e-5}, "beam times", Level.ERROR, "zero or more"),
        ({"ranges": 2000.0, "range_max": 30000.0}, "ranges", Level.ERROR, "millimetres"),
        ({"ranges": 1500.0}, "ranges", Level.ERROR, "millimetres"),
        ({"range_max": 0.0}, "ranges", Level.ERROR, "above range_min"),
        ({"ranges": 0.0}, "ranges", Level.ERROR, "sees nothing"),
        ({"ranges": math.inf}, "ranges", Level.ERROR, "sees nothing"),
        ({"ranges": math.nan}, "ranges", Level.ERROR, "sees nothing"),
        ({"ranges": np.where(np.arange(1081) % 20, math.inf, 3.0)}, "ranges", Level.OK, ""),
    ],
)
def test_scan_s_faults(other, asked, level, said):
    row = scan(**other)[asked]
    assert row.level is level and said in row.advice


def test_beams_that_vary_are_told():
    layouts = [UTM, ScanLayout(**{**UTM.__dict__, "count": 1079})]
    assert by_question(scan_rows("/scan", layouts, [np.full(1081, 2.0), np.full(1079, 2.0)], LIMITS))["layout"].found.startswith(
        "1079 to 1081"
    )


def points(scale=1.0, times=(0.0, 0.1)):
    cloud = scale * np.tile([3.0, 0.0, 0.5], (100, 1))
    return by_question(points_rows("/points", [cloud], [np.linspace(*times, 100)], 16, LIMITS))


@pytest.mark.parametrize(
    "found, asked, level",
    [
        (points(), "ranges", Level.OK),
        (points(), "beam times", Level.OK),
        (points(1000.0), "ranges", Level.ERROR),
        (points(math.nan), "ranges", Level.ERROR),
        (points(times=(0.0, 1e8)), "beam times", Level.ERROR),
        (points(times=(0.0, 0.0)), "beam times", Level.WARN),
        (points(times=(-0.1, 0.0)), "beam times", Level.WARN),
    ],
)
def test_points(found, asked, level):
    assert found[asked].level is level


def turns(*counts):
    clouds = [np.tile([3.0, 0.0, 0.5], (count, 1)) for count in counts]
    return by_question(points_rows("/points", clouds, [np.linspace(0.0, 0.1, count) for count in counts], 16, LIMITS))


def test_revolution_without_beams_is_passed_over_among_others():
    found = turns(100, 0, 100)
    assert worst([*found.values()]) is Level.OK and found["ranges"].found.startswith("100 % of 100 beams")


def test_revolutions_that_are_all_without_beams_say_that_the_lidar_sees_nothing():
    (row,) = turns(0, 0).values()
    assert row.level is Level.ERROR and "the lidar sees nothing" in row.advice and "nan" not in row.found


def test_scan_without_beams_is_passed_over_among_others():
    layouts = [ScanLayout(**{**UTM.__dict__, "count": count}) for count in (0, UTM.count)]
    assert worst(scan_rows("/scan", layouts, [np.full(layout.count, 2.0) for layout in layouts], LIMITS)) is Level.OK
    assert by_question(scan_rows("/scan", layouts[:1], [np.zeros(0)], LIMITS))["layout"].level is Level.ERROR


def imu(gyro=0.0, accel=9.81, standing=True, noise=0.003):
    rng = np.random.default_rng(0)
    rates, forces = rng.normal(0.0, noise, (500, 3)) + [0.0, 0.0, gyro], rng.normal(0.0, noise, (500, 3)) + [0.0, 0.0, accel]
    return by_question(imu_rows("/imu", rates, forces, "imu_link", standing, ImuLimits()))


def test_imu():
    assert {row.level for row in imu().values()} == {Level.OK}
    assert imu(accel=1.0)["gravity"].level is Level.ERROR
    assert imu(gyro=0.04)["turning"].level is Level.OK
    assert imu(gyro=0.06)["turning"].level is Level.ERROR
    assert "turning" not in imu(gyro=0.06, standing=False)
    assert imu(noise=0.0)["noise"].level is Level.WARN
    assert imu(accel=math.nan)["values"].level is Level.ERROR


@pytest.mark.parametrize(
    "tilts, level, said",
    [
        ([0.002, 0.003], Level.OK, ""),
        ([40.0], Level.ERROR, "degrees"),
        ([0.2, 0.2], Level.ERROR, "no sweep ends"),
        ([0.03, 0.03], Level.ERROR, "horizontal_tolerance_rad"),
        ([0.0, 0.0, 0.4], Level.WARN, "mount moves"),
        ([math.nan], Level.ERROR, "driver"),
        ([], Level.ERROR, "must publish tilt_joint"),
    ],
)
def test_tilt(tilts, level, said):
    (row,) = tilt_rows("/joint_states", np.array(tilts), "tilt_joint", LIMITS)
    assert row.level is level and said in row.advice


def test_joint_of_two_senders_is_an_error_that_names_both():
    assert senders_row("/joint_states", {"/mount"}, "tilt_joint").level is Level.OK
    row = senders_row("/joint_states", {"/mount", "/joint_state_publisher"}, "tilt_joint")
    assert row.level is Level.ERROR and row.found == "tilt_joint by /joint_state_publisher, /mount"


@pytest.mark.parametrize(
    "velocity, level",
    [
        ((0.0, 0.0), Level.OK),
        ((0.5, 0.0), Level.WARN),
        ((0.0, 0.1), Level.WARN),
        ((500.0, 0.0), Level.ERROR),
        ((math.nan, 0.0), Level.ERROR),
    ],
)
def test_wheels(velocity, level):
    (row,) = wheel_rows("/wheel_odom", np.array([velocity]), RobotBody())
    assert row.level is level


def test_robot_whose_wheels_are_silent_is_not_known_to_stand():
    assert not stands(np.zeros((0, 2))) and stands(np.zeros((3, 2)))


def test_frames():
    assert frame_row("/scan", {"/laser"}, "laser").level is Level.OK
    assert frame_row("/scan", {"laser", "other"}, "laser").level is Level.ERROR


def test_first_fault_that_holds_is_the_answer():
    row = judged("/a", "b", "c", (False, Level.ERROR, "no"), (True, Level.WARN, "yes"), (True, Level.ERROR, "late"))
    assert (row.level, row.advice) == (Level.WARN, "yes")


def test_table_has_a_line_a_row_and_one_of_advice():
    shown = table([Row(Level.OK, "/scan", "rate", "40.0 Hz"), Row(Level.ERROR, "/imu/data", "gravity", "1.00 m/s^2", "it is in g")])
    assert shown.splitlines() == [
        "ok     /scan      rate     40.0 Hz",
        "ERROR  /imu/data  gravity  1.00 m/s^2",
        "       -> it is in g",
    ]
    assert worst([]) is Level.ERROR, "who asked nothing knows nothing"
