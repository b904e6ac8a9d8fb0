"""A whole exploration of `ramp` and one of `moon`: bridge, ramps and drops, and open terrain without a level floor."""

from pathlib import Path

import pytest
from exploring import ExploreRun, summary

LIMIT_S = 600.0
SEEDS = {"ramp": 7, "moon": 3}  # whose runs are among the shortest

Run = tuple[Path, int, str]


@pytest.fixture(scope="module", params=SEEDS)
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Folder, exit code and terminal of one run."""
    out = tmp_path_factory.mktemp(request.param) / "run"
    with ExploreRun("--world", request.param, "--seed", SEEDS[request.param], "--headless", "--out", out) as explore:
        return out, explore.wait(LIMIT_S), explore.text


def test_world_is_explored_whole_without_a_touch_or_a_fall(run: Run) -> None:
    out, code, text = run
    result = summary(out)
    assert code == 0, text
    assert (result["success"], result["faults"]) == (True, []), result
    assert (result["collisions"], result["fell"]) == (0, False), result
    assert result["coverage"] >= 0.995, result  # type: ignore[operator]
    assert "Traceback" not in (out / "roslaunch.log").read_text()


def test_map_is_true_and_nothing_beyond_a_border_is_wrongly_safe(run: Run) -> None:
    result = summary(run[0])
    assert result["trajectory_ate_m"] < 0.05 and result["map_rmse_m"] < 0.05, result  # type: ignore[operator]
    wrongly_safe = dict(result["classification"]["false_safe_by_cause"])  # type: ignore[index]
    assert sum(area for cause, area in wrongly_safe.items() if cause != "edge") <= 0.02, wrongly_safe


def test_way_is_no_shorter_than_the_shortest(run: Run) -> None:
    assert 1.0 <= summary(run[0])["path_ratio"] < 1.5  # type: ignore[operator]
