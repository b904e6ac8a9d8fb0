"""Who asks a node that is started again asks again; the monitor waits for such a node, and for no other."""

import os
import re
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
import rospy

from node_life import REFUSED, Life
from node_life.life import BEAT, ENDING, MEMORY, PULSE, STILL_STARTING
from ros_adapters import asking, restarts, served_map, session_keeper
from ros_adapters.asking import AskedService, is_waiting
from ros_adapters.diagnostics import Diagnostics
from ros_adapters.driving_memory import DrivingMemory
from ros_adapters.liveness import Liveness, why_it_stays_away
from ros_adapters.mapping_mode import OpenSweeps, Results, ResultTimes
from stop_scan_and_go import ScanWhileDriving, StopScanAndGoConfig


class Server:
    """In the place of rospy's proxy: each call is answered as the script says; the last answer stays."""

    def __init__(self, *script: object) -> None:
        self.script, self.calls, self.asked_meanwhile = list(script), 0, False

    def __call__(self, _name: str, _type: type, persistent: bool = False) -> "Server":
        assert persistent
        return self.answer  # type: ignore[return-value]

    def answer(self, *_arguments: object) -> object:
        self.calls += 1
        self.asked_meanwhile = is_waiting()
        now = self.script.pop(0) if len(self.script) > 1 else self.script[0]
        if isinstance(now, Exception):
            raise now
        return now


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch):
    def serve(*script: object) -> Server:
        server = Server(*script)
        monkeypatch.setattr(asking.rospy, "ServiceProxy", server)
        monkeypatch.setattr(asking, "_AGAIN_S", 0.001)
        return server

    return serve


BROKEN = rospy.ServiceException("transport error completing service call: receive_once[/x]: unable to receive data")
ABSENT = rospy.ServiceException("unable to connect to service: [Errno 111] Connection refused")


@pytest.mark.parametrize("error", [BROKEN, ABSENT, rospy.exceptions.TransportTerminated("gone"), BrokenPipeError()])
def test_service_that_died_is_asked_again_until_it_answers(served, error: Exception) -> None:
    server = served(error, error, "yes")
    assert AskedService("x", object)() == "yes" and server.calls == 3
    assert server.asked_meanwhile and not is_waiting()


@pytest.mark.parametrize("words", ["service [/x] responded with an error: no map", "service [/x] unavailable"])
def test_server_that_does_not_want_and_one_that_nobody_knows_are_asked_once(served, words: str) -> None:
    server = served(rospy.ServiceException(words))
    with pytest.raises(rospy.ServiceException, match=re.escape(words)):
        AskedService("x", object)()
    assert server.calls == 1 and not is_waiting()


def test_server_that_has_answered_is_waited_for_while_it_begins_anew(served) -> None:
    """Its next process registers its name first, and then its services: in between the master does not know these."""
    server = served("yes", rospy.ServiceException("service [/x] unavailable"), "yes again")
    service = AskedService("x", object)
    assert (service(), service(), server.calls) == ("yes", "yes again", 3)


def test_patience_has_an_end(served) -> None:
    served(ABSENT)
    with pytest.raises(rospy.ServiceException, match="x does not answer: unable to connect"):
        AskedService("x", object, patience_s=0.05)()


def test_server_that_was_started_anew_is_asked_anew_also_without_patience(served) -> None:
    """As a mount's driver that died between two sweeps: the connection of the first is gone, its server is not."""
    server = served("yes", BROKEN, "yes again", ABSENT)
    service = AskedService("x", object, patience_s=0.0)
    assert (service(), service(), server.calls, service.broken) == ("yes", "yes again", 3, 1)
    server = served(ABSENT)
    with pytest.raises(rospy.ServiceException, match="x does not answer"):
        AskedService("x", object, patience_s=0.0)()
    assert server.calls == 1


def test_server_that_hangs_is_given_up_and_not_asked_beside_itself(served) -> None:
    """As a mount's driver that hangs: who asks holds the lock under which the joystick is heard."""
    release, calls = threading.Event(), []
    server = served("late")
    server.answer = lambda *_: (calls.append(1), release.wait(10.0), "late")[2]
    service = AskedService("x", object, patience_s=0.0, limit_s=0.05)
    for _ in range(2):
        with pytest.raises(rospy.ServiceException, match="x does not answer within 0.05 s"):
            service()
    assert len(calls) == 1 and not is_waiting()
    release.set()
    service._asking.join(10.0)
    server.answer = lambda *_: "anew"
    service._proxy = None
    assert service() == "anew"


