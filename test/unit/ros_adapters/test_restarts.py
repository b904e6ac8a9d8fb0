"""Who asks a node that is started again asks again; the monitor waits for such a node, and for no other."""

import os
import re
import threading
import time

import pytest
import rospy

from node_life import Life
from node_life.life import PULSE
from ros_adapters import asking, restarts
from ros_adapters.asking import AskedService, is_waiting
from ros_adapters.liveness import why_it_stays_away


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


def test_node_that_is_started_again_is_waited_for_and_no_other() -> None:
    above = {"pid": os.getpid(), "times": 1}
    assert why_it_stays_away("a", {}, 0.0) == "a"
    assert why_it_stays_away("a", {"a": above}, 10.0) == ""
    assert "away for 70 s" in why_it_stays_away("a", {"a": above}, 70.0)
    assert "3 times" in why_it_stays_away("a", {"a": {**above, "gave_up": "3 times within 60 s"}}, 0.0)
    assert "what starts it again" in why_it_stays_away("a", {"a": {"pid": 2**22 + 1}}, 0.0)


def beats_in(seconds: float, lock: threading.RLock) -> int:  # type: ignore[valid-type]
    reading, writing = os.pipe()
    os.set_blocking(reading, False)
    restarts.pulse(Life({PULSE: str(writing)}), lock)
    time.sleep(seconds)
    try:
        return len(os.read(reading, 1000))
    except BlockingIOError:
        return 0


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(restarts, "_PERIOD_S", 0.01)


def test_node_whose_lock_is_free_beats(quick: None) -> None:
    assert beats_in(0.5, threading.RLock()) > 0


def test_node_whose_callback_never_ends_does_not_beat(quick: None) -> None:
    lock, held = threading.RLock(), threading.Event()

    def hang() -> None:
        with lock:
            held.set()
            time.sleep(1.0)

    threading.Thread(target=hang, daemon=True).start()
    held.wait()
    assert beats_in(0.5, lock) == 0


def test_node_that_waits_for_another_beats(quick: None, monkeypatch: pytest.MonkeyPatch) -> None:
    lock, held = threading.RLock(), threading.Event()
    monkeypatch.setattr(restarts, "is_waiting", lambda: True)

    def wait() -> None:
        with lock:
            held.set()
            time.sleep(1.0)

    threading.Thread(target=wait, daemon=True).start()
    held.wait()
    assert beats_in(0.5, lock) > 0
