"""Campaign folders in every state: complete, begun, damaged, and none at all."""

import json

import pytest
from campaign_on_disk import SUMMARY, write_campaign, write_run

from evaluation_report import Status, load_campaign
from evaluation_report.campaign import Grade
from evaluation_report.gallery import causes, worst_first
from evaluation_report.wording import clock, listed, number, percent, ranges


def test_every_run_asked_for_is_there_whatever_is_on_disk(tmp_path):
    folder = write_campaign(tmp_path, worlds=("ramp", "moon"), seeds=(1, 2), profiles=("ours", "thesis"))
    write_run(folder, "ramp", 1)
    campaign = load_campaign(folder)
    assert len(campaign.runs) == 8
    assert [run.status for run in campaign.runs].count(Status.MISSING) == 7
    assert campaign.runs_of("ramp", "ours")[0].number("coverage") == 0.9


def test_profile_that_is_a_file_is_called_by_its_name(tmp_path):
    folder = write_campaign(tmp_path, seeds=(1,), profiles=("ours", "somewhere/mine.yaml"))
    write_run(folder, "ramp", 1, profile="mine")
    campaign = load_campaign(folder)
    assert campaign.profiles == ("ours", "mine")
    assert campaign.runs_of("ramp", "mine")[0].status is Status.FINISHED


def test_missing_runs_say_whether_they_were_begun(tmp_path):
    folder = write_campaign(tmp_path, seeds=(1, 2, 3))
    (folder / "runs/ours/ramp-1").mkdir(parents=True)
    (folder / "runs/ours/ramp-1/run.json").write_text("{}")
    (folder / "runs/ours/ramp-2").mkdir()
    (folder / "runs/ours/ramp-2/outcome.json").write_text('{"status": "fini')
    errors = [run.error for run in load_campaign(folder).runs]
    assert errors[0].startswith("begun but not ended")
    assert "outcome.json is no JSON" in errors[1]
    assert errors[2] == "not made"


def test_campaign_that_went_on_with_other_code_names_all_its_versions(tmp_path):
    folder = write_campaign(tmp_path, seeds=(1, 2, 3, 4))
    assert load_campaign(folder).version == "v1-2-gabc"
    for seed, version in ((1, None), (2, "v1-2-gabc"), (3, "v2")):
        path = write_run(folder, "ramp", seed) / "outcome.json"
        path.write_text(json.dumps({**json.loads(path.read_text()), "version": version}))
    assert load_campaign(folder).version == "v1-2-gabc, v2"


def test_unknown_status_is_no_finished_run(tmp_path):
    folder = write_campaign(tmp_path, seeds=(1,))
    write_run(folder, "ramp", 1, status="splendid")
    run = load_campaign(folder).runs[0]
    assert run.status is Status.MISSING and "splendid" in run.error


def test_finished_run_without_summary_is_not_judged(tmp_path):
    folder = write_campaign(tmp_path, seeds=(1,))
    (write_run(folder, "ramp", 1) / "summary.json").unlink()
    run = load_campaign(folder).runs[0]
    assert (run.status, run.verdict, run.number("coverage")) == (Status.FINISHED, None, None)
    assert "summary.json is not there" in run.error


@pytest.mark.parametrize(
    ("changed", "grade", "verdict"),
    [
        ({"coverage": 0.90}, Grade.GOOD, True),
        ({"coverage": 0.89}, Grade.PARTIAL, False),
        ({"coverage": 1.0, "success": False}, Grade.FAILED, False),
        ({"coverage": 0.94, "success": False, "faults": ["coverage"]}, Grade.PARTIAL, False),
        ({"coverage": 0.94, "success": False, "faults": ["collision", "coverage"]}, Grade.FAILED, False),
        ({"coverage": 0.94, "success": False, "faults": ["coverage", "stayed"]}, Grade.FAILED, False),
        ({"coverage": None}, None, None),
        ({"status": "sim limit"}, Grade.FAILED, False),
    ],
)
def test_grade_is_that_of_the_thesis_and_only_the_best_counts_as_success(tmp_path, changed, grade, verdict):
    folder = write_campaign(tmp_path, seeds=(1,))
    write_run(folder, "ramp", 1, **changed)
    run = load_campaign(folder).runs[0]
    assert (run.grade, run.verdict) == (grade, verdict)


