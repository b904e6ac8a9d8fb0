"""Whole run folders: a perfect one, and every way in which one is incomplete or wrong."""

import json
from dataclasses import replace

import numpy as np
import open3d as o3d
import pytest
import yaml
from hand_made_worlds import room
from run_folder_on_disk import CONTACTS_HEADER, T_WORLD_MAP, WORLD, true_poses, write_run, write_tum

from exploration_evaluation import RobotShape, evaluate_run, format_summary, read_contacts, read_trajectory, write_json
from exploration_evaluation.__main__ import main
from exploration_evaluation.run_files import read_robot
from rigid_geometry import transform_points
from robot_body import RobotBody, load_robot, robot_file, robot_mapping, urdf_file

DESIGNED_KEYS = [
    "success",
    "stop_reason",
    "sim_time_s",
    "wall_time_s",
    "distance_m",
    "sweeps",
    "loop_closures",
    "local_classifications",
    "local_classification_time_s",
    "global_classifications",
    "global_classification_time_s",
    "coverage",
    "map_rmse_m",
    "trajectory_ate_m",
    "collisions",
    "max_tilt_rad",
    "config",
    "version",
    "trajectory_origin_error_m",
    "map_tilt_rad",
]


@pytest.fixture
def run(tmp_path):
    return write_run(tmp_path)


def test_perfect_run_gets_the_scores_known_beforehand(run):
    summary = evaluate_run(run, *WORLD)
    assert summary["success"] is True
    assert summary["missing"] == []
    assert (summary["coverage"], summary["coverage_straight"], summary["missed_piece_m2"]) == (1.0, 1.0, 0.0)
    assert summary["faults"] == []
    assert summary["reachable_straight_m2"] == pytest.approx(16.0, rel=0.01)  # the outline reaches into all but the corners
    assert summary["turning_area_m2"] == pytest.approx((4 - 2 * RobotShape().circumscribed_radius_m) ** 2, rel=1e-4)
    assert summary["distance_m"] == pytest.approx(2.0)
    for key in ("map_rmse_m", "trajectory_ate_m", "trajectory_origin_error_m", "map_tilt_rad", "max_tilt_rad"):
        assert summary[key] == pytest.approx(0.0, abs=1e-5)
    assert (summary["collisions"], summary["fell"]) == (0, False)
    assert (summary["sweeps"], summary["something_else"]) == (5, 7)


def test_sweeps_of_an_earlier_run_that_went_on_in_this_one_are_not_counted(run):
    lines = (run / "events.csv").read_text().splitlines(keepends=True)
    (run / "events.csv").write_text("".join([lines[0], *lines[2:]]))  # begun a second later
    assert evaluate_run(run, *WORLD)["sweeps"] == 4


def test_sweeps_of_a_robot_that_maps_nothing_are_as_reported(run):
    for name, more in (("run.json", {"mapping": "off"}), ("counters.json", {"sweeps": 9})):
        (run / name).write_text(json.dumps(json.loads((run / name).read_text()) | more))
    assert evaluate_run(run, *WORLD)["sweeps"] == 9


def test_perfect_run_gets_the_scores_over_its_course_known_beforehand(run):
    summary = evaluate_run(run, *WORLD)
    assert [point["coverage"] for point in summary["coverage_curve"]] == [1.0] * 5
    assert [point["time_s"] for point in summary["coverage_curve"]] == pytest.approx([0, 1, 2, 3, 4])
    assert [point["distance_m"] for point in summary["coverage_curve"]] == pytest.approx([0, 0.5, 1.0, 1.5, 2.0])
    assert (summary["rpe_translation_m"], summary["rpe_rotation_rad"]) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert summary["wrong_edges"] == 0
    assert 2.0 <= summary["shortest_length_m"] <= 2.03
    assert summary["path_ratio"] == pytest.approx(1.0, abs=0.015)
    assert summary["activity_s"] == {"waiting": 0.0, "sweeping": 1.0, "mapping": 0.0, "driving": 3.0}
    assert (summary["compute_s"], summary["runtime_s"]) == pytest.approx((2.0, 302.5))


