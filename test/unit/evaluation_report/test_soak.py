"""What many runs say: those that failed, each with its cause, and the share that succeeds by Clopper and Pearson."""

import json
from pathlib import Path

import pytest
from campaign_on_disk import write_campaign, write_run

from evaluation_report import write_soak


def rows_of(text: str) -> dict[str, list[str]]:
    """Cells of the table by the name of a row."""
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]
    return {row[0]: row[1:] for row in cells}


def test_every_failure_is_named_with_its_cause_and_missing_runs_are_not_counted(tmp_path: Path) -> None:
    folder = write_campaign(tmp_path / "c", ("ramp", "moon"), (1, 2, 3, 4))
    for seed in (1, 2, 3):
        write_run(folder, "ramp", seed, coverage=0.99)
    write_run(folder, "ramp", 4, success=False, faults=["touched something"], stop_reason="explored: all")
    write_run(folder, "moon", 1, status="crashed", error="node died: move_base_node", success=None)
    write_run(folder, "moon", 2, success=None)
    text = write_soak(folder)
    rows = rows_of(text)
    assert (rows["ramp"][:2], rows["moon"][:2], rows["all"][:2]) == (["4", "1"], ["2", "2"], ["6", "3"])
    assert "- ours, ramp 4: touched something; explored: all\n" in text
    assert "- ours, moon 1: node died: move_base_node" in text and "- ours, moon 2: " in text
    assert "ours, moon 3; ours, moon 4" in text and "- ours, ramp 1" not in text
    assert (folder / "soak.md").read_text() == text


@pytest.mark.parametrize(("runs", "least"), [(300, 99.0), (10, 74.1)])
def test_bound_without_a_failure_is_that_at_which_none_has_a_chance_of_5_percent(tmp_path: Path, runs: int, least: float) -> None:
    assert 100.0 * 0.05 ** (1.0 / runs) == pytest.approx(least, abs=0.05)
    folder = write_campaign(tmp_path / "c", seeds=tuple(range(1, runs + 1)))
    for seed in range(1, runs + 1):
        write_run(folder, "ramp", seed)
    assert rows_of(write_soak(folder))["all"][2:4] == [f"{100.0 * 0.025 ** (1.0 / runs):.1f}–100.0 %", f"{least:.1f} %"]


def test_what_a_bad_hand_did_is_summed(tmp_path: Path) -> None:
    folder = write_campaign(tmp_path / "c", seeds=(1, 2, 3))
    for seed in (1, 2):
        place = write_run(folder, "ramp", seed)
        outcome = json.loads((place / "outcome.json").read_text())
        chaos = {"kill": 10, "stop": seed, "starve": 0, "restarts": 11}
        (place / "outcome.json").write_text(json.dumps({**outcome, "chaos": chaos}))
    assert rows_of(write_soak(folder))["all"][4:] == ["20", "3", "0", "22"]


def test_without_any_run_nothing_is_known(tmp_path: Path) -> None:
    assert rows_of(write_soak(write_campaign(tmp_path / "c")))["all"] == ["0", "0", "–", "–", "–", "–", "–", "–"]
