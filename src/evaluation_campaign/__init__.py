"""Campaigns of many runs: which runs there are, one of them, and all of them over a cluster, resumable at any time.

`plan` says what is asked and what is there already, `runner` makes one run in a process group of its own, `cluster` hands the runs
out with Dask. What a campaign found is the business of evaluation_report.
"""

from evaluation_campaign.plan import Campaign, CampaignProblem, Limits, RunSpec, open_campaign, parse_seeds

__all__ = ["Campaign", "CampaignProblem", "Limits", "RunSpec", "open_campaign", "parse_seeds"]
