"""Limits of the system are looked at before a run: what can be raised is raised, what cannot is told with what to do."""

import resource
from collections.abc import Iterator

import pytest

from explore_command import limits
from explore_command.limits import LEAST_FILES, limits_problem

FREE = resource.RLIM_INFINITY


@pytest.fixture
def system(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[int, tuple[int, int]]]:
    """The limits by their number, and what was set of them."""
    now = {resource.RLIMIT_NOFILE: (1024, 4096), resource.RLIMIT_AS: (FREE, FREE)}
    monkeypatch.setattr(limits.resource, "getrlimit", now.__getitem__)
    monkeypatch.setattr(limits.resource, "setrlimit", now.__setitem__)
    return now


def test_usual_limits_are_enough(system: dict[int, tuple[int, int]]) -> None:
    assert limits_problem() is None and system[resource.RLIMIT_NOFILE] == (1024, 4096)


def test_few_file_handles_are_raised_where_they_may_be(system: dict[int, tuple[int, int]]) -> None:
    system[resource.RLIMIT_NOFILE] = (64, 4096)
    assert limits_problem() is None and system[resource.RLIMIT_NOFILE] == (LEAST_FILES, 4096)


def test_few_file_handles_that_cannot_be_raised_are_told(system: dict[int, tuple[int, int]]) -> None:
    system[resource.RLIMIT_NOFILE] = (64, 64)
    assert limits_problem() == "a process may open 64 files here, and some nodes need 256: raise `ulimit -n`"


def test_too_little_memory_is_told(system: dict[int, tuple[int, int]]) -> None:
    system[resource.RLIMIT_AS] = (1_600_000_000, FREE)
    assert limits_problem() == "a process may have 1.6 GB of addresses here, and some nodes reserve 4 GB: raise `ulimit -v`"
