"""One run from outside, with a script in the place of ./explore: what its end is called, and that nothing of it stays behind."""

import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import dask
import pytest

from evaluation_campaign import Limits, RunSpec, chaos
from evaluation_campaign import runner as runner_module
from evaluation_campaign.cluster import cluster_client
from evaluation_campaign.runner import DiskFull, RunRequest, make_run

SPEC = RunSpec("rooms", 3, "ours")


def request_with(tmp_path: Path, script: str, wall_s: float = 20.0) -> RunRequest:
    """A request whose project has `script` for its ./explore; $out is the run's folder."""
    project = tmp_path / "project"
    project.mkdir()
    explore = project / "explore"
    explore.write_text('#!/bin/bash\nasked="$*"\nwhile [ $# -gt 0 ]; do [ "$1" = --out ] && out=$2; shift; done\n' + script)
    explore.chmod(0o755)
    return RunRequest(SPEC, "spinning", Limits(60.0, wall_s), tmp_path / "campaign", project)


def written(request: RunRequest) -> dict:
    return json.loads((request.out / SPEC.folder / "outcome.json").read_text())


def is_running(pid: int) -> bool:
    stat = Path(f"/proc/{pid}/stat")
    return stat.exists() and "Z" not in stat.read_text().rpartition(")")[2].split()[0]


def summary(reason: str) -> str:
    return f"""echo '{{"stop_reason": "{reason}"}}' > "$out/summary.json"\n"""


def test_run_with_a_summary_is_finished(tmp_path):
    request = request_with(tmp_path, summary("explored: nothing left"))
    outcome = make_run(request)
    assert outcome == written(request)
    assert (outcome["world"], outcome["seed"], outcome["profile"], outcome["exit_code"]) == ("rooms", 3, "ours", 0)
    assert (outcome["status"], outcome["error"], outcome["attempts"]) == ("finished", None, 1)


def test_run_that_is_over_is_compared_with_the_clairvoyant(tmp_path):
    request = request_with(tmp_path, summary("explored: nothing left"))
    make_run(request)
    kept = json.loads((request.out / SPEC.folder / "summary.json").read_text())
    assert kept["clairvoyant_ratio"] is None
    assert kept["missing"] == ["clairvoyant: nothing is known of the views of sensor None; only of tilting, spinning"]


def test_run_is_made_with_the_sensor_that_was_asked_for(tmp_path):
    request = request_with(tmp_path, "")
    (request.project / "explore").write_text(f'#!/bin/bash\necho "$@" > {tmp_path}/asked\n')
    make_run(request)
    assert "--sensor spinning" in (tmp_path / "asked").read_text()


def test_run_is_made_with_the_campaign_s_robot_where_it_has_one(tmp_path):
    request = request_with(tmp_path, "")
    (request.project / "explore").write_text(f'#!/bin/bash\necho "$@" > {tmp_path}/asked\n')
    make_run(request)
    assert "--robot" not in (tmp_path / "asked").read_text()
    make_run(replace(request, robot="/robots/small.yaml"))
    assert "--robot /robots/small.yaml" in (tmp_path / "asked").read_text()


def test_run_is_made_with_the_campaign_s_movers_where_it_has_some(tmp_path):
    request = request_with(tmp_path, "")
    (request.project / "explore").write_text(f'#!/bin/bash\necho "$@" > {tmp_path}/asked\n')
    make_run(request)
    assert "--movers" not in (tmp_path / "asked").read_text()
    make_run(replace(request, movers="3"))
    assert "--movers 3" in (tmp_path / "asked").read_text()


def test_bad_hand_strikes_the_run_and_what_it_did_is_in_the_outcome(tmp_path, monkeypatch):
    monkeypatch.setattr(chaos, "blows", lambda _seed, _config: iter([chaos.Blow(0.5, "kill", "move_base_node", 0.0)]))
    clock = 'for t in 1 2 3 4 5 6 7 8 9; do echo "t=$t.0 s, 1 sweeps | driving"; sleep 0.5; done &\n'
    script = f"echo $asked > {tmp_path}/asked\n{clock}python3 -c 'import time; time.sleep(300)' __name:=move_base_node\n"
    told = """echo '{"stop_reason": "explored", "restarts": {"a": 2, "b": 1}}' > "$out/summary.json"\n"""
    request = request_with(tmp_path, script + told)
    outcome = make_run(replace(request, chaos=7))
    assert (outcome["status"], outcome["chaos"]) == ("finished", {"kill": 1, "stop": 0, "starve": 0, "restarts": 3})
    assert f"timing/faults={chaos.faults('7 runs/ours/rooms-3', 60.0)}" in (tmp_path / "asked").read_text()


def test_without_chaos_nothing_is_struck_or_silenced(tmp_path):
    request = request_with(tmp_path, f"echo $asked > {tmp_path}/asked\n" + summary("explored"))
    assert "chaos" not in make_run(request) and "silence" not in (tmp_path / "asked").read_text()


