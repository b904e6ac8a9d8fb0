"""A process above a node starts it again when it was killed, broke or hangs, gives it up when it dies too often, and keeps its memory."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import node_revival.__main__
from node_life import Deaths, Life, RevivalConfig, Watch, processor_s
from node_life.life import MEMORY
from node_revival.__main__ import Revival, forget_dead

LIVES = "from node_life import Life; import os, sys, time, signal, pathlib; life = Life(); log = pathlib.Path(sys.argv[1])\n"


@pytest.fixture
def revive(tmp_path: Path) -> Iterator[object]:
    """Starts a node of one line of Python below a process that revives it; it writes to the file of its first argument."""
    started: list[subprocess.Popen[str]] = []

    def start(body: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "node_revival", sys.executable, "-c", LIVES + body, str(tmp_path / "log"), "__name:=a_node"]
        command.append(f"__log:={tmp_path}/a_node.log")
        environment = {**os.environ, "ROS_MASTER_URI": "http://localhost:1", "TMPDIR": str(tmp_path)}
        started.append(subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True))
        return started[-1]

    yield start
    for process in started:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)


def lines(tmp_path: Path, count: int) -> list[str]:
    """The lines of the node's log, once there are so many."""
    deadline_s = time.monotonic() + 60.0
    while time.monotonic() < deadline_s:
        found = (tmp_path / "log").read_text().splitlines() if (tmp_path / "log").exists() else []
        if len(found) >= count:
            return found
        time.sleep(0.02)
    raise AssertionError(f"no {count} lines")


KEEPS_ITS_NAME = """
first = life.kept("pid", None)
life.keep("pid", first or os.getpid())
life.beat()
log.open("a").write(f"{os.getpid()} {first} {life.is_first}\\n")
life.begun()
time.sleep(600)
"""


def test_killed_node_is_started_again_and_remembers(revive, tmp_path: Path) -> None:
    process = revive(KEEPS_ITS_NAME)
    (line,) = lines(tmp_path, 1)
    first, kept, is_first = line.split()
    assert (kept, is_first) == ("None", "True")
    os.kill(int(first), signal.SIGKILL)
    second, kept, is_first = lines(tmp_path, 2)[1].split()
    assert second != first and kept == first and is_first == "False"
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(30.0) != 0  # python's own end by an interrupt
    assert "a_node died: killed by signal 9; it is started again" in process.stderr.read()
    assert not [left for root in (Path("/dev/shm"), tmp_path) for left in root.glob(f"explore_3dnav_{process.pid}_*")]


@pytest.mark.parametrize("code", [0, 2])
def test_node_that_ends_by_itself_or_of_a_wrong_parameter_stays_ended(revive, tmp_path: Path, code: int) -> None:
    process = revive(f"log.open('a').write('lived\\n'); sys.exit({code})")
    assert process.wait(60.0) == code
    assert len(lines(tmp_path, 1)) == 1


def test_node_that_has_said_that_it_ends_stays_ended_however_it_does(revive, tmp_path: Path) -> None:
    process = revive("log.open('a').write('lived\\n'); life.beat(); life.ends(); time.sleep(1.0); os.kill(os.getpid(), signal.SIGKILL)")
    assert process.wait(60.0) == 128 + signal.SIGKILL
    assert len(lines(tmp_path, 1)) == 1


def test_node_that_dies_three_times_in_a_minute_is_given_up(revive, tmp_path: Path) -> None:
    process = revive("log.open('a').write('lived\\n'); os.kill(os.getpid(), signal.SIGSEGV)")
    assert process.wait(60.0) == 128 + signal.SIGSEGV
    assert len(lines(tmp_path, 3)) == 3
    assert "a_node died too often: killed by signal 11" in process.stderr.read()


def test_stopped_node_is_ended_and_started_again(revive, tmp_path: Path) -> None:
    process = revive(KEEPS_ITS_NAME.replace("time.sleep(600)", "\nwhile True:\n life.beat(); time.sleep(0.1)"))
    first = int(lines(tmp_path, 1)[0].split()[0])
    os.kill(first, signal.SIGSTOP)
    second = int(lines(tmp_path, 2)[1].split()[0])
    assert second != first and not Path(f"/proc/{first}").exists()
    os.killpg(process.pid, signal.SIGINT)
    process.wait(30.0)
    assert "made no progress for" in process.stderr.read()


