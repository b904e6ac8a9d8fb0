"""What a map is judged by: a robot's file, a profile or the node's own names and sections, and all that is wrong with them at once."""

from pathlib import Path

import pytest
import yaml

from explore_command.arguments import ArgumentProblem
from octomap_server_3dnav.terrain.classify import TerrainConfig
from robot_body import DEFAULT_ROBOT_FILE, RobotBody, robot_mapping
from terrain_tools.criteria import Criteria, read_criteria

ROOT = Path(__file__).resolve().parents[3]


def criteria(tmp_path: Path, text: str) -> Criteria:
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    return read_criteria(None, str(path))


def test_nothing_given_is_the_project_s_robot_and_the_defaults() -> None:
    assert read_criteria() == read_criteria(DEFAULT_ROBOT_FILE, "ours") == Criteria()


@pytest.mark.parametrize("text", ["", "terrain:\n", "{}", "octomap_server_3dnav_node:\n"])
def test_profile_without_parameters_is_the_defaults(tmp_path: Path, text: str) -> None:
    assert criteria(tmp_path, text) == Criteria()


def test_file_of_the_node_and_profiles_can_be_given() -> None:
    assert read_criteria(None, str(ROOT / "config" / "octomap_server_3dnav.yaml")).terrain == TerrainConfig()
    thesis = read_criteria(None, "thesis")
    assert thesis.terrain.inflation_shape == "square" and thesis.frontier.frontier_distance == "euclidean"
    assert not thesis.passages.enabled


def test_parameters_of_all_sections_are_taken(tmp_path: Path) -> None:
    found = criteria(tmp_path, "resolution: 0.05\nterrain: {look_m: 0.2}\nplanner: {climb_weight: 1}\nsensor_model: {hit: 0.8}\n")
    assert (found.octree.resolution, found.terrain.look_m, found.planner.climb_weight) == (0.05, 0.2, 1.0)
    assert found.sensor_model.hit == 0.8


def test_names_of_what_comes_by_topics_are_no_trouble(tmp_path: Path) -> None:
    found = criteria(tmp_path, "frame_id: odom\nresolution: 0.05\nsensor_model: {max_range: 5.0}\n")
    assert found.octree.resolution == 0.05


def test_profile_s_robot_lies_over_that_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump({**robot_mapping(RobotBody()), "max_step_m": 0.05, "max_slope_rad": 0.3}))
    (tmp_path / "p.yaml").write_text("robot: {max_step_m: 0.06}\n")
    robot = read_criteria(tmp_path / "robot.yaml", str(tmp_path / "p.yaml")).robot
    assert (robot.max_step_m, robot.max_slope_rad) == (0.06, 0.3)


@pytest.mark.parametrize(
    "text, said",
    [
        ("terrain: {lok_m: 0.2}", ["lok_m, did you mean look_m?", "terrain knows", "fill_columns"]),
        ("planner: {zzz: 1}", ["unknown parameter zzz", "planner knows climb_weight, passage_weight"]),
        ("terain: {look_m: 0.2}", ["terain", "did you mean terrain?"]),
        ("zzz: 1", ["unknown parameter zzz", "without a section knows resolution"]),
        ("terrain: {look_m: .nan}", ["look_m = nan is not finite"]),
        ("terrain: {look_m: 7}", ["look_m = 7.0 is above 3.0"]),
        ("terrain: {look_m: high}", ["look_m = 'high' is no float"]),
        ("terrain: 3", ["terrain"]),
        ("terrain: {look_m: .inf, zzz: 1}\nplanner: {climb_weight: -1}", ["look_m", "zzz", "climb_weight"]),
        ("robot: {max_stp_m: 0.2}\nplanner_node: {}", ["--robot", "max_stp_m, did you mean max_step_m?"]),
        ("robot: 3", ["robot = 3 is no mapping"]),
        ("- terrain", ["expected sections"]),
        ("terrain: {", ["is no YAML"]),
        ("\x00", ["is no YAML"]),
    ],
)
def test_everything_wrong_is_named(tmp_path: Path, text: str, said: list[str]) -> None:
    with pytest.raises(ArgumentProblem) as problem:
        criteria(tmp_path, text)
    assert all(part in str(problem.value) for part in said), problem.value


def test_robot_and_profile_are_refused_together_one_line_a_violation(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump({**robot_mapping(RobotBody()), "max_step_m": -1.0, "colour": "red"}))
    (tmp_path / "p.yaml").write_text("resolution: -1\n")
    with pytest.raises(ArgumentProblem) as problem:
        read_criteria(tmp_path / "robot.yaml", str(tmp_path / "p.yaml"))
    lines = str(problem.value).splitlines()
    assert len(lines) == 3 and [line.split()[0] for line in lines] == ["--robot", "--robot", "--profile"], lines


def test_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    (tmp_path / "latin.yaml").write_bytes(b"terrain: \xff")
    for path in (tmp_path / "absent.yaml", tmp_path, tmp_path / "latin.yaml"):
        with pytest.raises(ArgumentProblem, match=path.name):
            read_criteria(None, str(path))
        with pytest.raises(ArgumentProblem, match=path.name):
            read_criteria(path)


def test_parameters_of_nodes_given_as_a_robot_are_told_where_they_go(tmp_path: Path) -> None:
    path = tmp_path / "node.yaml"
    path.write_text("size_m: 8.0\nterrain:\n  margin_m: 0.025\n", encoding="utf-8")
    with pytest.raises(ArgumentProblem, match="terrain is no value of a robot: a --profile has parameters of nodes") as problem:
        read_criteria(path)
    assert "\n" not in str(problem.value)
