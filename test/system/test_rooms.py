"""A whole exploration of `rooms`: it succeeds, and leaves all that it promises, readable by other programs."""

import csv
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest
from exploring import lines_of_sweeps, summary

from octomap_server_3dnav.octree.octree import OctreeMap
from pose_graph_mapping.graph.pose_graph import PoseGraph

NEEDED_KEYS = (
    "success stop_reason sim_time_s wall_time_s distance_m sweeps loop_closures local_classifications local_classification_time_s "
    "global_classifications global_classification_time_s coverage map_rmse_m trajectory_ate_m trajectory_origin_error_m map_tilt_rad "
    "collisions max_tilt_rad config version world seed"
).split()

Run = tuple[Path, int, str]


def test_run_succeeds_with_exit_code_zero(rooms_run: Run) -> None:
    out, code, text = rooms_run
    assert code == 0, text
    assert summary(out)["success"] is True, text


def test_rooms_are_explored_without_a_collision(rooms_run: Run) -> None:
    result = summary(rooms_run[0])
    assert str(result["stop_reason"]).startswith("explored"), result
    assert result["coverage"] >= 0.95 and result["collisions"] == 0, result  # type: ignore[operator]


def test_map_and_trajectory_are_true(rooms_run: Run) -> None:
    result = summary(rooms_run[0])
    assert result["trajectory_ate_m"] < 0.10 and result["map_rmse_m"] < 0.10, result  # type: ignore[operator]
    assert result["max_tilt_rad"] < 0.1, result  # type: ignore[operator]


def test_summary_holds_every_promised_key(rooms_run: Run) -> None:
    missing = [key for key in NEEDED_KEYS if key not in summary(rooms_run[0])]
    assert not missing


def test_terminal_says_how_it_ended(rooms_run: Run) -> None:
    assert "SUCCESS" in rooms_run[2] and "sweeps" in rooms_run[2]
    assert "Traceback" not in rooms_run[2]


def test_no_node_printed_a_traceback(rooms_run: Run) -> None:
    assert "Traceback" not in (rooms_run[0] / "roslaunch.log").read_text()


@pytest.mark.parametrize("name", ["map.bt", "map.ot"])
def test_octree_loads_and_holds_the_rooms(rooms_run: Run, name: str) -> None:
    centers, _ = OctreeMap.read(rooms_run[0] / name).occupied_voxels()
    assert len(centers) > 10_000
    assert np.ptp(centers[:, 0]) > 6.0 and np.ptp(centers[:, 1]) > 6.0


def test_cloud_loads_with_open3d(rooms_run: Run) -> None:
    points = np.asarray(o3d.io.read_point_cloud(str(rooms_run[0] / "cloud.ply")).points)
    assert len(points) > 10_000 and np.isfinite(points).all()


def test_graph_has_a_vertex_for_every_sweep(rooms_run: Run) -> None:
    out = rooms_run[0]
    graph = PoseGraph.load_g2o(out / "graph.g2o")
    assert len(graph) == summary(out)["sweeps"] == len(lines_of_sweeps(out))


def test_every_sweep_is_kept(rooms_run: Run) -> None:
    out = rooms_run[0]
    assert len([f for f in (out / "sweeps").iterdir() if f.suffix != ".json"]) == summary(out)["sweeps"]


def test_truth_has_a_pose_every_tick(rooms_run: Run) -> None:
    truth = np.loadtxt(rooms_run[0] / "trajectory_truth.txt")
    np.testing.assert_allclose(np.diff(truth[:, 0]), 0.05, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(truth[:, 4:], axis=1), 1.0, atol=1e-5)


def test_contacts_file_has_its_header(rooms_run: Run) -> None:
    with (rooms_run[0] / "contacts.csv").open() as file:
        assert next(csv.reader(file)) == ["stamp", "link", "speed_mps", "force_n", "other"]


@pytest.mark.parametrize("name", ["map_top.png", "map_angle.png"])
def test_pictures_are_pngs_with_something_on_them(rooms_run: Run, name: str) -> None:
    from PIL import Image

    with Image.open(rooms_run[0] / name) as picture:
        assert picture.format == "PNG" and min(picture.size) >= 300
        assert len(np.unique(np.asarray(picture.convert("L")))) > 20