@pytest.mark.parametrize(
    ("reason", "status"),
    [
        ("time limit: 60 s simulated", "sim limit"),
        ("node died: icp_matcher_node", "crashed"),
        ("roslaunch was killed", "crashed"),
        ("the keeper of roslaunch was killed", "crashed"),
        ("rosmaster died", "crashed"),
        ("interrupted", "crashed"),
        ("trapped: no ground", "finished"),
    ],
)
def test_reason_of_the_stop_gives_the_status(tmp_path, reason, status):
    assert make_run(request_with(tmp_path, summary(reason) + "exit 1\n"))["status"] == status


def test_run_without_a_summary_has_crashed_and_its_last_words_are_kept(tmp_path):
    outcome = make_run(request_with(tmp_path, 'echo "it broke in $out"\nexit 7\n'))
    assert (outcome["status"], outcome["exit_code"]) == ("crashed", 7)
    assert "it broke in runs/ours/rooms-3" in outcome["error"] and "exit code 7" in outcome["error"]
    assert str(tmp_path) not in outcome["error"]


def test_summary_of_an_earlier_run_is_not_that_of_one_that_never_began(tmp_path):
    request = request_with(tmp_path, "echo 'explore: wrong argument'\nexit 2\n")
    folder = request.out / SPEC.folder
    folder.mkdir(parents=True)
    (folder / "summary.json").write_text('{"stop_reason": "explored: all", "success": true}')
    assert make_run(request)["status"] == "crashed" and not (folder / "summary.json").exists()


def test_each_run_tells_of_which_version_of_the_code_it_is(tmp_path):
    request = request_with(tmp_path, summary("explored"))
    git = ["git", "-C", str(request.project), "-c", "user.name=a", "-c", "user.email=a@b"]
    for words in (["init", "-q"], ["add", "explore"], ["commit", "-qm", "first"], ["tag", "-am", "one", "v1"]):
        subprocess.run([*git, *words], check=True)
    assert make_run(request)["version"] == "v1"


def test_run_that_hangs_is_interrupted_at_the_wall_limit(tmp_path):
    outcome = make_run(request_with(tmp_path, "trap 'exit 1' INT\nwhile :; do sleep 0.1; done\n", wall_s=0.5))
    assert outcome["status"] == "wall limit" and outcome["wall_s"] < 10.0


def test_run_that_does_not_listen_is_killed_with_its_children(tmp_path, monkeypatch):
    monkeypatch.setattr(runner_module, "_GRACE_S", 0.5)
    script = "trap '' INT\nsetsid sleep 300 &\necho $! > \"$out/child\"\nwhile :; do sleep 0.1; done\n"
    request = request_with(tmp_path, script, wall_s=3.0)
    assert make_run(request)["status"] == "wall limit"
    child = int((request.out / SPEC.folder / "child").read_text())
    deadline = time.monotonic() + 20.0
    while is_running(child) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not is_running(child)


def test_run_ends_with_the_worker_that_made_it(tmp_path):
    script = 'echo $$ > "$out/new"; mv "$out/new" "$out/pid"\nwhile :; do sleep 0.05; done\n'
    request = request_with(tmp_path, script)
    code = f"from evaluation_campaign.runner import *; from evaluation_campaign import *; from pathlib import *; make_run({request!r})"
    worker = subprocess.Popen(
        [sys.executable, "-c", code.replace("PosixPath", "Path")], env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    )
    folder = request.out / SPEC.folder
    deadline = time.monotonic() + 120.0
    while not (folder / "pid").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    worker.kill()
    worker.wait()
    run = int((folder / "pid").read_text())
    while is_running(run) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not is_running(run) and not (folder / "outcome.json").exists()


def test_earlier_attempt_that_still_runs_is_ended_first(tmp_path):
    request = request_with(tmp_path, summary("explored"))
    folder = request.out / SPEC.folder
    earlier = subprocess.Popen(["bash", "-c", "sleep 300; true", "explore", "--out", str(folder)])
    other = subprocess.Popen(["bash", "-c", "sleep 300; true", "explore", "--out", f"{folder}0"])
    try:
        assert make_run(request)["attempts"] == 1 and make_run(request)["attempts"] == 2
        assert earlier.wait(60.0) == -9 and other.poll() is None
    finally:
        other.kill()
        other.wait()


def test_full_disk_stops_before_a_run_begins(tmp_path, monkeypatch):
    monkeypatch.setattr(runner_module, "_LEAST_FREE_BYTES", 2**62)
    request = request_with(tmp_path, summary("explored"))
    with pytest.raises(DiskFull, match="MB free"):
        make_run(request)
    assert not (request.out / SPEC.folder / "outcome.json").exists()


def test_worker_that_waits_for_its_run_looks_about_once_a_second_and_profiles_nothing():
    names = ["profile.enabled", "memory.monitor-interval"]
    with cluster_client(None, 1) as client:
        (found,) = client.run(lambda: [dask.config.get(f"distributed.worker.{name}") for name in names]).values()
        (tick,) = client.run(lambda dask_worker: dask_worker.periodic_callbacks["tick"].callback_time).values()
    assert found == [False, "1s"] and tick == 1000.0
