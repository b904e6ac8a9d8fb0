"""The run of `rooms` with seed 1 that several tests look at is made once."""

from pathlib import Path

import pytest
from exploring import ExploreRun

ROOMS_LIMIT_S = 240.0


@pytest.fixture(scope="session")
def rooms_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int, str]:
    """Folder, exit code and output of `./explore --world rooms --seed 1 --headless`."""
    out = tmp_path_factory.mktemp("rooms") / "run"
    with ExploreRun("--world", "rooms", "--seed", 1, "--headless", "--out", out) as run:
        code = run.wait(ROOMS_LIMIT_S)
        assert not run.running(), f"still running after the end: {run.running()}"
    return out, code, run.text