def test_error_of_a_server_with_a_limit_is_the_same(served) -> None:
    served(ABSENT)
    with pytest.raises(rospy.ServiceException, match="x does not answer: unable to connect"):
        AskedService("x", object, patience_s=0.0, limit_s=5.0)()


def test_server_that_has_been_there_by_another_s_word_is_waited_for(served) -> None:
    server = served(rospy.ServiceException("service [/x] unavailable"), "yes")
    service = AskedService("x", object, is_known=True)
    assert (service(), server.calls, service.broken) == ("yes", 2, 1)


class DyingTerrain:
    """In the place of the terrain node's service: its first process dies when it is given the third sweep."""

    def __init__(self, *_: object) -> None:
        self.broken, self.held = 0, []
        made.append(self)

    def __call__(self, vertex_id: int) -> SimpleNamespace:
        if vertex_id == 2 and not self.broken:
            self.broken, self.held = 1, []
        self.held.append(vertex_id)
        return SimpleNamespace(accepted=True)


made: list[DyingTerrain] = []


def test_terrain_node_that_dies_while_it_is_given_a_session_gets_all_of_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    made.clear()
    monkeypatch.setattr(session_keeper.rospy, "wait_for_service", lambda *_: None)
    monkeypatch.setattr(session_keeper, "AskedService", DyingTerrain)
    monkeypatch.setattr(session_keeper, "_message", lambda _store, _graph, vertex_id, _stamp_s: vertex_id)
    keeper = session_keeper.SessionKeeper(tmp_path, Diagnostics("x"))
    monkeypatch.setattr(keeper, "_store", SimpleNamespace(sweeps=[SimpleNamespace(vertex_id=k, stamp_s=float(k)) for k in range(4)]))
    assert keeper.hand_over(object()) == []
    assert set(made[0].held) == {0, 1, 2, 3}


