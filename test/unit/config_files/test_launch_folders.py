"""Where launch files write: no launch into the folder of an earlier one, and nothing that was simulated over what is the robot's."""

from pathlib import Path

from roslaunch.config import load_config_default

LAUNCH = Path(__file__).resolve().parents[3] / "launch"


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
