"""./evaluate's command line: what it asks for, and what it refuses in one line."""

import errno
import json
import signal
from pathlib import Path

import pytest
import yaml

from evaluation_campaign.__main__ import main
from evaluation_campaign.arguments import parse, parser
from evaluation_campaign.plan import BY_PROFILE, CampaignProblem, Limits, open_campaign
from explore_command.parameters import profile_names
from robot_body import RobotBody, robot_mapping

ROOT = Path(__file__).resolve().parents[3]


def test_campaign_is_what_the_arguments_say(tmp_path):
    arguments = ["--worlds", "rooms,ramp", "--seeds", "2-3", "--profile", "ours,thesis", "--out", str(tmp_path), "--max-sim-time", "50"]
    campaign, _ = parse(arguments)
    assert (campaign.worlds, campaign.seeds, campaign.profiles) == (("rooms", "ramp"), (2, 3), ("ours", "thesis"))
    assert campaign.movers == "" and parse([*arguments, "--movers", "3"])[0].movers == "3"
    assert campaign.limits == Limits(50.0, 1800.0) and campaign.out == tmp_path


def test_soak_takes_as_many_seeds_as_it_needs_and_movers_go_about_in_every_third(tmp_path):
    arguments = ["--worlds", "rooms,ramp", "--seeds", "2", "--soak", "9", "--movers", "3", "--chaos", "7", "--out", str(tmp_path)]
    campaign, _ = parse(arguments)
    assert (campaign.seeds, len(campaign.specs), campaign.chaos) == ((2, 3, 4, 5, 6), 10, 7)
    assert {spec.seed for spec in campaign.specs if campaign.movers_of(spec)} == {3, 6}


