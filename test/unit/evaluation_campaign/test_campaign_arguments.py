"""./evaluate's command line: what it asks for, and what it refuses in one line."""

from pathlib import Path

import pytest

from evaluation_campaign.__main__ import main, parse
from evaluation_campaign.plan import Limits

ROOT = Path(__file__).resolve().parents[3]


def test_campaign_is_what_the_arguments_say(tmp_path):
    arguments = ["--worlds", "rooms,ramp", "--seeds", "2-3", "--profile", "ours,thesis", "--out", str(tmp_path), "--max-sim-time", "50"]
    campaign, _ = parse(arguments)
    assert (campaign.worlds, campaign.seeds, campaign.profiles) == (("rooms", "ramp"), (2, 3), ("ours", "thesis"))
    assert campaign.limits == Limits(50.0, 1800.0) and campaign.out == tmp_path


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--worlds", "romms"], "romms"),
        (["--profile", "ours,config/profiles/ours.yaml"], "two of these have the same name"),
        (["--profile", "thessis"], "profiles are mount_off, nearest, ours, thesis"),
        (["--seeds", "5-1"], "runs backwards"),
        (["--worlds", "docs/ramp.png"], "a height map has no size of its own"),
        (["--jobs", "0"], "must be positive"),
        (["--max-wall-time", "-1"], "must be positive"),
    ],
)
def test_what_cannot_be_run_is_one_line_and_exit_code_2(tmp_path, capsys, monkeypatch, arguments, text):
    monkeypatch.chdir(ROOT)
    assert main([*arguments, "--out", str(tmp_path / "c")]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and lines[0].startswith("./evaluate: ") and text in lines[0]
    assert not (tmp_path / "c").exists()


def test_profile_with_a_wrong_parameter_is_refused_with_the_nearest_name(tmp_path, capsys):
    profile = tmp_path / "mine.yaml"
    profile.write_text("move_base_node:\n  follower:\n    max_sped_mps: 0.4\n")
    assert main(["--profile", str(profile), "--out", str(tmp_path / "c")]) == 2
    assert "max_speed_mps" in capsys.readouterr().err


def test_scheduler_that_is_not_there_is_refused(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("evaluation_campaign.cluster._CONNECT_S", 0.5)
    assert main(["--worlds", "rooms", "--seeds", "1", "--scheduler", "tcp://127.0.0.1:9", "--out", str(tmp_path / "c")]) == 2
    assert "nobody answers there" in capsys.readouterr().err