def test_null_and_broken_values_are_unknown(tmp_path):
    folder = write_campaign(tmp_path, seeds=(1,))
    curve = [*SUMMARY["coverage_curve"], {"time_s": 400.0, "coverage": None}, "no point"]
    write_run(folder, "ramp", 1, coverage=None, success="yes", classification=None, coverage_curve=curve, map_rmse_m="wide")
    run = load_campaign(folder).runs[0]
    assert run.verdict is None
    assert [run.number(key) for key in ("coverage", "classification.false_safe_m2", "map_rmse_m")] == [None, None, None]
    assert len(run.curve()) == 3


@pytest.mark.parametrize(("changed", "told"), [({"worlds": []}, "worlds"), ({"seeds": ["one"]}, "seeds"), ({"profiles": None}, "profiles")])
def test_campaign_that_does_not_say_what_was_asked_is_refused(tmp_path, changed, told):
    write_campaign(tmp_path)
    asked = json.loads((tmp_path / "campaign.json").read_text())
    (tmp_path / "campaign.json").write_text(json.dumps(asked | changed))
    with pytest.raises(ValueError, match=told):
        load_campaign(tmp_path)


def test_folder_without_campaign_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"campaign\.json is not there"):
        load_campaign(tmp_path)


def test_runs_that_were_not_asked_for_are_named_and_left_out(tmp_path):
    folder = write_campaign(tmp_path, seeds=(1,))
    write_run(folder, "ramp", 1)
    write_run(folder, "ramp", 7)
    campaign = load_campaign(folder)
    assert len(campaign.runs) == 1
    assert campaign.not_asked == ("ours/ramp-7",)


def test_worst_runs_come_first(tmp_path):
    folder = write_campaign(tmp_path, seeds=(1, 2, 3, 4, 5, 6, 7))
    write_run(folder, "ramp", 1, coverage=0.99)
    write_run(folder, "ramp", 2, coverage=0.91)
    write_run(folder, "ramp", 3, success=False, collisions=1)
    write_run(folder, "ramp", 4, status="sim limit")
    write_run(folder, "ramp", 5, status="crashed")
    write_run(folder, "ramp", 7, success=None)
    assert [run.seed for run in worst_first(load_campaign(folder).runs)] == [6, 5, 4, 3, 7, 2, 1]


def test_causes_name_what_went_wrong_and_nothing_else(tmp_path):
    folder = write_campaign(tmp_path, seeds=(1, 2, 3, 4))
    clean = {"false_safe_m2": 0.0, "false_unsafe_m2": 0.0}
    write_run(folder, "ramp", 1, coverage=1.0, classification=clean)
    write_run(folder, "ramp", 2, success=False, fell=True, max_tilt_rad=1.0, collisions=2, collision_top_speed_mps=0.3)
    write_run(folder, "ramp", 3, status="sim limit")
    campaign = load_campaign(folder)
    told = [causes(campaign, run) for run in campaign.runs]
    assert told[0] == []
    assert told[1][:2] == ["fell, tilted by 57 deg", "2 collisions, at up to 0.30 m/s"]
    assert "20.0 m² of reachable ground not mapped" in told[1]
    assert "2.0 m² taken for closed (grazing lines 1.5, edge 0.5)" in told[1]
    assert told[2][0] == "stopped after 1800 s of simulated time"
    assert told[3] == ["not made"]


def test_a_single_voxel_taken_for_safe_is_named_before_all_that_only_costs_ground(tmp_path):
    folder = write_campaign(tmp_path, seeds=(1,))
    judged = {"false_safe_m2": 0.0064, "false_safe_by_cause": {"edge": 0.0064}, "false_unsafe_m2": 9.0}
    write_run(folder, "ramp", 1, classification=judged)
    campaign = load_campaign(folder)
    assert causes(campaign, campaign.runs[0])[0] == "0.006 m² taken for safe (edge 0.006)"


def test_words():
    assert [clock(t) for t in (None, 59.6, 678.5, 3725.0)] == ["–", "01:00", "11:18", "62:05"]
    assert [clock(t, 1) for t in (1.25, 61.04)] == ["00:01.2", "01:01.0"]
    assert (number(None), number(float("nan")), number(0.123, 1, 100)) == ("–", "–", "12.3")
    assert (percent(0.9716, 1), percent(None)) == ("97.2 %", "–")
    assert [listed(w) for w in (["a"], ["a", "b"], ["a", "b", "c"], [])] == ["a", "a and b", "a, b and c", ""]
    assert ranges([3, 1, 2, 7]) == "1–3, 7"
