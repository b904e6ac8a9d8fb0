"""A bad hand: a seed draws what it does, it does that to running processes, and never more than a node is promised to survive."""

import csv
import itertools
import os
import re
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from evaluation_campaign.chaos import FAULTS, KILL, KINDS, STARVE, STOP, BadHand, Blow, ChaosConfig, blows, faults, node_pid, told
from explore_command.parameters import ROBOT_NODES
from pybullet_simulation import TimingConfig

ROOT = Path(__file__).resolve().parents[3]
COUNTS = (
    "import pathlib, sys, time\nn = 0\nwhile True:\n    n += 1\n    pathlib.Path(sys.argv[1]).write_text(str(n))\n    time.sleep(0.005)\n"
)


def test_nodes_are_those_that_the_launch_files_start_again() -> None:
    launched = "".join(path.read_text() for path in (ROOT / "launch").glob("*.launch"))
    revived = re.findall(r'<node [^>]*type="(\w+)"[^>]*node_revival', launched)
    assert sorted(ROBOT_NODES) == sorted(revived)


def test_seed_draws_the_blows_and_each_node_has_its_turn() -> None:
    first, again, other = (list(itertools.islice(blows(seed, ChaosConfig()), 220)) for seed in ("1", "1", "2"))
    assert first == again != other
    assert Counter(blow.node for blow in first) == dict.fromkeys(ROBOT_NODES, 20)
    assert {blow.kind for blow in first} == set(KINDS)
    assert all((blow.lasts_s == 0.0) == (blow.kind == KILL) and blow.lasts_s <= 20.0 for blow in first)


def test_faults_are_those_of_the_simulator_s_sensors() -> None:
    config = TimingConfig(faults=faults("1", 1800.0))
    assert not config.validate()
    found = config.sensor_faults()
    assert 50 < len(found) < 130 and faults("1", 1800.0) == config.faults != faults("2", 1800.0)
    assert all(0.0 < one.end_s - one.begin_s < 1.1 for one in found) and {one.kind for one in found} == set(FAULTS)


@pytest.fixture
def node(tmp_path: Path) -> Iterator[Callable[[str], "subprocess.Popen[bytes]"]]:
    """Starts a process that counts into a file, by the name of a node."""
    started = []

    def start(name: str) -> "subprocess.Popen[bytes]":
        counter = tmp_path / name
        started.append(subprocess.Popen([sys.executable, "-c", COUNTS, str(counter), f"__name:={name}"]))
        while not counter.exists():
            time.sleep(0.01)
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.wait()


def struck(tmp_path: Path, *plan: Blow) -> list[dict[str, str]]:
    """What a hand tells of its plan, struck at the children of this process."""
    BadHand(os.getpid(), tmp_path / "log", tmp_path / "chaos.csv").work(iter(plan))
    with (tmp_path / "chaos.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_node_is_killed_and_what_it_did_then_is_told(tmp_path: Path, node: Callable) -> None:
    process = node("move_base_node")
    (tmp_path / "log").write_text("x\nt=12.5 s x3.1, 2 sweeps, 4 m | driving: goal\nt=13.0 s, 2 sweeps, 4 m | sweeping\nbye\n")
    row = struck(tmp_path, Blow(0.0, KILL, "move_base_node", 0.0))[0]
    assert process.wait(60.0) == -9
    assert (row["kind"], row["node"], row["sim_s"], row["doing"]) == ("kill", "move_base_node", "13.0", "sweeping")
    assert told(tmp_path, {"move_base_node": 2}) == {"kill": 1, "stop": 0, "starve": 0, "restarts": 2}


@pytest.mark.parametrize("kind", [STOP, STARVE])
def test_node_that_was_stopped_or_starved_works_again_afterwards(tmp_path: Path, node: Callable, kind: str) -> None:
    process = node("move_base_node")
    struck(tmp_path, Blow(0.0, kind, "move_base_node", 0.5))
    before = (tmp_path / "move_base_node").read_text()
    deadline = time.monotonic() + 20.0
    while (tmp_path / "move_base_node").read_text() in (before, "") and time.monotonic() < deadline:
        time.sleep(0.01)
    assert process.poll() is None and (tmp_path / "move_base_node").read_text() not in (before, "")


def test_node_that_is_killed_meanwhile_is_held_no_longer(tmp_path: Path, node: Callable) -> None:
    process = node("move_base_node")
    subprocess.Popen(["sh", "-c", f"sleep 0.3; kill -9 {process.pid}"])
    row = struck(tmp_path, Blow(0.0, STOP, "move_base_node", 300.0))[0]
    assert float(row["lasts_s"]) < 100.0


def test_node_is_not_struck_a_third_time_within_a_minute(tmp_path: Path, node: Callable) -> None:
    node("move_base_node")
    node("scan_filter_node")
    plan = [Blow(0.0, STOP, "move_base_node", 0.01)] * 3 + [Blow(0.0, STOP, "scan_filter_node", 0.01)]
    assert [row["node"] for row in struck(tmp_path, *plan)] == ["move_base_node", "move_base_node", "scan_filter_node"]


def test_blows_come_in_simulated_time(tmp_path: Path, node: Callable) -> None:
    log, names = tmp_path / "log", ROBOT_NODES[:3]
    for name in names:
        node(name)
    log.write_text("")
    hand = BadHand(os.getpid(), log, tmp_path / "chaos.csv")
    at_work = threading.Thread(target=hand.work, args=(iter([Blow(2.0, STOP, name, 0.01) for name in names]),))
    at_work.start()
    done = []
    for clock_s, due in ((0.0, 0), (1.9, 0), (2.0, 1), (3.9, 1), (4.0, 2)):
        log.write_text(f"t={clock_s} s, 2 sweeps | driving\n")
        at_work.join(1.0)
        deadline = time.monotonic() + 20.0
        while told(tmp_path, {})["stop"] < due and time.monotonic() < deadline:
            time.sleep(0.05)
        done.append(told(tmp_path, {})["stop"])
    hand.over.set()
    at_work.join(20.0)
    assert done == [0, 0, 1, 1, 2] and not at_work.is_alive()


def test_blow_comes_where_the_clock_stands_for_long(tmp_path: Path, node: Callable) -> None:
    process = node("move_base_node")
    (tmp_path / "log").write_text("t=1.0 s, 2 sweeps | driving\n")
    hand = BadHand(os.getpid(), tmp_path / "log", tmp_path / "chaos.csv", ChaosConfig(standing_s=0.5))
    hand.work(iter([Blow(60.0, KILL, "move_base_node", 0.0)]))
    assert process.wait(60.0) == -9


def test_node_that_does_not_run_is_passed_over_and_no_other_is_taken_for_it(tmp_path: Path, node: Callable) -> None:
    node("octomap_server_3dnav_local_node")
    assert node_pid(os.getpid(), "octomap_server_3dnav_node") is None
    assert struck(tmp_path, Blow(0.0, KILL, "octomap_server_3dnav_node", 0.0)) == []
