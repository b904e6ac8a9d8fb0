"""The run of `rooms` with seed 1 that several tests look at is made once; and tests for which no time is left are skipped, and say so."""

import os
import time
from pathlib import Path

import pytest
from exploring import ExploreRun
from slow_machine import LONGEST_S

ROOMS_LIMIT_S = 240.0
NEEDS_S = {"test_campaign.py": 600.0, "test_determinism.py": 600.0, "test_chaos.py": 200.0}  # before CHECK_ENDS; these come last


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files of several runs come last. A test that hangs ends and says where, and so do its helpers, somewhat sooner."""
    for item in items:
        item.add_marker(pytest.mark.timeout(LONGEST_S + 100.0))
    items.sort(key=lambda item: [*NEEDS_S].index(item.path.name) + 1 if item.path.name in NEEDS_S else 0)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """CI has a limit of time, and a machine may be slow: what has not begun by CHECK_ENDS, in seconds since 1970, is left out.

    So is a test that needs long and has not begun some minutes before: it would be at work when CI ends.
    """
    if time.time() + NEEDS_S.get(item.path.name, 0.0) > float(os.environ.get("CHECK_ENDS", "inf")):
        pytest.skip("no time is left on this machine: python -m pytest test/system makes this run")


@pytest.fixture(scope="session")
def rooms_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int, str]:
    """Folder, exit code and output of `./explore --world rooms --seed 1 --headless`."""
    out = tmp_path_factory.mktemp("rooms") / "run"
    with ExploreRun("--world", "rooms", "--seed", 1, "--headless", "--out", out) as run:
        code = run.wait(ROOMS_LIMIT_S)
        assert not run.running(), f"still running after the end: {run.running()}"
    return out, code, run.text
