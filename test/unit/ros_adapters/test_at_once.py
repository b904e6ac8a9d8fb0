"""What a node does at once is not held up by the rest, which follows in order and survives its errors."""

import threading

from ros_adapters.at_once import beside


def test_what_waits_holds_up_nothing_and_follows_in_order() -> None:
    goes_on, all_done = threading.Event(), threading.Event()
    at_once: list[int] = []
    taken: list[int] = []

    def take_in(message: int) -> None:
        goes_on.wait(10.0)
        taken.append(message)
        if len(taken) == 5:
            all_done.set()

    receive = beside(at_once.append, take_in)
    for message in range(5):
        receive(message)
    assert at_once == [0, 1, 2, 3, 4] and taken == []
    goes_on.set()
    assert all_done.wait(10.0) and taken == [0, 1, 2, 3, 4]


def test_error_of_one_message_stops_none_of_the_next() -> None:
    done = threading.Event()

    def take_in(message: str) -> None:
        if message == "bad":
            raise RuntimeError(message)
        done.set()

    receive = beside(lambda _: None, take_in)
    receive("bad")
    receive("good")
    assert done.wait(10.0)
