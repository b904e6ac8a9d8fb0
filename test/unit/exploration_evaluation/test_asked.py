"""What a run was asked to do, as its run.json tells, and how much of its budget it spent."""

from typing import Any

import pytest

from exploration_evaluation.asked import budget_share, was_to_explore


def reported(budget_s: float = 0.0, budget_m: float = 0.0, sim_time_s: float | None = 300.0, **more: Any) -> dict[str, Any]:
    exploration = {"budget_s": budget_s, "budget_m": budget_m}
    return {"sim_time_s": sim_time_s, "config": {"octomap_server_3dnav_node": {"exploration": exploration}}, **more}


@pytest.mark.parametrize(
    ("asked", "share"),
    [({}, None), ({"budget_s": 600.0}, 0.5), ({"budget_m": 50.0}, 0.8), ({"budget_s": 600.0, "budget_m": 30.0}, 40.0 / 30.0)],
)
def test_share_is_of_the_budget_that_is_spent_most(asked: dict[str, float], share: float | None) -> None:
    assert budget_share(reported(**asked), 40.0) == pytest.approx(share)


def test_budget_counts_as_it_was_set_last() -> None:
    changes = [{"node": "octomap_server_3dnav_node", "parameter": "exploration_budget_s", "value": v} for v in (100.0, 400.0)]
    other = [{"node": "octomap_server_3dnav_node", "parameter": "exploration_at_end", "value": "home"}]
    assert budget_share(reported(600.0, parameter_changes=changes + other), None) == pytest.approx(0.75)


@pytest.mark.parametrize("told", [{}, {"config": None}, reported(600.0, sim_time_s=None)])
def test_what_is_not_reported_is_not_known(told: dict[str, Any]) -> None:
    assert budget_share(told, None) is None


def test_robot_with_mapping_off_was_not_to_explore() -> None:
    assert not was_to_explore({"mapping": "off"})
    assert was_to_explore({"mapping": "driving"}) and was_to_explore({})
