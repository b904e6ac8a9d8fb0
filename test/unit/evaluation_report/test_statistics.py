"""Intervals against published and closed-form values, and means that never cover what is not there."""

import pytest
from campaign_on_disk import write_campaign, write_run

from evaluation_report import load_campaign, paired_ratio, success_count, wilson_interval
from evaluation_report.measures import class_time, keyed
from evaluation_report.statistics import mean_of, success_ratio


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_wilson_interval_agrees_with_newcombe_1998_table_1(successes, trials, low, high):
    bounds = wilson_interval(successes, trials)
    assert (bounds.low, bounds.high) == (pytest.approx(low, abs=5e-5), pytest.approx(high, abs=5e-5))


def test_wilson_interval_of_all_of_ten_is_the_closed_form():
    z2 = 1.959963984540054**2
    assert wilson_interval(10, 10).low == pytest.approx(10 / (10 + z2))
    assert wilson_interval(10, 10).high == pytest.approx(1.0)
    assert wilson_interval(0, 10).high == pytest.approx(z2 / (10 + z2))


def test_wilson_interval_of_six_of_ten_computed_by_hand():
    assert wilson_interval(6, 10).low == pytest.approx(0.3127, abs=1e-4)
    assert wilson_interval(6, 10).high == pytest.approx(0.8318, abs=1e-4)


@pytest.mark.parametrize(("successes", "trials"), [(0, 0), (3, 2), (-1, 5)])
def test_wilson_interval_of_no_share_is_refused(successes, trials):
    with pytest.raises(ValueError, match=f"{successes} of {trials}"):
        wilson_interval(successes, trials)


@pytest.fixture
def runs(tmp_path):
    """Seeds 1 and 2 finished, 2 without a coverage; 3 crashed, 4 hung, 5 is missing, 6 could not be judged."""
    folder = write_campaign(tmp_path, seeds=(1, 2, 3, 4, 5, 6))
    write_run(folder, "ramp", 1, coverage=0.92)
    write_run(folder, "ramp", 2, coverage=None, success=False)
    write_run(folder, "ramp", 3, status="crashed", coverage=0.1)
    write_run(folder, "ramp", 4, status="wall limit", coverage=0.2)
    write_run(folder, "ramp", 6, success=None, coverage=0.6)
    return load_campaign(folder).runs


def test_mean_covers_finished_runs_with_a_value_and_says_how_many_were_asked(runs):
    mean = mean_of(runs, keyed("coverage"))
    assert (mean.value, mean.covers) == (pytest.approx(0.76), "2/6")


def test_mean_over_nothing_is_unknown(runs):
    assert mean_of(runs, keyed("no_such_key")).value is None
    assert mean_of([], keyed("coverage")).value is None


def test_crashed_and_hung_runs_are_failures_and_missing_ones_are_not_counted(runs):
    count = success_count(runs)
    assert (count.succeeded, count.judged, count.asked) == (1, 4, 6)
    assert count.share == 0.25
    assert success_count([runs[4]]).share is None
    assert success_count([runs[4]]).interval is None


def test_classification_time_is_unknown_when_a_part_is(tmp_path):
    folder = write_campaign(tmp_path, seeds=(1, 2))
    write_run(folder, "ramp", 1)
    write_run(folder, "ramp", 2, global_classification_time_s=None)
    assert [class_time(run) for run in load_campaign(folder).runs] == [1.5, None]


def test_ratio_is_taken_over_seeds_that_both_finished(tmp_path):
    folder = write_campaign(tmp_path, seeds=(1, 2, 3), profiles=("ours", "thesis"))
    for seed, ours, thesis in ((1, 300.0, 600.0), (2, 400.0, 500.0), (3, 1.0, 9.0)):
        write_run(folder, "ramp", seed, "ours", runtime_s=ours)
        write_run(folder, "ramp", seed, "thesis", status="crashed" if seed == 3 else "finished", success=seed == 1, runtime_s=thesis)
    campaign = load_campaign(folder)
    ours, thesis = campaign.runs_of("ramp", "ours"), campaign.runs_of("ramp", "thesis")
    ratio = paired_ratio(ours, thesis, keyed("runtime_s"))
    assert ratio.value == pytest.approx(700 / 1100)
    assert (ratio.low, ratio.high, ratio.pairs) == (pytest.approx(0.5), pytest.approx(0.8), 2)
    assert success_ratio(ours, thesis).value == pytest.approx(3.0)
    assert success_ratio(ours, thesis).pairs == 3


def test_ratio_to_nothing_is_unknown(tmp_path):
    folder = write_campaign(tmp_path, seeds=(1,), profiles=("ours", "thesis"))
    write_run(folder, "ramp", 1, "ours")
    write_run(folder, "ramp", 1, "thesis", success=False, runtime_s=0.0)
    ours, thesis = (load_campaign(folder).runs_of("ramp", profile) for profile in ("ours", "thesis"))
    assert paired_ratio(ours, thesis, keyed("runtime_s")).value is None
    assert success_ratio(ours, thesis).value is None
    assert paired_ratio(ours, [], keyed("runtime_s")).pairs == 0