def test_summary_file_holds_what_is_returned_and_all_designed_keys(run):
    summary = evaluate_run(run, *WORLD)
    assert json.loads((run / "summary.json").read_text()) == summary
    assert set(DESIGNED_KEYS) <= set(summary)
    assert not list(run.glob(".summary*"))


@pytest.mark.parametrize(
    ("lost", "unknown", "known"),
    [
        ("trajectory_truth.txt", ["coverage", "trajectory_ate_m", "map_rmse_m", "distance_m", "fell", "success"], ["collisions"]),
        ("trajectory.txt", ["success", "sweeps", "coverage", "trajectory_ate_m", "map_rmse_m", "map_tilt_rad"], ["distance_m"]),
        ("contacts.csv", ["collisions", "success"], ["coverage", "fell"]),
        ("occupied.npz", ["coverage", "coverage_straight", "missed_piece_m2", "success"], ["map_rmse_m", "reachable_area_m2"]),
        ("cloud.ply", ["map_rmse_m", "map_p95_m"], ["coverage"]),
        ("counters.json", ["stop_reason", "sim_time_s", "success"], ["coverage", "sweeps"]),
        ("run.json", ["world", "seed", "config", "version", "coverage_curve"], ["coverage"]),
        ("events.csv", ["sweeps", "activity_s", "compute_s", "runtime_s"], ["coverage", "sim_time_s"]),
        ("sweeps/000002.npz", ["coverage_curve"], ["coverage", "path_ratio"]),
    ],
)
def test_lost_file_makes_unknown_just_what_depends_on_it(run, lost, unknown, known):
    (run / lost).unlink()
    summary = evaluate_run(run, *WORLD)
    assert [key for key in unknown if summary[key] is not None] == []
    assert [key for key in known if summary[key] is None] == []
    assert any(lost.rpartition("/")[2] in reason for reason in summary["missing"])


def test_success_is_unknown_without_contacts_but_no_success_without_a_saved_map(run):
    (run / "contacts.csv").unlink()
    assert evaluate_run(run, *WORLD)["success"] is None
    (run / "map.bt").unlink()
    assert evaluate_run(run, *WORLD)["success"] is False


def told_resolution(run, resolution):
    reported = json.loads((run / "run.json").read_text())
    reported["config"]["octomap_server_3dnav_node"]["resolution"] = resolution
    (run / "run.json").write_text(json.dumps(reported))


def test_voxels_have_the_size_that_the_run_tells(run):
    areas = {}
    for resolution in (0.08, 0.04, None):
        told_resolution(run, resolution)
        areas[resolution] = evaluate_run(run, *WORLD)["classification"]["false_safe_m2"]
    assert areas[0.04] == pytest.approx(areas[0.08] / 4) and areas[None] == areas[0.08] > 0.0


def without_truth_between(run, start_s, end_s):
    """As a monitor that is away for a while leaves it."""
    path = run / "trajectory_truth.txt"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(line for line in lines if not start_s < float(line.split()[0]) < end_s))


def test_touches_are_not_known_where_nobody_watched_for_longer_than_a_restart_takes(run):
    without_truth_between(run, 2.01, 2.49)  # ten ticks of the clock
    assert evaluate_run(run, *WORLD)["success"] is True
    without_truth_between(run, 2.01, 2.54)
    summary = evaluate_run(run, *WORLD)
    assert (summary["collisions"], summary["success"]) == (None, None)
    assert "collisions: nobody watched for 0.55 s of the run" in summary["missing"]


def test_touch_that_was_seen_counts_also_where_others_may_be_missed(run):
    without_truth_between(run, 2.01, 3.01)
    (run / "contacts.csv").write_text(CONTACTS_HEADER + "1.50,base_link,0.01,5\n")
    summary = evaluate_run(run, *WORLD)
    assert (summary["collisions"], summary["success"], summary["faults"]) == (1, False, ["collision"])


@pytest.mark.parametrize("reason", ["node terrain died", "stuck", "not explored"])
def test_other_stop_reason_is_no_success(run, reason):
    (run / "counters.json").write_text(json.dumps({"stop_reason": reason}))
    assert evaluate_run(run, *WORLD)["success"] is False


