"""The robot's YAML file: the node's own names and sections, profiles, and everything that is wrong with it named at once."""

from pathlib import Path

import pytest

from explore_command.arguments import ArgumentProblem
from octomap_server_3dnav.terrain.classify import TerrainConfig
from terrain_tools.robot_file import RobotConfig, read_robot

ROOT = Path(__file__).resolve().parents[3]


def robot(tmp_path, text):
    path = tmp_path / "robot.yaml"
    path.write_text(text)
    return read_robot(path)


@pytest.mark.parametrize("text", ["", "terrain:\n", "{}", "octomap_server_3dnav_node:\n"])
def test_file_without_parameters_is_the_default_robot(tmp_path, text):
    assert robot(tmp_path, text) == RobotConfig()


def test_file_of_the_node_and_profiles_can_be_given():
    assert read_robot(ROOT / "config" / "octomap_server_3dnav.yaml").terrain == TerrainConfig()
    thesis = read_robot(ROOT / "config" / "profiles" / "thesis.yaml")
    assert thesis.terrain.inflation_shape == "square" and thesis.frontier.frontier_distance == "euclidean"


def test_parameters_of_all_sections_are_taken(tmp_path):
    found = robot(tmp_path, "resolution: 0.05\nterrain: {max_step_m: 0.2}\nplanner: {climb_weight: 1}\nsensor_model: {hit: 0.8}\n")
    assert (found.octree.resolution, found.terrain.max_step_m, found.planner.climb_weight) == (0.05, 0.2, 1.0)
    assert found.sensor_model.hit == 0.8


@pytest.mark.parametrize(
    "text, said",
    [
        ("terrain: {max_stp_m: 0.2}", ["max_stp_m, did you mean max_step_m?", "terrain knows robot_height_m,", "hole_bridge_voxels"]),
        ("planner: {zzz: 1}", ["unknown parameter zzz", "planner knows climb_weight, passage_weight"]),
        ("terain: {max_step_m: 0.2}", ["terain", "did you mean terrain?"]),
        ("zzz: 1", ["unknown parameter zzz", "without a section knows resolution"]),
        ("terrain: {max_step_m: .nan}", ["max_step_m = nan is not finite"]),
        ("terrain: {max_step_m: 7}", ["max_step_m = 7.0 is above 0.5"]),
        ("terrain: {max_step_m: high}", ["max_step_m = 'high' is no float"]),
        ("terrain: 3", ["terrain"]),
        ("terrain: {max_step_m: .inf, zzz: 1}\nplanner: {climb_weight: -1}", ["max_step_m", "zzz", "climb_weight"]),
        ("terrain: {cliff_look_m: 0.08, max_step_m: 0.3}", ["cliff_look_m = 0.08 is below max_step_m"]),
        ("- terrain", ["expected sections"]),
        ("terrain: {", ["is no YAML"]),
        ("\x00", ["is no YAML"]),
    ],
)
def test_everything_wrong_is_named(tmp_path, text, said):
    with pytest.raises(ArgumentProblem) as problem:
        robot(tmp_path, text)
    assert all(part in str(problem.value) for part in ["robot.yaml", *said]), problem.value


def test_file_that_cannot_be_read_is_named(tmp_path):
    (tmp_path / "latin.yaml").write_bytes(b"terrain: \xff")
    for path in (tmp_path / "absent.yaml", tmp_path, tmp_path / "latin.yaml"):
        with pytest.raises(ArgumentProblem, match=path.name):
            read_robot(path)
