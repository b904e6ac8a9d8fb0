"""What launch files write and load: a folder for each launch, nothing simulated over what is the robot's, one lidar for all nodes."""

import shlex
import subprocess
from pathlib import Path

from roslaunch.config import load_config_default
from roslaunch.core import Node

from explore_command.parameters import NODE_CONFIGS

PACKAGE = Path(__file__).resolve().parents[3]
LAUNCH, URDF = PACKAGE / "launch", PACKAGE / "urdf" / "jackal.urdf"


def parameter(file: str, name: str, *args: str) -> str:
    config = load_config_default([(str(LAUNCH / file), list(args))], None)
    return str(config.params[name].value)


def test_each_launch_has_a_folder_of_its_own() -> None:
    one, other = (parameter("explore.launch", "/pose_graph_mapping_node/out", "sim:=false") for _ in range(2))
    assert one != other and Path(one).parent == Path(other).parent == Path.home() / ".ros/explore_3dnav"
    named = parameter("explore.launch", "/left/exploration_monitor_node/out", "sim:=false", "ns:=left", "out:=/data/run1")
    assert named == "/data/run1"


def test_all_nodes_of_a_launch_write_to_the_same_folder() -> None:
    config = load_config_default([(str(LAUNCH / "explore.launch"), ["sim:=true"])], None)
    assert len({p.value for name, p in config.params.items() if name.endswith("/out")}) == 1


def test_simulated_calibration_is_not_taken_for_the_robots() -> None:
    files = [parameter("calibrate_mount.launch", "/calibrate_mount_node/out", f"sim:={sim}") for sim in ("true", "false")]
    assert files[1] == str(Path.home() / ".ros/explore_3dnav/mount_calibration.yaml") and files[0] != files[1]


def test_every_node_that_reads_a_lidar_loads_the_one_file() -> None:
    config = load_config_default([(str(LAUNCH / "explore.launch"), ["sensor:=spinning"])], None)
    loaded = {name.split("/")[1] for name in config.params if name.endswith("/lidar/rings")}
    assert loaded == {node for node, sections in NODE_CONFIGS.items() if "lidar" in sections}


def test_description_that_a_robots_drivers_loaded_is_not_replaced_by_the_huskys() -> None:
    """Else another robot would drive with the Husky's outline, and nothing would contradict."""
    for file in ("explore.launch", "calibrate_mount.launch"):
        for arguments, is_loaded in ((["sim:=false"], False), (["sim:=false", f"urdf:={URDF}"], True), (["sim:=true"], True)):
            config = load_config_default([(str(LAUNCH / file), arguments)], None)
            assert ("/robot_description" in config.params) == is_loaded, (file, arguments)
            assert "robot_state_publisher" not in {node.name for node in config.nodes} or is_loaded


def test_what_an_earlier_launch_set_on_a_master_that_lives_on_is_cleared() -> None:
    """Else its zones, its misspelt parameters and its nodes that were given up are those of this launch."""
    for ns in ("", "left"):
        config = load_config_default([(str(LAUNCH / "explore.launch"), ["sim:=true", "markers:=true", f"ns:={ns}"])], None)
        own = {f"/{ns}/{node.name}/".replace("//", "/") for node in config.nodes if node.package == "explore_3dnav"}
        beside = {f"/{ns}/{name}/".replace("//", "/") for name in ("robot", "revival")}
        assert {f"/{ns}/{node}/".replace("//", "/") for node in NODE_CONFIGS if node in {n.name for n in config.nodes}} <= own
        assert own | beside <= {cleared.rstrip("/") + "/" for cleared in config.clear_params}


def test_recorder_makes_its_folder_hears_topics_that_a_robot_calls_otherwise_and_keeps_earlier_bags(tmp_path: Path) -> None:
    robot = tmp_path / "my_robot.launch"
    explore = f'<include file="{LAUNCH / "explore.launch"}" pass_all_args="true"/>'
    robot.write_text(f'<launch><remap from="/scan" to="/front/scan"/>{explore}</launch>', encoding="utf-8")

    def recorder(file: Path, *words: str) -> Node:
        config = load_config_default([(str(file), ["sim:=false", "record:=true", f"out:={tmp_path / 'new'}", *words])], None)
        return next(node for node in config.nodes if node.name == "record")

    assert ["/scan", "/front/scan"] in recorder(robot).remap_args
    assert ["/scan", "scan"] in recorder(LAUNCH / "explore.launch", "ns:=left").remap_args

    def written(*arguments: str) -> str:
        node = recorder(robot, *arguments)
        words = [*shlex.split(node.launch_prefix), "echo", *node.args.split()]
        said = subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True).stdout.split()
        assert said[0] == "-O" and {"/clock", "/scan", "/exploration/event"} <= set(said[2:]) and len(said) == len(node.args.split())
        assert Path(said[1]).parent == tmp_path / "new" and (tmp_path / "new").is_dir()
        return Path(said[1]).name

    assert (written(), written("resume:=true")) == ("run.bag", "run.bag")
    (tmp_path / "new" / "run.bag").touch()
    assert (written("resume:=true"), written()) == ("run_2.bag", "run_2.bag")
    (tmp_path / "new" / "run_2.bag.active").touch()
    assert written("resume:=true") == "run_3.bag"