def test_contact_is_a_collision_with_its_speed_and_no_success(run):
    (run / "contacts.csv").write_text(CONTACTS_HEADER + "2.00,base_link,0.30,150\n2.05,base_link,0.10,90\n9.0,wheel,0.05,20\n")
    summary = evaluate_run(run, *WORLD)
    assert (summary["collisions"], summary["collision_top_speed_mps"], summary["collision_top_force_n"]) == (2, 0.30, 150.0)
    assert summary["success"] is False


def test_one_touch_is_no_success(run):
    (run / "contacts.csv").write_text(CONTACTS_HEADER + "2.00,base_link,0.01,5\n")
    summary = evaluate_run(run, *WORLD)
    assert (summary["collisions"], summary["success"], summary["faults"]) == (1, False, ["collision"])
    assert "FAILED  rooms, seed 1: explored, but 1 collision" in format_summary(summary)


def without_voxels_beyond(run, x_m):
    """Leaves out of the map what lies beyond an x of the world."""
    data = dict(np.load(run / "occupied.npz"))
    kept = transform_points(T_WORLD_MAP, data["centers"].astype(np.float64))[:, 0] < x_m
    np.savez(run / "occupied.npz", centers=data["centers"][kept], sizes=data["sizes"][kept])


def test_map_that_lacks_a_part_of_the_ground_is_no_success_and_the_headline_says_how_much(run):
    counters = json.loads((run / "counters.json").read_text())
    reason = "explored: no reachable frontier is left in the whole map; 4 set aside"
    (run / "counters.json").write_text(json.dumps({**counters, "stop_reason": reason}))
    without_voxels_beyond(run, 2.7)
    summary = evaluate_run(run, *WORLD)
    assert 0.6 < summary["coverage"] < 0.9
    assert (summary["success"], summary["faults"]) == (False, ["coverage"])
    headline = " ".join(format_summary(summary).partition("\n\n")[0].split())
    share = f"{100 * summary['coverage']:.1f} %"
    assert headline.startswith(f"FAILED rooms, seed 1: explored, but {share} of the reachable ground seen, ")
    assert headline.endswith("no reachable frontier is left in the whole map; 4 set aside")


def test_robot_that_stood_and_saw_all_has_succeeded_and_one_that_saw_less_has_not(run):
    stamps, poses = true_poses()
    write_tum(run / "trajectory_truth.txt", stamps, np.tile(poses[0], (len(poses), 1, 1)))
    write_tum(run / "trajectory.txt", stamps[::20], np.tile(np.eye(4), (5, 1, 1)))
    assert evaluate_run(run, *WORLD)["success"] is True
    without_voxels_beyond(run, 3.5)
    summary = evaluate_run(run, *WORLD)
    assert 0.95 < summary["coverage"] < 0.995
    assert (summary["success"], summary["faults"]) == (False, ["stayed"])
    assert "explored, but it never left its start" in format_summary(summary)


