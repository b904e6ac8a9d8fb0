"""The report of a campaign: many runs beside each other, and beside the thesis's tables, as one page that reads offline.

In comes the folder that `./evaluate` leaves (campaign.json, and runs/PROFILE/WORLD-SEED with outcome.json and summary.json),
in any state of completeness; out come report.html, report.md and results.json (`write_report`). `campaign` reads, `statistics`
counts, `tables`, `charts`, `gallery` and `configuration` are what is shown, `content` puts it in order. `missed_view` draws what one
run missed, `write_soak` tells what failed of many runs. Nothing here judges: scores come from `exploration_evaluation`.
"""

from evaluation_report.campaign import Status, load_campaign
from evaluation_report.missed import missed_view
from evaluation_report.report import write_report
from evaluation_report.soak import write_soak
from evaluation_report.statistics import paired_ratio, success_count, wilson_interval
from evaluation_report.thesis_tables import THESIS_TABLES, Mark

__all__ = [
    "THESIS_TABLES",
    "Mark",
    "Status",
    "load_campaign",
    "missed_view",
    "paired_ratio",
    "success_count",
    "wilson_interval",
    "write_report",
    "write_soak",
]
