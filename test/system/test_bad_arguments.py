"""What is wrong with a command line: one clear line on stderr, exit code 2, nothing started and nothing left running."""

import os
import shutil
import socket
import subprocess
import uuid
from pathlib import Path

import pytest
from exploring import PACKAGE, RUN_MARK, ExploreRun, running_with

LIMIT_S = 60.0


def refused(*arguments: object) -> str:
    """The one line on stderr of a command line that is refused; what set-up says of its own work is not counted."""
    mark = uuid.uuid4().hex
    command = [str(PACKAGE / "explore"), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=4 * LIMIT_S, env={**os.environ, RUN_MARK: mark})
    assert not running_with(mark)
    assert done.returncode == 2, f"exit code {done.returncode}\n{done.stdout}\n{done.stderr}"
    lines = [line for line in (done.stdout + done.stderr).splitlines() if "[setup]" not in line]
    assert len(lines) == 1, lines
    return lines[0]


def cube(path: Path, centre: tuple[float, float, float], size: float) -> Path:
    """An .obj with one cube."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    quads = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]
    vertices = [f"v {' '.join(str(c + size / 2 * s) for c, s in zip(centre, corner, strict=True))}" for corner in corners]
    path.write_text("\n".join([*vertices, *(f"f {a} {b} {c}\nf {a} {c} {d}" for a, b, c, d in quads)]) + "\n")
    return path


def test_unknown_world_is_named_with_those_there_are(tmp_path: Path) -> None:
    line = refused("--world", "romms", "--headless", "--out", tmp_path / "run")
    assert "romms" in line and "rooms, doors, ramp, moon" in line


def test_unreadable_mesh_is_refused(tmp_path: Path) -> None:
    (tmp_path / "world.stl").write_bytes(b"this is no mesh \x00\xff")
    assert "world.stl" in refused("--world", tmp_path / "world.stl", "--headless", "--out", tmp_path / "run")


def test_mesh_that_the_system_does_not_give_is_refused(tmp_path: Path) -> None:
    (tmp_path / "world.obj").symlink_to("/proc/self/mem")
    assert "world.obj" in refused("--world", tmp_path / "world.obj", "--headless", "--out", tmp_path / "run")


def test_empty_mesh_is_refused(tmp_path: Path) -> None:
    (tmp_path / "empty.obj").write_text("# nothing\n")
    assert "empty.obj" in refused("--world", tmp_path / "empty.obj", "--headless", "--out", tmp_path / "run")


def test_empty_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "empty.ply").touch()
    assert "empty.ply" in refused("--world", tmp_path / "empty.ply", "--headless", "--out", tmp_path / "run")


def sdf(path: Path, world: str) -> Path:
    path.write_text(f"<sdf version='1.9'>\n<world name='w'>\n{world}\n</world></sdf>")
    return path


GROUND = "<model name='g'><link name='l'><collision name='c'><geometry><plane/></geometry></collision></link></model>"
BOX = GROUND.replace("<link", "{pose}<link").replace("<plane/>", "<box><size>{size}</size></box>")


@pytest.mark.parametrize(
    ("world", "said"),
    [
        ("<include><uri>model://cafe</uri></include>", "nothing to stand on is left of it; "),
        ("<plugin name='p' filename='libp.so'/>", "plugin libp.so"),
        (GROUND, "a plane only; --area X Y"),
        (BOX.format(pose="<pose>1 2 3 4 5</pose>", size="1 1 1"), "w.sdf:3: <pose>: 5 numbers"),
        (BOX.format(pose="", size="1 -1 1"), "w.sdf:3: <size>: 1 -1 1 is not above 0"),
        (BOX.format(pose="<pose>nan 0 0 0 0 0</pose>", size="1 1 1"), "w.sdf:3: <pose>"),
        (BOX.format(pose="", size="0.1 0.1 3"), "no flat ground"),
        ("<model>", "w.sdf:4: cannot be read as XML: mismatched tag"),
    ],
)
def test_sdf_file_that_is_no_world_is_refused_with_file_and_element(tmp_path: Path, world: str, said: str) -> None:
    assert said in refused("--world", sdf(tmp_path / "w.sdf", world), "--headless", "--out", tmp_path / "run")


def test_description_with_an_unknown_key_is_refused(tmp_path: Path) -> None:
    (tmp_path / "w.yaml").write_text("world: rooms\nstrat: [1, 2, 3]\n")
    assert "did you mean start?" in refused("--world", tmp_path / "w.yaml", "--headless", "--out", tmp_path / "run")


def test_folder_of_models_that_is_not_there_is_refused(tmp_path: Path) -> None:
    world = sdf(tmp_path / "w.sdf", GROUND)
    assert "no such folder" in refused("--world", world, "--models", tmp_path / "no", "--headless", "--out", tmp_path / "run")


def test_picture_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "map.png").write_bytes(b"no picture")
    assert "map.png" in refused("--world", tmp_path / "map.png", "--size", 10, 10, 1, "--headless", "--out", tmp_path / "run")


def test_height_map_without_size_says_what_is_missing(tmp_path: Path) -> None:
    (tmp_path / "map.png").write_bytes(b"no picture")
    assert "--size" in refused("--world", tmp_path / "map.png", "--headless", "--out", tmp_path / "run")


def test_start_without_ground_is_refused(tmp_path: Path) -> None:
    world = cube(tmp_path / "table.obj", (0, 0, -5), 10.0)
    assert "ground" in refused("--world", world, "--start", 40, 40, 0, "--headless", "--out", tmp_path / "run")


def test_start_beside_the_named_world_is_refused(tmp_path: Path) -> None:
    assert "start" in refused("--world", "rooms", "--start", 100, 100, 0, "--headless", "--out", tmp_path / "run")


def test_start_inside_a_wall_is_refused(tmp_path: Path) -> None:
    from pybullet_simulation import load_world

    low = load_world("rooms", 1).extent[0]
    line = refused("--world", "rooms", "--start", low[0] + 0.05, low[1] + 0.05, 0, "--headless", "--out", tmp_path / "run")
    assert "wall" in line


def test_results_of_others_are_not_overwritten_without_force(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("mine")
    assert "--force" in refused("--world", "rooms", "--headless", "--out", tmp_path)
    assert (tmp_path / "thesis.txt").read_text() == "mine"


def test_out_below_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert "--out" in refused("--world", "rooms", "--headless", "--out", tmp_path / "file" / "run")


def test_out_where_nothing_can_be_written_is_refused() -> None:
    assert "--out" in refused("--world", "rooms", "--headless", "--out", "/proc/explore_run")


def test_override_without_node_says_what_is_expected(tmp_path: Path) -> None:
    assert "NODE/PARAMETER=VALUE" in refused("--world", "rooms", "--set", "resolution=3", "--headless", "--out", tmp_path / "run")


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("octomap_server_3dnav_node/resolutoin=0.1", "resolution"),
        ("octomap_server_3dnav_node/resolution=-1", "resolution"),
        ("octomap_server_3dnav_node/frontier/min_voxel=3", "min_voxel"),
        ("scan_filter_node/min_range_m=near", "min_range_m"),
        ("pybullet_sim_node/range_noize_m=0.1", "range_noize_m"),
        ("octomap_server_3dnav_nod/resolution=0.1", "octomap_server_3dnav_node"),
        ("octomap_server_3dnav_node/sensormodel/hit=0.7", "sensor_model"),
        ("octomap_server_3dnav_node/terrain=[1,", "cannot be read"),
    ],
)
def test_wrong_parameter_is_refused_with_the_nearest_name(tmp_path: Path, override: str, expected: str) -> None:
    line = refused("--world", "rooms", "--set", override, "--headless", "--out", tmp_path / "run")
    assert expected in line


def test_wrong_numbers_are_refused(tmp_path: Path) -> None:
    assert "--rate" in refused("--world", "rooms", "--rate", -1, "--headless", "--out", tmp_path / "run")
    assert "--max-sim-time" in refused("--world", "rooms", "--max-sim-time", 0, "--headless", "--out", tmp_path / "run")


def test_taken_port_of_the_master_does_not_matter(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            taken.bind(("", 11311))
            taken.listen()
        except OSError:
            pass  # somebody else has it, which is just as well
        with ExploreRun("--world", "rooms", "--seed", 1, "--headless", "--out", tmp_path / "run") as run:
            assert "localhost:11311" not in run.wait_for_line("ROS_MASTER_URI", LIMIT_S)
            run.wait_for_line("sweeping", 90.0)
            run.interrupt()
            run.wait(60.0)
            assert not run.running()


def test_help_reads_well_and_needs_nothing_set_up(tmp_path: Path) -> None:
    shutil.copy(PACKAGE / "explore", tmp_path)  # without scripts/setup.bash
    for package in ("explore_command", "whole_files"):
        shutil.copytree(PACKAGE / "src" / package, tmp_path / "src" / package)
    shown = subprocess.run(["./explore", "--help"], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)
    assert shown.returncode == 0 and shown.stderr == ""
    assert shown.stdout.startswith("usage: ./explore") and "Exit code:" in shown.stdout
