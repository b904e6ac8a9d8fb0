"""Run folders against the clairvoyant: what the summary says, what is kept, and what is not known."""

import json

import numpy as np
import open3d as o3d
import pytest
from run_folder_on_disk import WORLD, write_run

from exploration_evaluation import add_clairvoyant, evaluate_run, format_summary, read_json, write_json
from exploration_evaluation.__main__ import main
from exploration_evaluation.clairvoyant_score import SUMMARY_KEYS

ONE_VIEW_S = 5.65 + 0.75  # the room of 4 x 4 m is seen from wherever the robot starts
FOLLOWER = {"move_base_node": {"follower": {"max_speed_mps": 0.5}}}


@pytest.fixture
def run(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    write_run(folder)
    change(folder / "run.json", sensor="tilting", config={**read_json(folder / "run.json")["config"], **FOLLOWER})
    mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(WORLD[0]), o3d.utility.Vector3iVector(WORLD[1].astype(np.int32)))
    o3d.io.write_triangle_mesh(str(folder / "world.ply"), mesh)
    evaluate_run(folder, *WORLD)
    return folder


def change(path, **values):
    write_json(path, {**read_json(path), **values})


def test_run_time_is_compared_with_that_of_the_same_kind_of_robot(run, tmp_path):
    summary = add_clairvoyant(run, tmp_path / "cache")
    assert summary["clairvoyant_time_s"] == pytest.approx(ONE_VIEW_S)
    assert summary["clairvoyant_ratio"] == pytest.approx(300.5 / ONE_VIEW_S)
    assert summary["missing"] == []
    assert json.loads((run / "summary.json").read_text()) == summary
    assert "of the clairvoyant's 0:06 min" in format_summary(summary)
    change(run / "summary.json", mapping="driving")
    summary = add_clairvoyant(run, tmp_path / "cache")
    assert summary["clairvoyant_time_s"] == summary["clairvoyant"]["driving_s"] == 0.0
    assert summary["clairvoyant_ratio"] is None  # of a world that is seen from the start
    assert summary["missing"] == ["clairvoyant: all is seen from the start, which takes a robot that maps while driving no time"]


def test_judging_alone_does_not_ask_the_clairvoyant(run):
    assert not set(SUMMARY_KEYS) & set(read_json(run / "summary.json"))


def test_what_was_computed_is_kept_for_the_next_run_from_the_same_place(run, tmp_path, monkeypatch):
    cache = tmp_path / "cache"
    first = add_clairvoyant(run, cache)
    with monkeypatch.context() as patched:
        patched.setattr("exploration_evaluation.clairvoyant_score.clairvoyant", None)
        assert add_clairvoyant(run, cache) == first
    (kept,) = cache.iterdir()
    kept.write_text("{")
    assert add_clairvoyant(run, cache) == first
    change(run / "summary.json", sensor="spinning")
    assert add_clairvoyant(run, cache)["clairvoyant_time_s"] == pytest.approx(3.0 + 0.75)
    assert len(list(cache.iterdir())) == 2


def test_cache_that_cannot_be_written_costs_time_only(run, tmp_path):
    (tmp_path / "file").touch()
    assert add_clairvoyant(run, tmp_path / "file")["clairvoyant_time_s"] == pytest.approx(ONE_VIEW_S)


def test_run_that_did_not_explore_all_has_no_ratio(run, tmp_path):
    change(run / "summary.json", faults=["not explored"])
    summary = add_clairvoyant(run, tmp_path)
    assert (summary["clairvoyant_time_s"], summary["clairvoyant_ratio"]) == (pytest.approx(ONE_VIEW_S), None)
    assert summary["missing"] == ["clairvoyant: no ratio for a run that did not explore all"]
    change(run / "summary.json", faults=["collision"])
    assert add_clairvoyant(run, tmp_path)["clairvoyant_ratio"] == pytest.approx(300.5 / ONE_VIEW_S)


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"sensor": "sonar"}, "nothing is known of the views of sensor sonar; only of tilting, spinning"),
        ({"sensor": None}, "nothing is known of the views of sensor None"),
        ({"config": {}}, "config/move_base_node/follower/max_speed_mps is not known"),
    ],
)
def test_what_is_not_known_is_said(run, tmp_path, changed, text):
    change(run / "summary.json", **changed)
    summary = add_clairvoyant(run, tmp_path)
    assert [summary[key] for key in SUMMARY_KEYS] == [None] * 3
    assert [line for line in summary["missing"] if text in line]


def test_run_that_was_not_judged_or_lacks_its_world(run, tmp_path):
    (run / "world.ply").unlink()
    assert add_clairvoyant(run, tmp_path)["missing"][-1].startswith("clairvoyant: no mesh at")
    (run / "summary.json").unlink()
    with pytest.raises(ValueError, match=r"summary\.json is not there"):
        add_clairvoyant(run, tmp_path)


def test_command_asks_the_clairvoyant_where_it_is_told_to(run, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    assert main([str(run), "--no-pictures", "--clairvoyant"]) == 0
    assert "of the clairvoyant's 0:06 min" in capsys.readouterr().out
    assert len(list((tmp_path / "home" / "explore_3dnav" / "clairvoyant").iterdir())) == 1
