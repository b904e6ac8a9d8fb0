"""The command line: what it means, and what is said of one that means nothing."""

import subprocess
import sys
from pathlib import Path

import pytest

from explore_command.arguments import REALISMS, ArgumentProblem, parse
from explore_command.results_folder import claimed_out, prepare_out
from pybullet_simulation import HARDWARE_OR_IDEAL


def test_defaults_are_the_ramp_seed_1_in_lock_step(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    a = parse([])
    assert (a.world, a.seed, a.lockstep, a.headless, a.rate) == ("ramp", 1, True, True, 0.0)
    assert a.out == tmp_path / "runs" / "ramp-1"
    assert a.force  # the default folder belongs to the runs


def test_out_that_was_named_is_not_overwritten_unasked(tmp_path: Path) -> None:
    assert not parse(["--out", str(tmp_path)]).force
    assert parse(["--out", str(tmp_path), "--force"]).force


@pytest.mark.parametrize(
    ("arguments", "display", "headless"),
    [([], ":0", False), ([], "", True), (["--headless"], ":0", True), (["--rviz"], "", False)],
)
def test_rviz_comes_where_there_is_a_display(monkeypatch: pytest.MonkeyPatch, arguments: list[str], display: str, headless: bool) -> None:
    monkeypatch.setenv("DISPLAY", display)
    assert parse(arguments).headless is headless


def test_world_file_becomes_an_absolute_path(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "garage.dae").touch()
    a = parse(["--world", "garage.dae", "--area", "40", "30", "--start", "1", "2", "0.5"])
    assert a.world == str(tmp_path / "garage.dae")
    assert (a.area, a.start, a.size) == ((40.0, 30.0), (1.0, 2.0, 0.5), None)
    assert a.out.name == "garage-1"


def test_unknown_world_is_told_with_those_there_are() -> None:
    with pytest.raises(ArgumentProblem, match="romms.*rooms, doors, ramp, moon"):
        parse(["--world", "romms"])


@pytest.mark.parametrize(
    "words", ["--area nan 5", "--area 5 5", "--size 5 5 5", "--models /nosuch", "--ground 0", "--world rooms --size 5 5 5"]
)
def test_what_is_for_files_is_refused_for_a_built_in_world(words: str) -> None:
    with pytest.raises(ArgumentProblem, match="--size, --area, --models and --ground are for files: (ramp|rooms) has its own$"):
        parse(words.split())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--area nan 5", "--area: lengths must be positive and finite"),
        ("--size 5 inf 5", "--size: lengths must be positive and finite"),
        ("--ground nan", "--ground nan: expected a height in metres"),
        ("--ground inf", "--ground inf: expected a height in metres"),
    ],
)
def test_number_of_a_file_world_that_is_not_finite_is_refused_by_its_name(tmp_path: Path, words: str, said: str) -> None:
    (tmp_path / "hall.stl").touch()
    with pytest.raises(ArgumentProblem, match=f"^{said}$"):
        parse(["--world", str(tmp_path / "hall.stl"), *words.split()])


def test_height_map_needs_its_size(tmp_path: Path) -> None:
    (tmp_path / "moon.png").touch()
    with pytest.raises(ArgumentProblem, match="--size X Y Z"):
        parse(["--world", str(tmp_path / "moon.png")])
    assert parse(["--world", str(tmp_path / "moon.png"), "--size", "5", "6", "1"]).size == (5.0, 6.0, 1.0)


@pytest.mark.parametrize(
    "arguments",
    [
        ["--rate", "-1"],
        ["--max-sim-time", "0"],
        ["--seed", "-1"],
        ["--area", "0", "5"],
        ["--size", "5", "-5", "1"],
        ["--set", "resolution=1"],
    ]
    + [["--set", "node/parameter"]],
    ids=" ".join,
)
def test_numbers_and_overrides_that_cannot_be_are_refused(arguments: list[str]) -> None:
    with pytest.raises(ArgumentProblem):
        parse(arguments)


@pytest.mark.parametrize("arguments", [["--sed", "x"], ["--seed", "one"], ["--headless", "--rviz"], ["--start", "one"]], ids=" ".join)
def test_what_cannot_be_parsed_ends_with_exit_code_two(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        parse(arguments)
    assert ended.value.code == 2
    assert "usage: ./explore" in capsys.readouterr().err


def test_overrides_are_kept_in_order() -> None:
    assert parse(["--set", "a/b=1", "--set", "c/d=2"]).set_parameters == ("a/b=1", "c/d=2")


def test_out_is_made_with_its_parents(tmp_path: Path) -> None:
    prepare_out(tmp_path / "a" / "b", force=False)
    assert list((tmp_path / "a" / "b").iterdir()) == []


def test_two_runs_at_a_time_never_share_a_folder(tmp_path: Path) -> None:
    out = tmp_path / "ramp-1"
    held = "import sys; from pathlib import Path; from explore_command.results_folder import claimed_out; "
    held += "print(claimed_out(Path(sys.argv[1]), False)[0], flush=True); sys.stdin.read()"
    with subprocess.Popen([sys.executable, "-c", held, str(out)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None and other.stdout.readline().strip() == str(out)
        assert claimed_out(out, may_be_another=True)[0] == tmp_path / "ramp-1-2"
        with pytest.raises(ArgumentProblem, match="another run writes into it"):
            claimed_out(out, may_be_another=False)
        other.communicate()
    assert claimed_out(out, may_be_another=False)[0] == out


def test_folder_that_holds_something_is_refused_without_force(tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_text("{}")
    with pytest.raises(ArgumentProblem, match="--force"):
        prepare_out(tmp_path, force=False)
    assert (tmp_path / "summary.json").exists()


def test_force_removes_the_old_run_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_text("{}")
    (tmp_path / "sweeps").mkdir()
    (tmp_path / "sweeps" / "0.npz").touch()
    (tmp_path / "thesis.txt").write_text("mine")
    prepare_out(tmp_path, force=True)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.txt"]


def test_folder_below_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(ArgumentProblem, match="cannot be written"):
        prepare_out(tmp_path / "file" / "run", force=True)


def test_folder_that_cannot_be_made_is_refused() -> None:
    with pytest.raises(ArgumentProblem, match="cannot be written"):
        prepare_out(Path("/proc/run"), force=True)


def test_run_is_of_hardware_and_free_running_in_real_time_unless_told_otherwise() -> None:
    asked = (["--free"], ["--free", "--rate", "0"], [], ["--rate", "2", "--realism", "ideal"])
    assert [(a.rate, a.realism) for a in map(parse, asked)] == [(1.0, "hardware"), (0.0, "hardware"), (0.0, "hardware"), (2.0, "ideal")]


def test_clairvoyant_is_asked_only_where_one_says_so() -> None:
    assert [parse(words).clairvoyant for words in ([], ["--clairvoyant"])] == [False, True]


def test_goals_need_a_map() -> None:
    with pytest.raises(ArgumentProblem, match="--map DIR names it"):
        parse(["--goals"])


def test_realisms_are_the_simulator_s() -> None:
    assert REALISMS == HARDWARE_OR_IDEAL


def test_movers_are_a_number_or_a_file(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text("- kind: person\n")
    assert [parse(["--movers", text]).movers for text in ("3", str(path))] == ["3", str(path)] and parse([]).movers == ""
    path.write_text("- kind: horse\n")
    for text, said in (("many", "neither a number nor a file"), ("99", "expected 0 to 50"), (str(path), "mover 1: kind = 'horse'")):
        with pytest.raises(ArgumentProblem, match=f"--movers .*{said}"):
            parse(["--movers", text])
