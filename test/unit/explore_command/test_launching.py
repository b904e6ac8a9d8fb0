"""From checked arguments to the launch file's, to the parameters that it loads, and to a port for the master."""

from pathlib import Path

import pytest
import yaml

from explore_command.__main__ import main
from explore_command.arguments import ArgumentProblem, parse
from explore_command.launching import as_robot_is_built, effective_robot, launch_arguments, parameter_problem, world_problem
from explore_command.parameters import all_overrides, override_problems, parsed_overrides, profile_names, read_profile
from robot_body import DEFAULT_ROBOT_FILE, RobotBody, robot_mapping, urdf_file

FIXED = Path(__file__).parents[3] / "config" / "robots" / "husky_vlp16.yaml"


def launched(*arguments: str) -> dict[str, object]:
    robot = RobotBody()
    return launch_arguments(as_robot_is_built(parse([*arguments]), robot), robot, Path("/o/overrides.yaml"))


def robot_file(tmp_path: Path, **changes: object) -> str:
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump({**robot_mapping(RobotBody()), **changes}))
    return str(path)


def test_launch_file_gets_every_argument() -> None:
    values = launched("--world", "rooms", "--seed", "3", "--headless", "--free", "--out", "/o")
    named = [values[name] for name in ("world", "seed", "rviz", "lockstep", "out")]
    assert named == ["rooms", 3, "false", "false", Path("/o")]
    assert (values["start"], values["size"], values["area"], values["overrides"]) == ("", "", "", Path("/o/overrides.yaml"))
    assert (values["robot_file"], values["urdf"]) == (Path("/o/robot.yaml"), urdf_file(RobotBody()))


def test_goals_in_a_finished_map_are_driven_to_without_mapping_in_real_time_and_without_an_end() -> None:
    values = launched("--map", "/runs/mine", "--goals", "--out", "/o")
    assert (values["mapping"], values["map"], values["resume"]) == ("off", Path("/runs/mine"), "false")
    assert values["rate"] == 1.0 and float(str(values["max_sim_time"])) > 1e6
    exploring = launched("--map", "/runs/mine", "--out", "/o")
    assert (exploring["mapping"], exploring["map"], exploring["resume"]) == ("driving", "", "true")
    assert (exploring["rate"], exploring["max_sim_time"]) == (0.0, 3600.0)


def test_launch_file_is_told_the_sensor() -> None:
    assert launched()["sensor"] == "tilting"
    assert launched("--sensor", "spinning")["sensor"] == "spinning"


@pytest.mark.parametrize(
    ("words", "mapping"),
    [
        ([], "driving"),
        (["--profile", "thesis"], "stop_and_go"),
        (["--profile", "thesis", "--mapping", "driving"], "driving"),
        (["--profile", "thesis", "--robot", str(FIXED)], "driving"),
    ],
)
def test_robot_maps_while_driving_unless_words_or_profile_say_otherwise(words: list[str], mapping: str) -> None:
    arguments = parse([*words])
    assert as_robot_is_built(arguments, effective_robot(arguments)).mapping == mapping


def test_fixed_lidar_decides_for_sensor_and_mapping_where_they_are_not_said() -> None:
    arguments = parse(["--robot", str(FIXED)])
    built = as_robot_is_built(arguments, effective_robot(arguments))
    assert (built.sensor, built.mapping) == ("spinning", "driving")