def test_node_that_hangs_says_where(revive, tmp_path: Path) -> None:
    revive(KEEPS_ITS_NAME.replace("time.sleep(600)", "\ndef in_vain():\n time.sleep(600)\nlife.show_stacks()\nin_vain()"))
    lines(tmp_path, 2)
    assert "in in_vain" in (tmp_path / "a_node.log.hung").read_text()


CONFIG = RevivalConfig(silent_s=5.0, busy_s=60.0, start_s=60.0)


def hung_at(watch: Watch, until_s: float, share: float) -> float | None:
    """When a process that works for a share of the time is judged hung, looked at four times a second; None if not by then."""
    now_s = 0.0
    while now_s < until_s:
        now_s += 0.25
        if watch.hung(now_s, share * now_s):
            return now_s
    return None


def test_silence_without_work_is_a_hang_and_work_is_none_until_it_has_no_end() -> None:
    watch = Watch(CONFIG, 0.0, has_beaten=True)
    assert 5.0 <= (hung_at(watch, 20.0, 0.02) or 0.0) <= 5.5
    watch = Watch(CONFIG, 0.0, has_beaten=True)
    assert 60.0 <= (hung_at(watch, 90.0, 1.0) or 0.0) <= 60.5


def test_node_has_time_to_start() -> None:
    assert hung_at(Watch(CONFIG, 0.0), 59.0, 0.0) is None
    assert hung_at(Watch(CONFIG, 0.0), 61.0, 0.0) is not None
    assert hung_at(Watch(CONFIG, 0.0), 600.0, 1.0) is None  # numba compiles


def test_node_has_time_to_end() -> None:
    watch = Watch(CONFIG, -100.0, has_beaten=True)
    watch.end(0.0)
    assert hung_at(watch, 59.0, 0.0) is None and hung_at(watch, 61.0, 0.0) is not None


def test_start_may_take_as_long_as_others_are_waited_for_and_then_its_time() -> None:
    watch = Watch(CONFIG, 0.0)
    for at_s in (50.0, 100.0, 150.0):
        assert not watch.hung(at_s - 0.1, 0.0)
        watch.beat(at_s, starts=True)
    assert not watch.has_beaten and hung_at(watch, 209.0, 0.0) is None and hung_at(watch, 211.0, 0.0) is not None
    watch.beat(300.0)
    watch.beat(301.0, starts=True)
    assert watch.has_beaten


def test_beat_begins_the_time_anew() -> None:
    watch = Watch(CONFIG, 0.0, has_beaten=True)
    assert not watch.hung(4.0, 0.0)
    watch.beat(4.5)
    assert hung_at(watch, 9.0, 0.0) is None


def test_deaths_of_more_than_a_minute_ago_do_not_count() -> None:
    deaths = Deaths(RevivalConfig(deaths=3, within_s=60.0))
    assert [deaths.too_many(t) for t in (0.0, 30.0, 61.0, 80.0)] == [False, False, False, True]


def test_work_of_any_thread_is_seen() -> None:
    before_s, begun_s = processor_s(os.getpid()), time.thread_time()
    while time.thread_time() - begun_s < 0.2:
        pass
    assert processor_s(os.getpid()) - before_s > 0.1


def test_threads_that_take_turns_at_pythons_lock_work() -> None:
    over = threading.Event()

    def compute() -> None:
        while not over.is_set():
            pass

    at_work = [threading.Thread(target=compute) for _ in range(4)]  # a quarter of the time each
    for thread in at_work:
        thread.start()
    before_s, begun_s = processor_s(os.getpid()), time.monotonic()
    time.sleep(1.0)
    share = (processor_s(os.getpid()) - before_s) / (time.monotonic() - begun_s)
    over.set()
    for thread in at_work:
        thread.join()
    assert share > CONFIG.busy_share


def test_what_was_being_written_at_death_is_left_out(tmp_path: Path) -> None:
    life = Life({MEMORY: str(tmp_path)})
    life.note("calls", (1, "a"))
    life.note("calls", (2, "b"))
    whole = (tmp_path / "calls").read_bytes()
    (tmp_path / "calls").write_bytes(whole[:-3])
    assert life.notes("calls") == [(1, "a")]
    life.forget("calls")
    assert life.notes("calls") == [] and life.kept("calls", None) is None


