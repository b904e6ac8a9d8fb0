"""One run of a campaign: ./explore in a process group of its own, under a limit of wall time, with its outcome written at the end.

What a worker of the cluster calls. It dies with its worker, and a run that hangs or crashes leaves an outcome like any other.
"""

import contextlib
import os
import random
import shutil
import signal
import subprocess
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from evaluation_campaign.chaos import faults, hand_at_work, told
from evaluation_campaign.plan import BY_PROFILE, OUTCOME_FILE, Limits, RunSpec
from exploration_evaluation import add_clairvoyant, read_json, write_json
from explore_command.ending import is_broken_off
from roslaunch_process import descendants, end_with_parent, free_port, send

_GRACE_S = 90.0  # for nodes to save and the judge to score after an interrupt
_LEAST_FREE_BYTES = 500 * 2**20
_PORTS = range(11400, 14400)  # at random: runs that begin together on one machine must not choose the same


class DiskFull(OSError):
    """There is no room for another run."""


@dataclass(frozen=True)
class RunRequest:
    """All that a worker needs to know: the run, the campaign's folder and the project's."""

    spec: RunSpec
    sensor: str
    limits: Limits
    out: Path
    project: Path
    robot: str = ""
    realism: str = "hardware"
    mapping: str = BY_PROFILE
    movers: str = ""
    chaos: int | None = None

    @property
    def chaos_seed(self) -> str:
        """Of the bad hand in this run."""
        return f"{self.chaos} {self.spec.folder}"


def make_run(request: RunRequest) -> dict[str, object]:
    """Makes the run and writes its outcome.json, which is returned. DiskFull, or another OSError, when nothing can be written."""
    folder = request.out / request.spec.folder
    folder.mkdir(parents=True, exist_ok=True)
    free = shutil.disk_usage(folder).free
    if free < _LEAST_FREE_BYTES:
        raise DiskFull(f"{free / 2**20:.0f} MB free at {request.out}, a run needs up to {_LEAST_FREE_BYTES / 2**20:.0f} MB")
    _end_earlier(folder)
    (folder / "summary.json").unlink(missing_ok=True)  # of an earlier run: one that never begins leaves none
    version = code_version(request.project)
    attempts = _count_attempt(folder)
    started, begun = time.strftime("%Y-%m-%dT%H:%M:%S"), time.monotonic()
    exit_code, in_time = _explore(request, folder)
    with contextlib.suppress(ValueError):  # a run that was not judged
        add_clairvoyant(folder)
    _draw_missed(folder)
    spec = request.spec
    outcome = {
        "world": spec.world,
        "seed": spec.seed,
        "profile": spec.profile,
        **_ending(request, folder, exit_code, in_time),
        "exit_code": exit_code,
        "wall_s": round(time.monotonic() - begun, 1),
        "started": started,
        "version": version,
        "attempts": attempts,
    }
    if request.chaos is not None:
        outcome["chaos"] = told(folder, _restarts(folder))
    write_json(folder / OUTCOME_FILE, outcome)
    return outcome


def code_version(project: Path) -> str:
    """What git calls the code of a project; "unknown" where there is no git."""
    described = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=project, capture_output=True, text=True, check=False)
    return described.stdout.strip() or "unknown"


def _draw_missed(folder: Path) -> None:
    """map_missed.png for the report, where the run left enough for it."""
    from evaluation_report import missed_view  # matplotlib takes a second to load, and only runs that are over need it

    with contextlib.suppress(ValueError):
        missed_view(folder)


def _explore(request: RunRequest, folder: Path) -> tuple[int, bool]:
    """Exit code, and whether it ended by itself within the wall limit."""
    spec = request.spec
    command = [str(request.project / "explore"), "--headless", "--force", "--world", spec.world, "--seed", str(spec.seed)]
    command += ["--profile", spec.profile, "--out", str(folder), "--port", str(free_port(random.sample(_PORTS, 100)))]
    command += ["--sensor", request.sensor, "--realism", request.realism]
    command += ["--mapping", request.mapping] if request.mapping != BY_PROFILE else []
    command += ["--max-sim-time", str(request.limits.sim_s)]
    command += ["--robot", request.robot] if request.robot else []
    command += ["--movers", request.movers] if request.movers else []
    if request.chaos is not None:
        command += ["--set", f"pybullet_sim_node/timing/faults={faults(request.chaos_seed, request.limits.sim_s)}"]
    with (folder.parent / f".{folder.name}.log").open("w") as log:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=partial(end_with_parent, signal.SIGKILL),  # nobody asks for a judgement any more
        )
        try:
            with _bad_hand(request, process.pid, Path(log.name)):
                return process.wait(request.limits.wall_s), True
        except subprocess.TimeoutExpired:
            return _end(process), False
        except BaseException:
            _end(process)
            raise


def _restarts(folder: Path) -> dict[str, int]:
    """Of each node, as the run has them; nothing where it was not judged."""
    try:
        found = read_json(folder / "summary.json").get("restarts")
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def _bad_hand(request: RunRequest, root: int, log: Path) -> contextlib.AbstractContextManager[None]:
    if request.chaos is None:
        return contextlib.nullcontext()
    return hand_at_work(request.chaos_seed, root, log, request.out / request.spec.folder)


def _end(process: "subprocess.Popen[bytes]") -> int:
    """Interrupts, and kills what does not end: the whole group, and the nodes that roslaunch has put into groups of their own."""
    process.send_signal(signal.SIGINT)
    try:
        return process.wait(_GRACE_S)
    except subprocess.TimeoutExpired:
        _kill_all(process.pid)
        return process.wait()


def _end_earlier(folder: Path) -> None:
    """Kills what an attempt whose worker died still runs on this machine: two runs must not write into one folder."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal() and int(entry.name) != os.getpid():
            try:
                words = (entry / "cmdline").read_bytes().decode(errors="replace").split("\0")
            except OSError:
                continue
            if f"out:={folder}" in words or ("--out", str(folder)) in zip(words, words[1:], strict=False):
                _kill_all(int(entry.name))


def _kill_all(root: int) -> None:
    send(signal.SIGKILL, [root, *descendants(root)])


def _count_attempt(folder: Path) -> int:
    """How often this run was begun, this time included."""
    count = folder.parent / f".{folder.name}.attempts"
    with count.open("a") as file:
        file.write("x")
    return count.stat().st_size


def _ending(request: RunRequest, folder: Path, exit_code: int, in_time: bool) -> dict[str, object]:
    """Status and, where the run is not finished, why; without this machine's paths, for reports are passed on."""
    if not in_time:
        return {"status": "wall limit", "error": "ended from outside after the limit of wall time"}
    try:
        reason = str(read_json(folder / "summary.json").get("stop_reason"))
    except ValueError as error:
        text = f"exit code {exit_code}, {error}: {_last_words(folder)}"
        return {"status": "crashed", "error": text.replace(f"{request.out}/", "").replace(f"{request.project}/", "")}
    if reason.startswith("time limit"):
        return {"status": "sim limit", "error": reason}
    if is_broken_off(reason):
        return {"status": "crashed", "error": reason}
    return {"status": "finished", "error": None}


def _last_words(folder: Path) -> str:
    lines = (folder.parent / f".{folder.name}.log").read_text(errors="replace").strip().splitlines()
    return lines[-1][:300] if lines else "no output"
