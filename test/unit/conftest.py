"""What tests of several packages share."""

import resource
import signal
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

import pytest
from hypothesis import settings

settings.load_profile("ci")  # no example has a time limit, and each run tries the same: how quick a machine is decides nothing


@pytest.fixture(autouse=True)
def signals_as_they_were() -> Iterator[None]:
    """A program's main that a test calls takes signals of the test's own process: the next test is not to inherit that."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@contextmanager
def _files_of_at_most(size: int) -> Iterator[None]:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture
def files_of_at_most() -> Callable[[int], AbstractContextManager[None]]:
    """While it lasts, writes beyond so many bytes of a file fail, as on a full disk."""
    return _files_of_at_most