@pytest.mark.parametrize(("words", "said"), [(["--sensor", "tilting"], "sensor is tilting"), (["--mapping", "stop_and_go"], "mapping is")])
def test_what_a_fixed_lidar_cannot_is_refused_in_a_line(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--robot", str(FIXED), *words, "--out", str(tmp_path / "run")]) == 2
    err = capsys.readouterr().err
    assert said in err and err.count("\n") == 1 and not (tmp_path / "run").exists()


def test_unknown_sensor_is_refused() -> None:
    with pytest.raises(SystemExit) as ended:
        parse(["--sensor", "radar"])
    assert ended.value.code == 2


def test_start_is_joined_by_spaces() -> None:
    assert launched("--start", "1", "-2.5", "0.3")["start"] == "1 -2.5 0.3"
    assert launched("--start", "448262.25", "5412345.5", "412", "0.3")["start"] == "448262.25 5412345.5 412 0.3"


def test_unit_and_upward_axis_of_a_mesh_reach_the_simulator(tmp_path: Path) -> None:
    (tmp_path / "hall.stl").touch()
    values = launched("--world", str(tmp_path / "hall.stl"), "--scale", "0.001", "--up", "y")
    assert (values["scale"], values["up"]) == ("0.001", "y")
    assert (launched()["scale"], launched()["up"]) == ("", "")


@pytest.mark.parametrize(
    ("words", "said"),
    [(["--start", "1", "2"], "X Y Z YAW"), (["--scale", "-1"], "--scale"), (["--up", "y"], "for meshes"), (["--scale", "2"], "for meshes")],
)
def test_start_scale_and_up_that_do_not_fit_are_refused(words: list[str], said: str) -> None:
    with pytest.raises(ArgumentProblem, match=said):
        parse(words)


def test_overrides_are_read_as_yaml_by_node() -> None:
    texts = ["a_node/x=1", "a_node/part/y=[1.0, 2]", "/b_node/z=true"]
    assert parsed_overrides(texts) == {"a_node": {"x": 1, "part/y": [1.0, 2]}, "b_node": {"z": True}}


def test_override_whose_value_is_no_yaml_is_refused() -> None:
    with pytest.raises(ValueError, match="cannot be read"):
        parsed_overrides(["a/b=[1,"])


def test_overrides_that_fit_are_no_problem() -> None:
    assert override_problems({"stop_scan_and_go_node": {"max_distance_m": 3}, "move_base_node": {"follower/max_speed_mps": 0.4}}) == []


def test_values_that_are_right_only_together_are_judged_together() -> None:
    few = ["--set", "octomap_server_3dnav_node/exploration/max_goals=1"]
    assert "max_goals" in (parameter_problem(parse(few)) or "")
    together = [
        "--set",
        "octomap_server_3dnav_node/exploration/max_looks=1",
        "--set",
        "octomap_server_3dnav_node/exploration/max_failures=1",
    ]
    assert parameter_problem(parse(few + together)) is None


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
    assert world_problem(parse(["--world", "rooms"]), RobotBody()) is None


def test_start_outside_the_world_is_a_problem() -> None:
    problem = world_problem(parse(["--world", "rooms", "--start", "100", "100", "0"]), RobotBody())
    assert problem is not None and "--world rooms" in problem and "start" in problem


def test_mesh_without_triangles_is_a_problem(tmp_path: Path) -> None:
    (tmp_path / "empty.obj").write_text("# nothing\n")
    assert world_problem(parse(["--world", str(tmp_path / "empty.obj")]), RobotBody()) is not None


@pytest.mark.parametrize("area", [[], ["--area", "20", "20"]])
def test_world_that_is_too_large_to_be_judged_is_told_at_once(tmp_path: Path, area: list[str]) -> None:
    plain = tmp_path / "plain.obj"
    plain.write_text("v 0 0 0\nv 4100 0 0\nv 4100 4100 0\nv 0 4100 0\nf 1 2 3\nf 1 3 4\n")
    problem = world_problem(parse(["--world", str(plain), "--scale", "1", *area]), RobotBody())
    said = f"--world {plain}: the world has 41000 x 41000 columns of 0.1 m; at most 16000000 are judged; --area X Y explores a part of it"
    assert problem == (None if area else said)


def test_mover_that_cannot_be_is_told_with_the_file_that_names_it(tmp_path: Path) -> None:
    world, movers = tmp_path / "w.yaml", tmp_path / "m.yaml"
    in_a_wall = "{kind: person, start: [99, 99]}"
    world.write_text(f"world: rooms\nmovers:\n- {{kind: cart}}\n- {in_a_wall}\n")
    said = "person_2 cannot start at x 99 y 99: it is inside or too near"
    problem = world_problem(parse(["--world", str(world)]), RobotBody())
    assert problem is not None and problem.startswith(f"--world {world}: mover 2: {said}")
    world.write_text("world: rooms\nmovers:\n- {kind: cart}\n")
    movers.write_text(f"- {{kind: robot}}\n- {in_a_wall}\n")
    problem = world_problem(parse(["--world", str(world), "--movers", str(movers)]), RobotBody())
    assert problem is not None and problem.startswith(f"--movers {movers}: mover 2: {said}")
    movers.write_text("- {kind: cart}\n")
    problem = world_problem(parse(["--world", str(world), "--movers", str(movers)]), RobotBody())
    assert problem == f"--movers {movers}: mover 1: cart_1 has the name of another one"


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


@pytest.mark.parametrize(
    ("content", "text"),
    [("- a\n", "maps nodes"), ("a: 3\n", "maps nodes"), ("a: [1,\n", "cannot be read"), ("a: {}\na: {}", "key a stands in line 1")],
)
def test_profile_that_is_none_is_refused(tmp_path: Path, content, text) -> None:
    (tmp_path / "p.yaml").write_text(content)
    with pytest.raises(ValueError, match=text):
        read_profile(str(tmp_path / "p.yaml"))


def test_unknown_profile_is_a_problem_that_names_those_there_are() -> None:
    problem = parameter_problem(parse(["--profile", "thessis"]))
    assert problem is not None and "nearest, ours, thesis" in problem


def test_robot_is_the_project_s_unless_a_file_is_given(tmp_path: Path) -> None:
    assert effective_robot(parse([])) == RobotBody()
    assert effective_robot(parse(["--robot", robot_file(tmp_path, max_step_m=0.05)])).max_step_m == 0.05


def test_profile_and_set_change_single_values_of_the_robot(tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text("robot: {max_step_m: 0.06, max_slope_rad: 0.3}\n")
    robot = effective_robot(parse(["--profile", str(tmp_path / "p.yaml"), "--set", "robot/max_step_m=0.07"]))
    assert (robot.max_step_m, robot.max_slope_rad, robot.length_m) == (0.07, 0.3, RobotBody().length_m)


def test_run_that_goes_on_has_the_robot_of_the_earlier_one(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text('{"world": "rooms", "seed": 7}')
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump({**robot_mapping(RobotBody()), "max_step_m": 0.05}))
    assert effective_robot(parse(["--resume", str(tmp_path)])).max_step_m == 0.05
    assert effective_robot(parse(["--resume", str(tmp_path), "--robot", str(DEFAULT_ROBOT_FILE)])).max_step_m == 0.1


def test_robot_with_a_description_beside_it_is_measured_by_that(tmp_path: Path) -> None:
    text = urdf_file(RobotBody()).read_text()
    (tmp_path / "mine.urdf").write_text(text.replace('radius="0.1651"', 'radius="0.15"').replace('0.0331"/>', '0.018"/>'))
    robot = effective_robot(parse(["--robot", robot_file(tmp_path, urdf="mine.urdf", wheel_radius_m=0.15)]))
    assert urdf_file(robot) == tmp_path / "mine.urdf"
    with pytest.raises(ArgumentProblem, match="wheel_radius_m = 0.1651, and the URDF has 0.15"):
        effective_robot(parse(["--robot", robot_file(tmp_path, urdf="mine.urdf")]))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"max_step_m": -0.1, "colour": "red"}, ["max_step_m = -0.1 is below 0.01", "unknown parameter colour"]),
        (
            {"width_m": 0.5, "max_step_m": 0.2},
            ["below track_m + wheel_width_m", "wheel_radius_m = 0.1651 is", "ground_clearance_m = 0.132 is"],
        ),
        ({"mounts": {"laser": {"from": "urdf"}}}, ["mounts/laser: has no frame"]),
        ({"track_m": 0.5, "length_m": 1.2}, ["track_m = 0.5, and the URDF has 0.5708", "length_m = 1.2, and the shapes of the URDF"]),
        ({"terrain": {"max_step_m": 0.1}}, ["terrain is no value of a robot"]),
        ({"urdf": "absent.urdf"}, ["urdf absent.urdf: no such file beside this one, nor in "]),
    ],
    ids=str,
)
def test_wrong_robot_is_refused_with_one_line_a_violation(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], changes: dict[str, object], said: list[str]
) -> None:
    assert main(["--world", "rooms", "--robot", robot_file(tmp_path, **changes), "--out", str(tmp_path / "run")]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert all(line.startswith("./explore: --robot ") and "mine.yaml: " in line for line in lines), lines
    assert len(lines) == len(said) and all(any(text in line for line in lines) for text in said), lines
    assert not (tmp_path / "run").exists()


def test_profile_may_choose_the_mapping_and_nothing_else_of_the_command(tmp_path: Path) -> None:
    profile = tmp_path / "own.yaml"
    profile.write_text("explore: {mapping: sometimes, seed: 3}")
    problem = parameter_problem(parse(["--profile", str(profile)]))
    assert problem and "mapping = 'sometimes'" in problem and "seed = 3" in problem


def test_what_the_robot_does_at_the_end_and_what_it_may_cost_is_launched() -> None:
    named = "at_end", "budget_s", "budget_m"
    assert [launched()[name] for name in named] == ["stay", 0.0, 0.0]
    values = launched("--at-end", "home", "--budget", "2.5", "--budget-m", "40")
    assert [values[name] for name in named] == ["home", 150.0, 40.0]


@pytest.mark.parametrize(("words", "said"), [(["--budget", "-1"], "--budget -1"), (["--budget-m", "nan"], "--budget-m nan")])
def test_budget_that_is_none_is_refused(words: list[str], said: str) -> None:
    with pytest.raises(ArgumentProblem, match=said):
        parse(words)


def test_zones_are_launched_and_bad_ones_refused_before_anything_is_started(tmp_path: Path) -> None:
    zones = tmp_path / "zones.yaml"
    zones.write_text("bounds: [{polygon: [[-1, -1], [5, -1], [5, 5], [-1, 5]]}]")
    assert (launched()["zones"], launched("--zones", str(zones))["zones"]) == ("", zones)
    zones.write_text("bounds: [{polygon: [[1, 1], [5, 1], [5, 5], [1, 5]]}]")
    with pytest.raises(ArgumentProblem, match="starts at 0 0 of map, and .* lies outside the bounds"):
        launched("--zones", str(zones))
    with pytest.raises(ArgumentProblem, match=r"--zones .*nowhere\.yaml"):
        launched("--zones", str(tmp_path / "nowhere.yaml"))