def test_terrain_node_saves_only_when_its_map_is_that_of_the_process_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed as the run ended, it answered that no sweep is in the map yet; a service that is not there is asked for again."""
    served: list[str] = []
    node = SimpleNamespace(run_folder=lambda: None, publisher=lambda *_, **__: None, serve=lambda name, *_: served.append(name))
    node.diagnostics = SimpleNamespace(on_terminal=lambda *_: None)
    monkeypatch.setattr(served_map, "PlanServices", lambda *_: None)
    found = served_map.ServedMap(node, None, SimpleNamespace(explorer=None, timing=None), None, None)
    assert "~save" not in served
    found.serve_saving()
    assert "~save" in served


def test_node_that_is_started_again_is_waited_for_and_no_other() -> None:
    above = {"pid": os.getpid(), "times": 1}
    assert why_it_stays_away("a", {}, 0.0) == "a"
    assert why_it_stays_away("a", {"a": above}, 10.0) == ""
    assert "away for 70 s" in why_it_stays_away("a", {"a": above}, 70.0)
    assert "3 times" in why_it_stays_away("a", {"a": {**above, "gave_up": "3 times within 60 s"}}, 0.0)
    assert "what starts it again" in why_it_stays_away("a", {"a": {"pid": 2**22 + 1}}, 0.0)


def test_decision_that_comes_twice_before_its_time_takes_effect_once() -> None:
    memory = DrivingMemory(ScanWhileDriving(StopScanAndGoConfig()), OpenSweeps(ResultTimes(), driving=True))
    results, taken = Results(ResultTimes(), lockstep=True, driving=True), []
    for stamp_s in (2.0, 2.0, 4.0):
        results.add(stamp_s, lambda stamp_s=stamp_s: taken.append(stamp_s) if memory.takes(stamp_s) else None)
    results.take_until(10.0)
    assert taken == [2.0, 4.0]


def test_restarts_are_those_of_now_and_without_a_master_the_last_that_were_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    liveness = Liveness(["a"])
    for answer, known in (({}, {}), ({"a": {"pid": 1, "times": 2}, "b": {"pid": 2}}, {"a": 2}), (OSError("no master"), {"a": 2})):
        monkeypatch.setattr(liveness, "revived", Server(answer).answer)
        assert liveness.restarts() == known


def beats_in(seconds: float, lock: threading.RLock, beat: bytes = BEAT, *, runs: bool = True) -> int:  # type: ignore[valid-type]
    reading, writing = os.pipe()
    os.set_blocking(reading, False)
    restarts.pulse(Life({PULSE: str(writing)}), lock, lambda: runs)
    time.sleep(seconds)
    try:
        return os.read(reading, 1000).count(beat)
    except BlockingIOError:
        return 0


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(restarts, "_PERIOD_S", 0.01)


def test_node_whose_lock_is_free_beats(quick: None) -> None:
    assert beats_in(0.5, threading.RLock()) > 0


@pytest.mark.parametrize(("is_alive", "said"), [(True, ENDING), (False, b"")])
def test_node_that_is_asked_to_end_says_so_and_one_that_an_error_ended_does_not(
    quick: None, monkeypatch: pytest.MonkeyPatch, is_alive: bool, said: bytes
) -> None:
    hooks = []
    monkeypatch.setattr(restarts.rospy, "on_shutdown", hooks.append)
    reading, writing = os.pipe()
    os.set_blocking(reading, False)
    restarts.pulse(Life({PULSE: str(writing)}), threading.RLock(), lambda: False)  # type: ignore[arg-type]
    monkeypatch.setattr(restarts.threading, "main_thread", lambda: SimpleNamespace(is_alive=lambda: is_alive))
    hooks[0]()
    os.write(writing, b"|")
    assert os.read(reading, 1000) == said + b"|"


def test_node_whose_callback_never_ends_does_not_beat(quick: None) -> None:
    lock, held, over = threading.RLock(), threading.Event(), threading.Event()

    def hang() -> None:
        with lock:
            held.set()
            over.wait(60.0)

    threading.Thread(target=hang, daemon=True).start()
    held.wait()
    assert beats_in(0.5, lock) == 0
    over.set()


def test_node_that_starts_beats_only_while_it_waits_for_another(quick: None, monkeypatch: pytest.MonkeyPatch) -> None:
    assert beats_in(0.3, threading.RLock(), STILL_STARTING, runs=False) == 0 == beats_in(0.3, threading.RLock(), runs=False)
    monkeypatch.setattr(restarts, "is_waiting", lambda: True)
    assert beats_in(0.5, threading.RLock(), STILL_STARTING, runs=False) > 0 == beats_in(0.5, threading.RLock(), runs=False)


def test_node_that_waits_for_another_beats(quick: None, monkeypatch: pytest.MonkeyPatch) -> None:
    lock, held, over = threading.RLock(), threading.Event(), threading.Event()
    monkeypatch.setattr(restarts, "is_waiting", lambda: True)

    def wait() -> None:
        with lock:
            held.set()
            over.wait(60.0)

    threading.Thread(target=wait, daemon=True).start()
    held.wait()
    assert beats_in(0.5, lock) > 0
    over.set()


def test_node_that_ended_for_a_wrong_parameter_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    liveness = Liveness(["a", "b"])
    monkeypatch.setattr(liveness, "_is_gone", lambda _: False)  # neither has registered yet, nor is it late
    monkeypatch.setattr(
        liveness, "revived", lambda: {"a": {"pid": os.getpid(), "gave_up": REFUSED}, "b": {"pid": os.getpid(), "gave_up": ""}}
    )
    assert liveness.gone() == {"a": f"a ({REFUSED})"}


@pytest.mark.parametrize(("error", "words"), [(MemoryError(), "no memory is left"), (KeyError("wall"), "it breaks off: KeyError('wall')")])
def test_error_that_nobody_has_thought_of_ends_a_node_that_is_started_again(error, words, monkeypatch, capsys, tmp_path) -> None:
    codes: list[int] = []
    monkeypatch.setattr(restarts.os, "_exit", codes.append)
    restarts.break_off("a_node", Life({PULSE: "999", MEMORY: str(tmp_path)}), error)
    assert codes == [1] and words in capsys.readouterr().err


def test_where_nobody_starts_it_again_such_an_error_ends_no_node() -> None:
    with pytest.raises(KeyError, match="wall"):
        restarts.break_off("a_node", Life({}), KeyError("wall"))
