"""./evaluate: from arguments to a report and an exit code."""

import argparse
import os
import platform
import signal
import sys
import time
from importlib.metadata import version
from pathlib import Path

from evaluation_campaign.arguments import parse
from evaluation_campaign.plan import Campaign, CampaignProblem, RunSpec, open_campaign
from evaluation_campaign.runner import code_version

PROJECT = Path(__file__).resolve().parents[2]
_REPORTED_PACKAGES = ("numpy", "scipy", "numba", "gtsam", "open3d", "small_gicp", "pybullet", "distributed")


def about(jobs: int) -> dict[str, object]:
    """What campaign.json says of code and machine."""
    machine = {
        "cpu": _processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "packages": {name: version(name) for name in _REPORTED_PACKAGES},
    }
    return {"version": code_version(PROJECT), "jobs": jobs, "machine": machine}


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or "unknown"
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown")


class _Progress:
    """A line for every run that has ended, with what is left to do."""

    def __init__(self, campaign: Campaign) -> None:
        self._total, self._left = len(campaign.specs), len(campaign.left())
        self._asked, self._begun = self._left, time.monotonic()

    def __call__(self, spec: RunSpec, outcome: dict[str, object]) -> None:
        self._left -= 1
        made = self._asked - self._left
        left_s = (time.monotonic() - self._begun) / made * self._left
        told = outcome["error"] or "finished"
        wall = "" if outcome["wall_s"] is None else f", {outcome['wall_s']:.0f} s"
        rest = f"; about {left_s / 60:.0f} min left" if self._left else ""
        print(f"[{self._total - self._left:3d}/{self._total}] {spec.world} {spec.seed} ({spec.profile}): {told}{wall}{rest}", flush=True)


def run_campaign(campaign: Campaign, options: argparse.Namespace) -> None:
    """Makes the runs that are left. CampaignProblem when the scheduler is not there, OSError when the disk is full."""
    from evaluation_campaign.cluster import cluster_client, run_all  # Dask takes a second to load, and --help needs none

    left = len(campaign.left())
    print(f"{len(campaign.specs)} runs, {left} of them to be made, {options.jobs} at a time; results in {campaign.out}", flush=True)
    if left:
        with cluster_client(options.scheduler, min(options.jobs, left)) as client:
            run_all(campaign, client, PROJECT, _Progress(campaign))


def _interrupt(_number: int, _frame: object) -> None:
    raise KeyboardInterrupt


def main(arguments: list[str] | None = None) -> int:
    try:
        campaign, options = parse(arguments)
        if not options.report_only:
            open_campaign(campaign, about(options.jobs))
            run_campaign(campaign, options)
        return _report(campaign, is_soak=bool(options.soak))
    except CampaignProblem as error:
        for line in str(error).splitlines():
            print(f"./evaluate: {line}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"./evaluate: stopped: {error}; finished runs stay, the same command goes on", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\n./evaluate: interrupted; finished runs stay, the same command goes on", file=sys.stderr)
        return 130


def _report(campaign: Campaign, *, is_soak: bool) -> int:
    """The exit code. CampaignProblem for a file of the campaign that cannot be read, OSError when the report cannot be written."""
    try:
        return _told(campaign, is_soak=is_soak)
    except ValueError as error:
        raise CampaignProblem(f"--out {campaign.out}: {' '.join(str(error).split())}") from error


def _told(campaign: Campaign, *, is_soak: bool) -> int:
    from evaluation_report import write_report, write_soak

    for path in write_report(campaign.out):
        print(f"wrote {path}")
    missing = [spec for spec in campaign.specs if not campaign.is_done(spec)]
    crashed = [spec for spec in campaign.specs if campaign.is_done(spec) and campaign.outcome(spec)["status"] == "crashed"]
    for text, specs in (("missing", missing), ("crashed", crashed)):
        if specs:
            print(f"{text}: {', '.join(f'{s.world} {s.seed} ({s.profile})' for s in specs)}")
    if is_soak:
        print(write_soak(campaign.out), end="")
    return 1 if missing or crashed else 0


if __name__ == "__main__":
    for signal_number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(signal_number, _interrupt)  # also where a shell's background ignores the first
    sys.exit(main())
