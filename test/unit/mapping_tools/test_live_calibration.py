"""./calibrate_mount NAME:=VALUE: it replaces nobody's nodes, and what is wrong with its arguments is one line at once."""

import threading
from collections.abc import Iterator
from pathlib import Path
from xmlrpc.server import SimpleXMLRPCServer

import pytest

from mapping_tools import live_calibration
from mapping_tools.live_arguments import HELP, live_arguments

ROOT = Path(__file__).resolve().parents[3]
RUNNING, KILLED = "/scan_filter_node", "/odometry_fusion_node"


class Master:
    """Knows one node that runs, itself, and one that was killed."""

    uri = ""

    def lookupNode(self, _caller: str, name: str) -> tuple[int, str, str]:
        uri = {RUNNING: self.uri, KILLED: "http://localhost:9/"}.get(name)
        return (1, "", uri) if uri else (-1, "unknown node", "")

    def getPid(self, _caller: str) -> tuple[int, str, int]:
        return 1, "", 1


@pytest.fixture
def master(monkeypatch: pytest.MonkeyPatch) -> Iterator[Master]:
    with SimpleXMLRPCServer(("localhost", 0), logRequests=False) as server:
        known = Master()
        known.uri = f"http://localhost:{server.server_address[1]}/"
        server.register_instance(known)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        monkeypatch.setenv("ROS_MASTER_URI", known.uri)
        yield known
        server.shutdown()


class Launch:
    """In the place of roslaunch: says what a node would."""

    stdout = ("...\n", "saved to mount.yaml\n")

    def wait(self) -> int:
        return 0


@pytest.fixture
def launched(monkeypatch: pytest.MonkeyPatch) -> list[int | None]:
    """The ports of all masters that would be started, None for the one that runs."""
    ports: list[int | None] = []

    def start(_file: str, _arguments: object, port: int | None, *_: object) -> Launch:
        ports.append(port)
        return Launch()

    monkeypatch.setattr(live_calibration, "start_launch", start)
    monkeypatch.setattr(live_calibration, "hand_on_signals", lambda _: [])
    monkeypatch.setattr(live_calibration, "free_port", lambda: 13100)
    return ports


def refusal(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert live_calibration.main(words) == 2
    text = capsys.readouterr().err
    assert text.startswith("./calibrate_mount: ") and text.count("\n") == 1
    return text


def test_nodes_of_a_running_exploration_are_not_replaced(
    master: Master, launched: list[int | None], capsys: pytest.CaptureFixture[str]
) -> None:
    text = refusal(capsys)
    assert RUNNING in text and "end the exploration" in text and KILLED not in text and launched == []


def test_nodes_of_another_robot_s_namespace_are_others(master: Master, launched: list[int | None], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_NAMESPACE", "left")
    assert live_calibration.main([]) == 0 and launched == [None]


def test_simulation_has_a_master_of_its_own(master: Master, launched: list[int | None]) -> None:
    assert live_calibration.main(["sim:=true"]) == 0 and launched == [13100]


def test_without_a_master_there_are_no_drivers(
    launched: list[int | None], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for uri in ("http://localhost:9", ""):
        monkeypatch.setenv("ROS_MASTER_URI", uri)
        assert f"no ROS master at {uri}" in refusal(capsys) and launched == []


@pytest.mark.parametrize(
    ("said", "interrupted", "code"),
    [
        ("saved to mount.yaml\n", False, 0),
        ("[calibrate_mount_node-5] process has died [pid 7, exit code 1, cmd ...", False, 1),
        ("[calibrate_mount_node-5] process has died [pid 7, exit code 2, cmd ...", False, 2),
        ("", False, 2),
        ("", True, 130),
    ],
)
def test_exit_code_is_by_what_was_said(said: str, interrupted: bool, code: int) -> None:
    assert live_calibration.exit_code(said, interrupted=interrupted) == code


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["sweeps:=0"], "sweeps:=0: expected a whole number from 1 to 100"),
        (["sweeps:=101"], "from 1 to 100"),
        (["sweeps:=nan"], "from 1 to 100"),
        (["worldd:=rooms"], "worldd:=rooms: expected NAME:=VALUE, with a NAME of robot_file, urdf, sweeps, mount_calibration, overrides"),
        (["rooms"], "rooms: expected NAME:=VALUE"),
        (["world:=rooms"], "add sim:=true"),
        (["sim:=maybe"], "sim:= is true or false"),
        (["sim:=true", "world:=romms"], "world:=romms: no such world or file; worlds are rooms, "),
        (["sim:=true", "seed:=-1"], "seed:=-1: expected a whole number from 0 on"),
        (["sim:=true", "rate:=inf"], "rate:=inf: expected a number from 0 on"),
        (["sim:=true", "rate:="], "rate:=: expected a number from 0 on"),
        (["sim:=true", "realism:=none"], "realism:=none: expected one of hardware, ideal"),
        (["robot_file:=none.yaml"], "robot_file:=none.yaml: no such file"),
        (["mount_calibration:=config"], "config: is a folder"),
        (["mount_calibration:=README.md/mount.yaml"], "README.md is a file, expected a folder"),
        (["robot_file:=config/robot.yaml", "mount_calibration:=./config/robot.yaml"], "is the input"),
    ],
)
def test_wrong_argument_is_one_line_before_anything_starts(
    words: list[str], told: str, launched: list[int | None], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    assert told in refusal(capsys, *words) and launched == []


def test_files_are_named_by_full_paths_because_nodes_run_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "house.sdf").touch()
    found = live_arguments(["sim:=TRUE", "world:=house.sdf", "mount_calibration:=mount.yaml", "models:=a:b", "sweeps:=3", "urdf:="])
    full = {"world": f"{tmp_path}/house.sdf", "mount_calibration": f"{tmp_path}/mount.yaml", "models": f"{tmp_path}/a:{tmp_path}/b"}
    assert found == {"sim": "true", "sweeps": "3", **full}
    assert live_arguments(["sim:=1", "world:=moon"]) == {"sim": "true", "world": "moon"}


def test_help_begins_with_the_usage_and_names_every_argument(capsys: pytest.CaptureFixture[str]) -> None:
    assert live_calibration.main(["sim:=true", "--help"]) == 0
    assert capsys.readouterr().out.startswith("usage: ./calibrate_mount")
    launch = (ROOT / "launch" / "calibrate_mount.launch").read_text()
    declared = {part.partition('"')[0] for part in launch.split('<arg name="')[1:]}
    assert len(declared) > 5 and all(f"{name}:=" in HELP for name in declared)
