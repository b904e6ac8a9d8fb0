"""What is asked and what is done: seeds, folders, and when a folder belongs to another campaign."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from evaluation_campaign import Campaign, CampaignProblem, Limits, RunSpec, open_campaign, parse_seeds

LIMITS = Limits(60.0, 120.0)


def campaign(out: Path, **changed) -> Campaign:
    return replace(Campaign(out, ("rooms", "ramp"), (1, 2), ("ours", "thesis"), "tilting", LIMITS), **changed)


@pytest.mark.parametrize(
    ("text", "seeds"), [("3", (3,)), ("1-4", (1, 2, 3, 4)), ("1-2,8, 11-12", (1, 2, 8, 11, 12)), ("5,1-5", (5, 1, 2, 3, 4)), ("0-0", (0,))]
)
def test_seeds_are_numbers_and_ranges_each_once(text, seeds):
    assert parse_seeds(text) == seeds


@pytest.mark.parametrize("text", ["", "a", "1-", "-3", "1--3", "1,,2", "1.5", "4-2"])
def test_seeds_that_are_no_list_are_refused_with_the_text(text):
    with pytest.raises(CampaignProblem, match="--seeds"):
        parse_seeds(text)


def test_runs_come_seed_by_seed_so_that_half_a_campaign_compares_profiles(tmp_path):
    first = campaign(tmp_path).specs[:4]
    assert [(s.world, s.seed, s.profile) for s in first] == [
        ("rooms", 1, "ours"),
        ("rooms", 1, "thesis"),
        ("ramp", 1, "ours"),
        ("ramp", 1, "thesis"),
    ]


def test_every_run_has_a_folder_of_its_own(tmp_path):
    specs = campaign(tmp_path, worlds=("rooms", "/data/garage.dae")).specs
    assert len({s.folder for s in specs}) == len(specs) == 8
    assert RunSpec("/data/garage.dae", 2, "/mine/slow.yaml").folder == Path("runs/slow/garage-2")


def test_run_is_done_when_its_outcome_is_there_whatever_it_says(tmp_path):
    c = open_campaign(campaign(tmp_path / "c"), {})
    spec = c.specs[1]
    (c.out / spec.folder).mkdir(parents=True)
    (c.out / spec.folder / "summary.json").write_text("{}")
    assert spec in c.left()
    (c.out / spec.folder / "outcome.json").write_text('{"status": "crashed"}')
    assert spec not in c.left() and len(c.left()) == 7
    assert c.outcome(spec) == {"status": "crashed", "summary": {}}


def test_the_same_campaign_goes_on_and_keeps_what_is_said_of_its_beginning(tmp_path):
    open_campaign(campaign(tmp_path), {"version": "1"})
    open_campaign(campaign(tmp_path), {"version": "2"})
    assert json.loads((tmp_path / "campaign.json").read_text())["version"] == "1"


def test_campaign_is_extended_by_more_runs_and_does_not_shrink_again(tmp_path):
    open_campaign(campaign(tmp_path), {"version": "1"})
    larger = campaign(tmp_path, seeds=(3, 1, 2), profiles=("ours", "thesis", "nearest"))
    open_campaign(larger, {"version": "2"})
    held = json.loads((tmp_path / "campaign.json").read_text())
    assert (held["seeds"], held["profiles"], held["version"]) == ([3, 1, 2], ["ours", "thesis", "nearest"], "1")
    with pytest.raises(CampaignProblem, match="another campaign, of seeds 3,1,2, not 1,2"):
        open_campaign(campaign(tmp_path), {})


@pytest.mark.parametrize(
    "changed",
    [{"seeds": (1, 3)}, {"worlds": ("rooms",)}, {"profiles": ("ours",)}, {"sensor": "spinning"}, {"limits": Limits(1.0, 1.0)}],
)
def test_folder_of_another_campaign_is_refused_with_what_differs(tmp_path, changed):
    open_campaign(campaign(tmp_path), {})
    with pytest.raises(CampaignProblem, match=f"another campaign, of {next(iter(changed))}"):
        open_campaign(campaign(tmp_path, **changed), {})


def test_all_that_differs_is_told_at_once(tmp_path):
    open_campaign(campaign(tmp_path), {})
    with pytest.raises(CampaignProblem, match="of seeds 1,2, not 1; of sensor tilting, not spinning; of movers none, not 3; choose"):
        open_campaign(campaign(tmp_path, seeds=(1,), sensor="spinning", movers="3"), {})


def test_campaign_from_before_there_was_a_choice_of_sensors_had_the_tilting_one(tmp_path):
    open_campaign(campaign(tmp_path), {})
    path = tmp_path / "campaign.json"
    path.write_text(json.dumps({key: value for key, value in json.loads(path.read_text()).items() if key != "sensor"}))
    with pytest.raises(CampaignProblem, match="another campaign, of sensor tilting, not spinning"):
        open_campaign(campaign(tmp_path, sensor="spinning"), {})
    open_campaign(campaign(tmp_path), {})


def test_folder_with_something_else_is_refused(tmp_path):
    (tmp_path / "thesis.txt").touch()
    with pytest.raises(CampaignProblem, match="not empty and no campaign"):
        open_campaign(campaign(tmp_path), {})


@pytest.mark.parametrize("content", ["", "[]", "{"])
def test_campaign_file_that_cannot_be_read_is_refused(tmp_path, content):
    (tmp_path / "campaign.json").write_text(content)
    with pytest.raises(CampaignProblem, match=r"campaign\.json"):
        open_campaign(campaign(tmp_path), {})


def test_folder_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(CampaignProblem, match="cannot be written"):
        open_campaign(campaign(tmp_path / "file" / "c"), {})