@pytest.mark.parametrize("name", ["occupied.npz", "run.json", "counters.json", "cloud.ply"])
def test_file_cut_off_in_writing_is_missing_not_fatal(run, name):
    whole = (run / name).read_bytes()
    (run / name).write_bytes(whole[: len(whole) // 3] if name != "cloud.ply" else b"ply\nformat")
    assert any(name in reason for reason in evaluate_run(run, *WORLD)["missing"])


def test_half_a_last_line_of_a_killed_run_is_left_out(run):
    path = run / "trajectory_truth.txt"
    count = len(read_trajectory(path)[0])
    path.write_text(path.read_text() + "5.05 1.0 2.")
    assert len(read_trajectory(path)[0]) == count


@pytest.mark.parametrize(
    "text", ["", "1 2 3\n1 0 0 0 0 0 0 1\n", "1 0 0 0 0 0 0 x\n", "2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", "1 nan 0 0 0 0 0 1\n"]
)
def test_damaged_trajectory_is_refused(tmp_path, text):
    (tmp_path / "t.txt").write_text(text)
    with pytest.raises(ValueError, match=r"t\.txt"):
        read_trajectory(tmp_path / "t.txt")


@pytest.mark.parametrize("text", ["", "time,what\n1,2\n", CONTACTS_HEADER + "1.0,base,fast,3\n", CONTACTS_HEADER + "1.0,base\n"])
def test_damaged_contacts_are_refused_and_not_read_as_none(tmp_path, text):
    (tmp_path / "contacts.csv").write_text(text)
    with pytest.raises(ValueError, match=r"contacts\.csv"):
        read_contacts(tmp_path / "contacts.csv")


def test_start_without_room_leaves_coverage_unknown_with_the_reason(run):
    summary = evaluate_run(run, *WORLD, robot=RobotShape(circumscribed_radius_m=3.0))
    assert summary["coverage"] is None
    assert any("no room to turn" in reason for reason in summary["missing"])


def test_run_is_judged_by_the_robot_that_drove(run):
    (run / "robot.yaml").write_text(yaml.safe_dump({**robot_mapping(RobotBody()), "length_m": 5.0, "width_m": 3.0}))
    assert any("no room to turn" in reason for reason in evaluate_run(run, *WORLD)["missing"])


def test_robot_of_a_run_that_is_none_is_an_error(run):
    (run / "robot.yaml").write_text("width_m: -1\n")
    with pytest.raises(ValueError, match="robot.yaml: length_m is missing"):
        evaluate_run(run, *WORLD)


def test_shape_is_that_of_the_robot():
    robot = replace(RobotBody(), length_m=0.8, width_m=0.6, height_m=0.5, max_step_m=0.05, max_slope_rad=0.3, ground_clearance_m=0.06)
    assert RobotShape.of(RobotBody()) == RobotShape()
    assert RobotShape.of(robot) == RobotShape(0.5, 0.3, 0.8, 0.6, 0.0992, 0.5, 0.6, 0.06, 0.3, 0.05)


def test_folder_that_is_not_there_is_an_error(tmp_path):
    with pytest.raises(ValueError, match="no run folder"):
        evaluate_run(tmp_path / "nowhere", *room())


def test_json_holds_null_for_what_is_not_finite_and_plain_numbers_for_numpy(tmp_path):
    write_json(tmp_path / "a.json", {"nan": float("nan"), "count": np.int64(3), "list": (np.float32(0.5), np.inf), "flag": np.bool_(True)})
    assert json.loads((tmp_path / "a.json").read_text()) == {"nan": None, "count": 3, "list": [0.5, None], "flag": True}


def test_text_of_a_summary_fits_a_screen_and_says_what_is_unknown(run):
    text = format_summary(evaluate_run(run, *WORLD))
    assert text.startswith("SUCCESS  rooms, seed 1: explored")
    assert "100.0 % of" in text
    assert "unknown" not in text
    nothing = format_summary({"coverage": None, "missing": [f"thing {k}" for k in range(30)]})
    assert nothing.startswith("UNDECIDED")
    assert "coverage       unknown" in nothing
    assert "and 25 more" in nothing
    for lines in (text.splitlines(), nothing.splitlines()):
        assert len(lines) <= 24
        assert max(map(len, lines)) <= 100


def test_command_judges_a_folder_again_with_its_own_mesh(run, capsys):
    vertices, triangles = WORLD
    mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(vertices), o3d.utility.Vector3iVector(triangles.astype(np.int32)))
    o3d.io.write_triangle_mesh(str(run / "world.ply"), mesh)
    assert main([str(run), "--no-pictures"]) == 0
    assert "SUCCESS" in capsys.readouterr().out
    assert json.loads((run / "summary.json").read_text())["coverage"] == 1.0


def test_command_refuses_a_missing_folder_or_mesh_in_one_line(run, capsys):
    for arguments in (
        [str(run / "nowhere")],
        [str(run), "--world-mesh", str(run / "none.ply")],
        [str(run), "--world-mesh", str(run / "run.json")],
    ):
        assert main(arguments) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_judge_looks_from_the_laser_of_the_robot_that_drove(tmp_path):
    small = load_robot(robot_file("small"))
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(robot_mapping(small)))
    assert read_robot(tmp_path).laser_height_m == RobotShape().laser_height_m
    for robot, height_m in ((small, 0.48), (RobotBody(), 0.92)):
        (tmp_path / "robot.yaml").write_text(yaml.safe_dump(robot_mapping(robot)))
        (tmp_path / "robot.urdf").write_text(urdf_file(robot).read_text())
        assert read_robot(tmp_path).laser_height_m == height_m
