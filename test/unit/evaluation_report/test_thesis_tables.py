"""The typed tables hold together with themselves and with what the thesis says of them."""

import pytest

from evaluation_report import THESIS_TABLES, Mark, wilson_interval
from evaluation_report.statistics import mean_over
from evaluation_report.wording import clock

RUNS = [run for table in THESIS_TABLES.values() for run in table.runs]


@pytest.mark.parametrize("run", RUNS, ids=lambda run: f"{run.run}")
def test_local_and_global_times_add_up_to_a_second(run):
    if run.class_time_s is not None:
        assert abs(run.local_time_s + run.global_time_s - run.class_time_s) <= 1.0


@pytest.mark.parametrize(("world", "good", "acceptable", "failed"), [("ramp", 6, 1, 3), ("moon", 5, 4, 1)])
def test_marks_are_as_many_as_the_thesis_counts(world, good, acceptable, failed):
    table = THESIS_TABLES[world]
    assert [run.run for run in table.runs] == list(range(1, 11))
    assert (len(table.good), len(table.acceptable)) == (good, acceptable)
    assert sum(run.mark is Mark.FAILED for run in table.runs) == failed


def test_runtime_of_the_good_indoor_runs_is_the_thesis_s_average():
    good = THESIS_TABLES["ramp"].good
    assert clock(min(run.runtime_s for run in good)) == "10:02"
    assert clock(max(run.runtime_s for run in good)) == "12:24"
    assert clock(mean_over([run.runtime_s for run in good], 10).value) == "11:18"


def test_what_the_scan_lost_is_unknown():
    ramp = THESIS_TABLES["ramp"].runs
    assert ramp[4].class_time_s is None and ramp[4].local_classifications is None
    assert [run.run for run in ramp if run.global_classifications is None] == [1, 5, 6, 7, 9]


def test_interval_of_the_thesis_s_own_success_contains_its_share():
    for table in THESIS_TABLES.values():
        bounds = wilson_interval(len(table.good), len(table.runs))
        assert bounds.low < len(table.good) / len(table.runs) < bounds.high