def test_memory_that_cannot_be_written_is_told_and_stops_nobody(tmp_path: Path) -> None:
    life = Life({MEMORY: str(tmp_path)})
    life.keep("state", 1)
    (tmp_path / "state.new").mkdir()
    life.keep("state", 2)
    assert "state" in life.problem and life.kept("state", 0) == 1
    (tmp_path / "state.new").rmdir()
    life.keep("state", 3)
    assert not life.problem and life.kept("state", 0) == 3


def test_memory_of_a_process_that_was_killed_is_removed_and_no_other(tmp_path: Path) -> None:
    dead, living = tmp_path / f"explore_3dnav_{2**22 + 1}_x", tmp_path / f"explore_3dnav_{os.getpid()}_y"
    for folder in (dead, living):
        folder.mkdir()
        (folder / "state").touch()
    forget_dead(tmp_path)
    assert not dead.exists() and (living / "state").exists()


def test_without_a_process_above_it_nothing_is_kept() -> None:
    life = Life({})
    life.keep("x", 1)
    life.note("y", 1)
    life.beat()
    assert life.is_first and life.kept("x", None) is None and life.notes("y") == []


def test_memory_without_room_keeps_what_it_has_and_says_so(tmp_path: Path, files_of_at_most) -> None:
    life = Life({MEMORY: str(tmp_path)})
    life.keep("state", "small")
    with files_of_at_most(1000):
        life.keep("state", "large" * 1000)
    assert "state: files here may not be so large" in life.problem
    assert life.kept("state", "") == "small" and [p.name for p in tmp_path.iterdir()] == ["state"]
    life.keep("state", "new")
    assert (life.kept("state", ""), life.problem) == ("new", "")


def test_what_is_kept_of_one_thing_hides_nothing_of_another(tmp_path: Path, files_of_at_most) -> None:
    life = Life({MEMORY: str(tmp_path)})
    with files_of_at_most(1000):
        life.keep("map", "large" * 1000)
        life.keep("state", "small")
        assert "map: " in life.problem


def test_note_that_has_no_room_hides_no_later_one(tmp_path: Path, files_of_at_most) -> None:
    life = Life({MEMORY: str(tmp_path)})
    life.note("notes", "first")
    with files_of_at_most(1000):
        life.note("notes", "large" * 1000)
        life.note("notes", "second")
    assert life.notes("notes") == ["first", "second"]


def test_without_room_for_a_memory_a_node_lives_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.setattr(node_revival.__main__, "_ROOTS", ("/proc/nowhere", str(tmp_path / "gone")))
    body = "import pathlib, sys; pathlib.Path(sys.argv[1]).open('a').write('lived '); sys.exit(1)"
    assert node_revival.__main__.main([sys.executable, "-c", body, str(tmp_path / "log"), "__name:=a_node"]) == 1
    assert (tmp_path / "log").read_text() == "lived "
    assert "nothing is kept for a restart: /proc/nowhere/" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "environment", "key"),
    [
        (["__name:=a_node"], {}, "/revival/a_node/pid"),
        (["__name:=a_node"], {"ROS_NAMESPACE": "/left"}, "/left/revival/a_node/pid"),
        (["__name:=a_node"], {"ROS_NAMESPACE": "/"}, "/revival/a_node/pid"),
        (["__name:=a_node", "__ns:=site/left/"], {"ROS_NAMESPACE": "/right"}, "/site/left/revival/a_node/pid"),
    ],
)
def test_what_is_told_of_a_node_stands_in_its_namespace(
    monkeypatch: pytest.MonkeyPatch, words: list[str], environment: dict[str, str], key: str
) -> None:
    told: list[str] = []

    class Server:
        def __init__(self, _address: str) -> None: ...

        def setParam(self, _caller: str, name: str, _value: object) -> None:  # the master's name for it
            told.append(name)

    monkeypatch.delenv("ROS_NAMESPACE", raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr("xmlrpc.client.ServerProxy", Server)
    monkeypatch.setattr("signal.signal", lambda *_: None)
    assert Revival(["true", *words], None, RevivalConfig()).run() == 0
    assert told == [key, key.replace("/pid", "/gave_up")]
