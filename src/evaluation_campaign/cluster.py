"""All runs of a campaign over a Dask cluster: a local one, or one that is there already.

A worker that dies in mid run costs that run's time only: it is made again, elsewhere, a bounded number of times.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import dask
from distributed import Client, LocalCluster, as_completed
from distributed.scheduler import KilledWorker

from evaluation_campaign.plan import OUTCOME_FILE, Campaign, CampaignProblem, RunSpec
from evaluation_campaign.runner import RunRequest, make_run
from exploration_evaluation import write_json

Progress = Callable[[RunSpec, dict[str, Any]], None]
_ATTEMPTS = 3
_CONNECT_S = 10.0
_AT_REST = {  # who waits for a run takes little of the cores from it
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.admin.tick.interval": "1s",
}


@contextmanager
def cluster_client(scheduler: str | None, jobs: int) -> Iterator[Client]:
    """A client of the scheduler at an address, or of a local cluster with `jobs` workers. CampaignProblem when nobody answers there."""
    dask.config.set({"distributed.scheduler.allowed-failures": _ATTEMPTS - 1, "distributed.worker.daemon": False, **_AT_REST})
    if scheduler is None:
        with LocalCluster(n_workers=jobs, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0", silence_logs=50) as local:
            with Client(local) as client:
                yield client
        return
    try:
        client = Client(scheduler, timeout=_CONNECT_S)
    except (OSError, TimeoutError, ValueError) as error:
        raise CampaignProblem(f"--scheduler {scheduler}: nobody answers there: {error}") from error
    with client:
        if not client.scheduler_info()["workers"]:
            raise CampaignProblem(f"--scheduler {scheduler}: it has no workers")
        yield client


def run_all(campaign: Campaign, client: Client, project: Path, on_end: Progress) -> None:
    """Makes every run that is left, and tells `on_end` of each that ends. OSError when the campaign's folder cannot be written."""
    requests = [
        RunRequest(
            spec,
            campaign.sensor,
            campaign.limits,
            campaign.out,
            project,
            campaign.robot,
            campaign.realism,
            campaign.mapping,
            campaign.movers_of(spec),
            campaign.chaos,
        )
        for spec in campaign.left()
    ]
    # Every worker holds one run at a time, and the first of the list come first.
    futures = [client.submit(make_run, r, pure=False, priority=-k) for k, r in enumerate(requests)]
    spec_of = {future.key: request.spec for future, request in zip(futures, requests, strict=True)}
    for future in as_completed(futures):
        spec = spec_of[future.key]
        error = future.exception()
        if error is None:
            outcome = future.result()
        elif isinstance(error, KilledWorker):
            outcome = _lost(campaign, spec)
        else:
            client.cancel(futures)
            raise error
        on_end(spec, outcome)


def _lost(campaign: Campaign, spec: RunSpec) -> dict[str, Any]:
    """The outcome of a run whose workers died every time."""
    outcome = {
        "world": spec.world,
        "seed": spec.seed,
        "profile": spec.profile,
        "status": "crashed",
        "error": f"its worker died in {_ATTEMPTS} attempts",
        "exit_code": None,
        "wall_s": None,
        "started": None,
        "attempts": _ATTEMPTS,
    }
    folder = campaign.out / spec.folder
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / OUTCOME_FILE, outcome)
    return outcome
