"""What ./replay is asked to do, what it refuses, and what it hands to the launch file."""

from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from explore_command.arguments import ArgumentProblem
from run_replay.arguments import parse
from run_replay.bag_topics import BUILT_FROM_SWEEPS, SWEEPS, bag_problem, shown_topics
from run_replay.launching import launch_arguments


def run_folder(folder: Path, *names: str) -> Path:
    """A folder with empty files of these names."""
    for name in names or ("run.json", "trajectory.txt", "sweeps/index.json", "cloud.ply"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()
    return folder


def bag(path: Path, topic: str) -> Path:
    """A bag with one message, a string, on a topic."""
    store = get_typestore(Stores.ROS1_NOETIC)
    message = store.types["std_msgs/msg/String"](data="x")
    with Writer(path) as writer:
        connection = writer.add_connection(topic, "std_msgs/msg/String", typestore=store)
        writer.write(connection, 1_000_000_000, np.asarray(store.serialize_ros1(message, "std_msgs/msg/String")).tobytes())
    return path


def test_folder_is_played_ten_times_as_fast_as_it_was(tmp_path: Path) -> None:
    folder = run_folder(tmp_path / "run")
    arguments = parse([str(folder), "--headless"])
    assert (arguments.run, arguments.bag, arguments.other, arguments.speed) == (folder, None, None, 10.0)
    assert launch_arguments(arguments) == {"run": folder, "other": "", "bag": "", "speed": "10", "rviz": "false"}


def test_bag_is_known_by_being_a_file(tmp_path: Path) -> None:
    path = bag(tmp_path / "run.bag", "/plan")
    arguments = parse([str(path), "--headless", "--speed", "0"])
    assert (arguments.run, arguments.bag, arguments.speed) == (None, path, 0.0)


def test_two_folders_are_compared(tmp_path: Path) -> None:
    a, b = run_folder(tmp_path / "a"), run_folder(tmp_path / "b")
    arguments = parse(["--compare", str(a), str(b), "--headless"])
    assert (arguments.run, arguments.other) == (a, b)


def refusal(*words: object) -> str:
    with pytest.raises(ArgumentProblem) as found:
        parse([str(word) for word in words])
    assert "\n" not in str(found.value)
    return str(found.value)


def test_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    assert refusal(tmp_path / "nowhere", "--headless") == f"{tmp_path / 'nowhere'}: no such folder or file"


def test_folder_of_something_else_says_what_is_missing(tmp_path: Path) -> None:
    assert refusal(tmp_path, "--headless").endswith("not the folder of a run: trajectory.txt and sweeps/index.json are not there")


def test_run_that_never_ended_says_what_is_missing(tmp_path: Path) -> None:
    run_folder(tmp_path, "run.json", "sweeps/index.json")
    assert refusal(tmp_path, "--headless").endswith("not the folder of a finished run: trajectory.txt is not there")


def test_comparison_of_one_folder_is_refused(tmp_path: Path) -> None:
    assert "--compare: expected 2 arguments" in refusal("--compare", run_folder(tmp_path), "--headless")


def test_comparison_with_a_bag_is_refused(tmp_path: Path) -> None:
    a, b = run_folder(tmp_path / "a"), bag(tmp_path / "b.bag", "/plan")
    assert "only the folders of runs" in refusal("--compare", a, b, "--headless")


def test_nothing_or_two_things_to_show_are_refused(tmp_path: Path) -> None:
    folder = str(run_folder(tmp_path))
    assert "one of them only" in refusal("--headless")
    assert "one of them only" in refusal(folder, "--compare", folder, folder, "--headless")


@pytest.mark.parametrize("speed", ["-1", "nan", "inf", "fast"])
def test_speed_that_is_none_is_refused(tmp_path: Path, speed: str) -> None:
    assert "--speed" in refusal(run_folder(tmp_path), f"--speed={speed}", "--headless")


def test_comparison_has_no_speed(tmp_path: Path) -> None:
    folder = run_folder(tmp_path)
    assert "--speed" in refusal("--compare", folder, folder, "--speed", "2", "--headless")


def test_without_display_it_says_how_to_do_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    assert "--headless" in refusal(run_folder(tmp_path))


def test_file_that_is_no_bag_is_refused(tmp_path: Path) -> None:
    (tmp_path / "run.bag").write_bytes(b"no bag")
    assert "cannot be read" in refusal(tmp_path / "run.bag", "--headless")


def test_empty_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "run.bag").touch()
    assert "cannot be read" in refusal(tmp_path / "run.bag", "--headless")


def test_bag_that_was_cut_off_is_refused(tmp_path: Path) -> None:
    path = bag(tmp_path / "run.bag", "/plan")
    path.write_bytes(path.read_bytes()[:-40])
    assert "cannot be read" in refusal(path, "--headless")


def test_bag_of_other_things_is_refused(tmp_path: Path) -> None:
    problem = bag_problem(bag(tmp_path / "other.bag", "/chatter"))
    assert problem is not None and "nothing to show" in problem and SWEEPS in problem


def test_map_comes_from_the_sweeps_or_else_from_the_bag() -> None:
    assert shown_topics(frozenset({"/tf", "/chatter", SWEEPS, *BUILT_FROM_SWEEPS})) == {"/tf", SWEEPS}
    assert shown_topics(frozenset({"/tf", "/chatter", *BUILT_FROM_SWEEPS})) == {"/tf", *BUILT_FROM_SWEEPS}
