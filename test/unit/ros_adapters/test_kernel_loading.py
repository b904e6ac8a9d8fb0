"""A node whose kernels have to be compiled says so, again and again; one that finds them in the cache says nothing."""

import threading

import pytest
import rospy

from ros_adapters import kernel_loading
from ros_adapters.kernel_loading import LOADING_TOPIC, load_kernels


class Listener:
    """Hears what is published on LOADING_TOPIC; `thrice` is set by the third message."""

    def __init__(self) -> None:
        self.messages: list[str] = []
        self.thrice = threading.Event()

    def __call__(self, topic: str, *_: object, **__: object) -> "Listener":
        assert topic == LOADING_TOPIC
        return self

    def publish(self, message: object) -> None:
        self.messages.append(message.data)
        if len(self.messages) == 3:
            self.thrice.set()

    def unregister(self) -> None: ...


@pytest.fixture
def listener(monkeypatch: pytest.MonkeyPatch) -> Listener:
    """To nodes that find every cache slow."""
    made = Listener()
    monkeypatch.setattr(rospy, "Publisher", made)
    monkeypatch.setattr(kernel_loading, "_TELL_AFTER_S", 0.01)
    monkeypatch.setattr(kernel_loading, "_TELL_EVERY_S", 0.01)
    return made


def test_node_that_compiles_says_so_again_and_again(listener: Listener, capsys: pytest.CaptureFixture[str]) -> None:
    load_kernels("some_node", lambda: listener.thrice.wait(30.0))
    assert listener.messages[:3] == ["some_node"] * 3
    assert capsys.readouterr().err.count("some_node: loads its kernels") == 1


def test_node_with_a_full_cache_says_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    loaded: list[str] = []
    load_kernels("some_node", lambda: loaded.append("first"), lambda: loaded.append("second"))
    assert loaded == ["first", "second"]
    assert not capsys.readouterr().err


def test_kernel_that_does_not_compile_ends_the_word(listener: Listener) -> None:
    def broken() -> None:
        listener.thrice.wait(30.0)
        raise RuntimeError("no compiler")

    before = threading.active_count()
    with pytest.raises(RuntimeError):
        load_kernels("some_node", broken)
    assert threading.active_count() == before