@pytest.fixture
def no_runs(monkeypatch):
    """Who would make runs all the same makes none."""
    monkeypatch.setattr("evaluation_campaign.__main__.run_campaign", lambda *_: pytest.fail("runs would be made"))


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--worlds", "romms"], "romms"),
        (["--profile", "ours,config/profiles/ours.yaml"], f"--profile ours and {ROOT}/config/profiles/ours.yaml have the same name"),
        (["--profile", "thessis"], f"profiles are {', '.join(profile_names())}"),
        (["--seeds", "5-1"], "runs backwards"),
        (["--worlds", "docs/ramp.png"], "a height map has no size of its own"),
        (["--jobs", "0"], "--jobs 0: expected 1 to 1000"),
        (["--jobs", "nan"], "invalid int value: 'nan'"),
        (["--soak", "-1"], "--soak -1: expected 1 to 10000"),
        (["--soak", "0"], "--soak 0: expected 1 to 10000"),
        (["--chaos", "-1"], "--chaos -1: expected 0 to "),
        (["--seeds", "1-99999999999"], "expected 10000 seeds at most"),
        (["--seeds", "1-6000,7000-12000"], "expected 10000 seeds at most"),
        (["--max-sim-time", "nan"], "--max-sim-time nan: expected 1 to 1000000"),
        (["--max-sim-time", "inf"], "--max-sim-time inf: expected 1 to 1000000"),
        (["--max-sim-time", "0"], "--max-sim-time 0.0: expected 1 to 1000000"),
        (["--max-wall-time", "nan"], "--max-wall-time nan: expected 1 to 1000000"),
        (["--sensor", "sonar"], "argument --sensor: invalid choice: 'sonar'"),
        (["--sedes", "1"], "unrecognized arguments: --sedes 1"),
        (["--movers", "0"], "--movers 0: expected 1 or more"),
        (["--movers", "many"], "--movers many is neither a number nor a file of movers"),
        (["--max-wall-time", "-1"], "--max-wall-time -1.0: expected 1 to 1000000"),
    ],
)
def test_what_cannot_be_run_is_one_line_and_exit_code_2(tmp_path, capsys, monkeypatch, no_runs, arguments, text):
    monkeypatch.chdir(ROOT)
    assert main([*arguments, "--out", str(tmp_path / "c")]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and lines[0].startswith("./evaluate: ") and text in lines[0]
    assert not (tmp_path / "c").exists()


def test_worlds_whose_runs_would_share_a_folder_are_refused_and_both_are_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for path in (Path("a/house.obj"), Path("b/house.obj"), Path("b/ramp.obj"), Path("b/house.ply")):
        path.parent.mkdir(exist_ok=True)
        path.touch()
    here = f"{tmp_path}/"
    for first, second in ((f"{here}a/house.obj", "b/house.obj"), ("ramp", "b/ramp.obj"), (f"{here}b/house.obj", "b/house.ply")):
        with pytest.raises(CampaignProblem, match=f"^--worlds {first} and {here}{second} have the same name"):
            parse(["--worlds", f"moon,{first},{second}", "--out", "c"])


def test_world_that_is_named_twice_is_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("house.obj").touch()
    campaign, _ = parse(["--worlds", f"house.obj,./house.obj,{tmp_path}/house.obj,rooms", "--seeds", "1", "--out", "c"])
    assert campaign.worlds == (str(tmp_path / "house.obj"), "rooms")


def test_profile_of_a_file_is_found_from_every_folder(tmp_path, monkeypatch, no_runs):
    monkeypatch.chdir(tmp_path)
    Path("mine.yaml").write_text("")
    words = ["--profile", f"ours,mine.yaml,./mine.yaml,{tmp_path}/mine.yaml", "--seeds", "1", "--out", "c"]
    campaign, _ = parse(words)
    assert campaign.profiles == ("ours", str(tmp_path / "mine.yaml"))
    open_campaign(campaign, {})
    assert parse([*words, "--report-only"])[0] == campaign


def test_campaign_from_before_profiles_had_full_paths_goes_on(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("mine.yaml").write_text("")
    words = ["--profile", "ours,mine.yaml", "--seeds", "1", "--out", "c"]
    campaign, _ = parse(words)
    open_campaign(campaign, {})
    path = campaign.out / "campaign.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "profiles": ["ours", "mine.yaml"]}))
    assert parse([*words, "--report-only"])[0] == campaign
    open_campaign(campaign, {})
    assert json.loads(path.read_text())["profiles"] == ["ours", str(tmp_path / "mine.yaml")]


def test_profile_with_a_wrong_parameter_is_refused_with_the_nearest_name(tmp_path, capsys):
    profile = tmp_path / "mine.yaml"
    profile.write_text("move_base_node:\n  follower:\n    max_sped_mps: 0.4\n")
    assert main(["--profile", str(profile), "--out", str(tmp_path / "c")]) == 2
    assert "max_speed_mps" in capsys.readouterr().err


def test_caller_s_signals_stay_as_they_were(tmp_path):
    """A process that calls it, as a test does, is not to be interrupted by what ends the process."""
    numbers = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
    before = [signal.getsignal(number) for number in numbers]
    assert main(["--jobs", "0", "--out", str(tmp_path / "c")]) == 2
    assert [signal.getsignal(number) for number in numbers] == before


def test_scheduler_that_is_not_there_is_refused(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("evaluation_campaign.cluster._CONNECT_S", 0.5)
    assert main(["--worlds", "rooms", "--seeds", "1", "--scheduler", "tcp://127.0.0.1:9", "--out", str(tmp_path / "c")]) == 2
    assert "nobody answers there" in capsys.readouterr().err


def test_robot_of_all_runs_is_checked_with_every_profile(tmp_path, capsys):
    robot, profile = tmp_path / "robot.yaml", tmp_path / "mine.yaml"
    robot.write_text(yaml.safe_dump({**robot_mapping(RobotBody()), "max_step_m": 0.05}))
    profile.write_text("robot: {max_step_m: 0.16}\n")
    campaign, _ = parse(["--robot", str(robot), "--out", str(tmp_path / "c")])
    assert campaign.robot == str(robot) and parse(["--out", str(tmp_path / "c")])[0].robot == ""
    assert main(["--robot", str(robot), "--profile", f"ours,{profile}", "--out", str(tmp_path / "c")]) == 2
    assert "ground_clearance_m = 0.132 is below max_step_m = 0.16" in capsys.readouterr().err
    robot.write_text("width_m: -1\n")
    assert main(["--robot", str(robot), "--out", str(tmp_path / "c")]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == len(robot_mapping(RobotBody())) and all(line.startswith("./evaluate: --robot ") for line in lines)


def test_fixed_lidar_decides_for_sensor_and_mapping_of_all_runs(tmp_path, capsys):
    robot = ["--robot", str(ROOT / "config" / "robots" / "husky_vlp16.yaml"), "--out", str(tmp_path / "c")]
    campaign, _ = parse(robot)
    assert (campaign.sensor, campaign.mapping) == ("spinning", BY_PROFILE)
    campaign, _ = parse(["--out", str(tmp_path / "c")])
    assert (campaign.sensor, campaign.mapping) == ("tilting", BY_PROFILE)
    assert main([*robot, "--mapping", "stop_and_go"]) == 2
    assert "set it to driving" in capsys.readouterr().err and not (tmp_path / "c").exists()


def test_help_lists_the_profiles_that_an_error_does():
    assert ", ".join(profile_names()) in " ".join(parser().format_help().split())


@pytest.fixture
def reported(tmp_path, monkeypatch, no_runs):
    """A folder with a campaign of worlds that are gone, and the folders of which reports were written."""
    folders = []

    def write_report(out):
        folders.append(out)
        return []

    monkeypatch.setattr("evaluation_report.write_report", write_report)
    (tmp_path / "gone.obj").touch()
    words = ["--worlds", f"rooms,{tmp_path}/gone.obj", "--seeds", "1-2", "--max-sim-time", "50", "--sensor", "spinning", "--chaos", "3"]
    campaign, _ = parse([*words, "--out", str(tmp_path / "c")])
    open_campaign(campaign, {})
    (tmp_path / "gone.obj").unlink()
    for spec in campaign.specs[:3]:
        (campaign.out / spec.folder).mkdir(parents=True)
        (campaign.out / spec.folder / "outcome.json").write_text('{"status": "finished"}')
    return campaign, folders, words


def test_report_alone_is_of_the_campaign_that_the_folder_holds(reported, capsys):
    campaign, folders, words = reported
    alone = ["--out", str(campaign.out), "--report-only"]
    before = (campaign.out / "campaign.json").read_bytes()
    for more in ([], words):
        assert parse([*alone, *more])[0] == campaign
        assert main([*alone, *more]) == 1 and "missing: " in capsys.readouterr().out
    assert folders == [campaign.out] * 2 and (campaign.out / "campaign.json").read_bytes() == before


@pytest.mark.parametrize(
    ("fault", "code", "text"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), 1, "No space left on device; finished runs stay"),
        (KeyboardInterrupt(), 130, "interrupted; finished runs stay"),
        (ValueError("outcome.json\ncannot be read"), 2, ": outcome.json cannot be read"),
    ],
)
def test_report_that_cannot_be_written_is_one_line_and_the_exit_code_of_a_run(reported, capsys, monkeypatch, fault, code, text):
    campaign, _, _ = reported

    def write_report(_out):
        raise fault

    monkeypatch.setattr("evaluation_report.write_report", write_report)
    assert main(["--out", str(campaign.out), "--report-only"]) == code
    said = capsys.readouterr().err.strip()
    assert said.startswith("./evaluate: ") and text in said and "\n" not in said


def test_report_alone_tells_all_that_differs_at_once(reported, capsys):
    campaign, folders, _ = reported
    assert main(["--out", str(campaign.out), "--report-only", "--seeds", "1-3", "--sensor", "tilting", "--realism", "hardware"]) == 2
    text = capsys.readouterr().err
    assert "--seeds 1,2, not 1,2,3; --sensor spinning, not tilting; --report-only needs none" in text and text.count("\n") == 1
    assert folders == []


@pytest.mark.parametrize("there", [False, True])
def test_report_of_a_folder_without_a_campaign_is_one_line_and_writes_nothing(tmp_path, capsys, no_runs, there):
    folder = tmp_path / "c"
    if there:
        folder.mkdir()
    assert main(["--out", str(folder), "--report-only"]) == 2
    text = capsys.readouterr().err
    assert "no campaign is there to report of" in text and text.count("\n") == 1
    assert folder.exists() == there and not list(tmp_path.rglob("*.*"))


@pytest.mark.parametrize(
    "changed", [{"limits": 3}, {"worlds": None}, {"format": 2}, {"limits": {"sim_s": "long", "wall_s": 1}}, {"limits": {"wall": 1}}]
)
def test_campaign_that_does_not_say_what_was_asked_is_one_line(reported, capsys, changed):
    campaign, folders, _ = reported
    path = campaign.out / "campaign.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **changed}))
    assert main(["--out", str(campaign.out), "--report-only"]) == 2
    text = capsys.readouterr().err
    assert text.startswith(f"./evaluate: --out {campaign.out}: ") and text.count("\n") == 1 and folders == []


def test_folder_whose_limit_was_no_number_has_a_report_all_the_same(reported):
    campaign, folders, _ = reported
    path = campaign.out / "campaign.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "limits": {"sim_s": None, "wall_s": 1.0}}))
    assert main(["--out", str(campaign.out), "--report-only"]) == 1 and folders == [campaign.out]
