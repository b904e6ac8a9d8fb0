"""From checked arguments to the launch file's, to the parameters that it loads, and to a port for the master."""

from pathlib import Path

import pytest

from explore_command.arguments import parse
from explore_command.launching import launch_arguments, parameter_problem, world_problem
from explore_command.parameters import all_overrides, override_problems, parsed_overrides, profile_names, read_profile


def test_launch_file_gets_every_argument() -> None:
    values = launch_arguments(parse(["--world", "rooms", "--seed", "3", "--headless", "--free", "--out", "/o"]), "")
    named = [values[name] for name in ("world", "seed", "rviz", "lockstep", "out")]
    assert named == ["rooms", 3, "false", "false", Path("/o")]
    assert (values["start"], values["size"], values["area"], values["overrides"]) == ("", "", "", "")


def test_launch_file_is_told_the_sensor() -> None:
    assert launch_arguments(parse([]), "")["sensor"] == "tilting"
    assert launch_arguments(parse(["--sensor", "spinning"]), "")["sensor"] == "spinning"


def test_unknown_sensor_is_refused() -> None:
    with pytest.raises(SystemExit) as ended:
        parse(["--sensor", "radar"])
    assert ended.value.code == 2


def test_start_is_joined_by_spaces() -> None:
    assert launch_arguments(parse(["--start", "1", "-2.5", "0.3"]), "")["start"] == "1 -2.5 0.3"


def test_overrides_are_read_as_yaml_by_node() -> None:
    texts = ["a_node/x=1", "a_node/part/y=[1.0, 2]", "/b_node/z=true"]
    assert parsed_overrides(texts) == {"a_node": {"x": 1, "part/y": [1.0, 2]}, "b_node": {"z": True}}


def test_override_whose_value_is_no_yaml_is_refused() -> None:
    with pytest.raises(ValueError, match="cannot be read"):
        parsed_overrides(["a/b=[1,"])


def test_overrides_that_fit_are_no_problem() -> None:
    assert override_problems({"stop_scan_and_go_node": {"max_distance_m": 3}, "move_base_node": {"follower/max_speed_mps": 0.4}}) == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("stop_scan_and_go/max_distance_m=3", "unknown node stop_scan_and_go, did you mean stop_scan_and_go_node?"),
        ("stop_scan_and_go_node/max_distance=3", "did you mean max_distance_m?"),
        ("stop_scan_and_go_node/max_distance_m=0", "max_distance_m = 0.0 is below"),
        ("stop_scan_and_go_node/max_distance_m=far", "is no float"),
        ("move_base_node/folower/max_speed_mps=1", "no section 'folower', did you mean follower?"),
        ("move_base_node/max_speed_mps=1", "no section ''"),
        ("stop_scan_and_go_node/max_distance_m=[1,", "cannot be read"),
    ],
)
def test_wrong_override_is_told_in_one_line_with_the_nearest_name(text: str, said: str) -> None:
    problem = parameter_problem(parse(["--set", text]))
    assert problem is not None and said in problem and "\n" not in problem


def test_named_world_with_its_own_start_is_no_problem() -> None:
    assert world_problem(parse(["--world", "rooms"])) is None


def test_start_outside_the_world_is_a_problem() -> None:
    problem = world_problem(parse(["--world", "rooms", "--start", "100", "100", "0"]))
    assert problem is not None and "--world rooms" in problem and "start" in problem


def test_mesh_without_triangles_is_a_problem(tmp_path: Path) -> None:
    (tmp_path / "empty.obj").write_text("# nothing\n")
    assert world_problem(parse(["--world", str(tmp_path / "empty.obj")])) is not None


@pytest.mark.parametrize("name", profile_names())
def test_profiles_of_the_project_fit_the_nodes(name) -> None:
    assert override_problems(read_profile(name)) == []


def test_profile_of_the_defaults_overrides_nothing() -> None:
    assert read_profile("ours") == {}


def test_set_goes_over_the_profile() -> None:
    found = all_overrides("thesis", ["icp_matcher_node/method=gicp", "scan_filter_node/min_range_m=0.2"])
    assert found["icp_matcher_node"]["method"] == "gicp" and found["icp_matcher_node"]["verdict"] == "match_ratio"
    assert found["scan_filter_node"] == {"min_range_m": 0.2}
    assert found["octomap_server_3dnav_node"]["terrain/inflation_shape"] == "square"


@pytest.mark.parametrize(("content", "text"), [("- a\n", "maps nodes"), ("a: 3\n", "maps nodes"), ("a: [1,\n", "cannot be read")])
def test_profile_that_is_none_is_refused(tmp_path: Path, content, text) -> None:
    (tmp_path / "p.yaml").write_text(content)
    with pytest.raises(ValueError, match=text):
        read_profile(str(tmp_path / "p.yaml"))


def test_unknown_profile_is_a_problem_that_names_those_there_are() -> None:
    problem = parameter_problem(parse(["--profile", "thessis"]))
    assert problem is not None and "nearest, ours, thesis" in problem
