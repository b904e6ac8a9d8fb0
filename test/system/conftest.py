"""The run of `rooms` with seed 1 that several tests look at is made once; and tests for which no time is left are skipped, and say so."""

import os
import time
from pathlib import Path

import pytest
from exploring import ExploreRun

ROOMS_LIMIT_S = 240.0
LONG_S = 600.0  # of CHECK_ENDS, that are left for the tests of LONGEST
LONGEST = ("test_campaign.py", "test_determinism.py", "test_chaos.py")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files that make several runs for one test come last."""
    items.sort(key=lambda item: LONGEST.index(item.path.name) + 1 if item.path.name in LONGEST else 0)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """CI has a limit of time, and a machine may be slow: what has not begun by CHECK_ENDS, in seconds since 1970, is left out.

    So is a test of several runs that has not begun some minutes before: it would be at work when CI ends.
    """
    needs_s = LONG_S if item.path.name in LONGEST else 0.0
    if time.time() + needs_s > float(os.environ.get("CHECK_ENDS", "inf")):
        pytest.skip("no time is left on this machine: python -m pytest test/system makes this run")


@pytest.fixture(scope="session")
def rooms_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int, str]:
    """Folder, exit code and output of `./explore --world rooms --seed 1 --headless`."""
    out = tmp_path_factory.mktemp("rooms") / "run"
    with ExploreRun("--world", "rooms", "--seed", 1, "--headless", "--out", out) as run:
        code = run.wait(ROOMS_LIMIT_S)
        assert not run.running(), f"still running after the end: {run.running()}"
    return out, code, run.text
