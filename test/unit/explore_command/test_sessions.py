"""--resume and --map: which run goes on, and what is said where there is none."""

import json
from pathlib import Path

import numpy as np
import pytest

from explore_command import __main__ as explore_main
from explore_command import arguments
from explore_command.__main__ import main
from explore_command.arguments import ArgumentProblem, parse
from explore_command.results_folder import prepare_out
from explore_command.sessions import clock_after, earlier_run
from pose_graph_mapping.graph.pose_graph import PoseGraph
from pose_graph_mapping.session.session_record import Measured
from pose_graph_mapping.session.session_store import SessionStore
from robot_body import RobotBody, robot_mapping


@pytest.fixture
def session(tmp_path: Path) -> Path:
    """A run of rooms 7 with one sweep of stamp 42.5."""
    folder = tmp_path / "earlier"
    graph = PoseGraph()
    graph.add_vertex(np.eye(4))
    points = np.ones((300, 3))
    SessionStore(folder).add_sweep(0, 42.5, points, 0.0 * points, graph, Measured(np.eye(4)))
    (folder / "run.json").write_text(json.dumps({"world": "rooms", "seed": 7, "sensor": "spinning"}))
    (folder / "summary.json").write_text("{}")
    return folder


def test_run_goes_on_in_its_folder_world_and_seed(session: Path) -> None:
    a = parse(["--resume", str(session)])
    assert (a.out, a.resume, a.map, a.world, a.seed, a.sensor) == (session, True, None, "rooms", 7, "spinning")
    assert parse(["--world", "rooms"]).sensor is None


def test_run_goes_on_among_the_movers_that_it_had(session: Path) -> None:
    assert parse(["--resume", str(session)]).movers == ""
    config = {"pybullet_sim_node": {"movers": 3}}
    (session / "run.json").write_text(json.dumps({"world": "rooms", "seed": 7, "config": config}))
    assert parse(["--resume", str(session)]).movers == "3" and parse(["--resume", str(session), "--movers", ""]).movers == ""


@pytest.mark.parametrize("option", ["--resume", "--map"])
def test_run_goes_on_in_its_world_as_that_was_described(session: Path, tmp_path: Path, option: str) -> None:
    hall = tmp_path / "hall.stl"
    hall.touch()
    simulator = {"world": str(hall), "area": "20 15", "ground": "-0.5", "scale": "0.001", "up": "y", "models": "/a:/b", "start": "1 2 0.5"}
    told = {"world": str(hall), "seed": 7, "profile": "thesis", "config": {"pybullet_sim_node": {**simulator, "size": ""}}}
    (session / "run.json").write_text(json.dumps(told))
    a = parse([option, str(session)])
    assert (a.area, a.ground, a.scale, a.up, a.size) == ((20.0, 15.0), -0.5, 0.001, "y", None)
    assert (a.models, a.start, a.profile) == ((Path("/a"), Path("/b")), (1.0, 2.0, 0.5), "thesis")
    anew = parse([option, str(session), "--area", "5", "6", "--ground", "0", "--profile", "ours", "--world", str(hall)])
    assert (anew.area, anew.ground, anew.scale, anew.profile) == ((5.0, 6.0), 0.0, 0.001, "ours")
    other = parse([option, str(session), "--world", "rooms"])
    assert (other.area, other.ground, other.scale, other.models) == (None, None, None, ())


def test_run_goes_on_within_its_zones_and_with_what_it_touched(session: Path, tmp_path: Path) -> None:
    assert parse(["--resume", str(session)]).zones is None
    for name in ("zones.yaml", "contacts.csv"):
        (session / name).write_text("no_go: []\n")
    prepare_out(session, force=True, keep_session=True)
    assert (session / "contacts.csv").exists() and parse(["--resume", str(session)]).zones == session / "zones.yaml"
    assert parse(["--map", str(session)]).zones is None
    (tmp_path / "mine.yaml").write_text("no_go: []\n")
    assert parse(["--resume", str(session), "--zones", str(tmp_path / "mine.yaml")]).zones == tmp_path / "mine.yaml"
    prepare_out(session, force=True)
    assert not (session / "zones.yaml").exists() and not (session / "contacts.csv").exists()


def test_map_is_explored_in_another_folder(session: Path) -> None:
    a = parse(["--map", str(session), "--seed", "3"])
    assert (a.resume, a.map, a.world, a.seed) == (False, session, "rooms", 3)
    assert a.out.name == "rooms-3-more"
    assert parse(["--map", str(session), "--goals"]).out.name == "rooms-7-goals"


def test_map_is_never_the_folder_of_the_run_that_starts_in_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, session: Path) -> None:
    monkeypatch.chdir(tmp_path)
    session.rename(tmp_path / "rooms-7")
    (tmp_path / "runs").symlink_to(tmp_path)
    assert all(parse(["--map", "runs/rooms-7", *more]).out.name != "rooms-7" for more in ([], ["--goals"]))
    with pytest.raises(ArgumentProblem, match="would overwrite it"):
        parse(["--map", "runs/rooms-7", "--out", "rooms-7", "--force"])


def test_seed_zero_is_a_seed(session: Path) -> None:
    (session / "run.json").write_text(json.dumps({"world": "rooms", "seed": 0}))
    assert parse(["--resume", str(session)]).seed == 0


@pytest.mark.parametrize("more", [["--out", "elsewhere"], ["--map", "elsewhere"]])
def test_resuming_has_one_folder(session: Path, more: list[str]) -> None:
    with pytest.raises((ArgumentProblem, SystemExit)):
        parse(["--resume", str(session), *more])


def test_clock_goes_on_after_the_last_sweep(session: Path) -> None:
    assert clock_after(session, "--resume") > 50.0
    assert earlier_run(session).seed == 7


def test_folder_without_a_session_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match="--map .*no session there"):
        clock_after(tmp_path, "--map")
    (tmp_path / "sweeps").mkdir()
    with pytest.raises(ValueError, match="holds no sweep"):
        clock_after(tmp_path, "--map")
    assert main(["--resume", str(tmp_path / "absent"), "--world", "rooms"]) == 2
    assert "no session there" in capsys.readouterr().err
    assert earlier_run(tmp_path).world is None


def test_sweeps_of_a_run_that_goes_on_stay(session: Path) -> None:
    prepare_out(session, force=True, keep_session=True)
    assert (session / "sweeps" / "000000.npz").exists() and not (session / "summary.json").exists()
    prepare_out(session, force=True)
    assert not (session / "sweeps").exists()


def test_what_a_run_recorded_stays_where_it_goes_on_and_goes_with_it(session: Path) -> None:
    recorded = {"run.bag", "run_2.bag", "run_3.bag.active"}
    for name in (*recorded, "run_monday.bag", "my.bag"):
        (session / name).touch()
    prepare_out(session, force=True, keep_session=True)
    assert recorded <= {path.name for path in session.iterdir()}
    with pytest.raises(ArgumentProblem, match="would overwrite it"):
        prepare_out(session, force=True, inputs=[session / "run_2.bag"])
    prepare_out(session, force=True)
    assert {path.name for path in session.iterdir()} == {"run_monday.bag", "my.bag"}


def test_run_that_was_resumed_and_stopped_at_once_goes_on_as_it_was_started(session: Path) -> None:
    """The monitor writes run.json anew seconds later, and who waits for it must not take the old one for it."""
    (session / "robot.yaml").write_text("name: mine\n")
    for _ in range(2):
        prepare_out(session, force=True, keep_session=True)
        assert not (session / "run.json").exists() and (session / "robot.yaml").exists()
        found = earlier_run(session)
        assert (found.world, found.seed, found.sensor, found.robot) == ("rooms", 7, "spinning", session / "robot.yaml")
    (session / "run.json").write_text(json.dumps({"world": "moon", "seed": 3}))
    assert earlier_run(session).seed == 3
    prepare_out(session, force=True)
    assert list(session.iterdir()) == []


def test_full_disk_takes_nothing_from_an_earlier_run(session: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_path: Path, _content: bytes) -> int:
        raise OSError(28, "No space left on device")

    before = sorted(path.name for path in session.iterdir())
    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(ArgumentProblem, match="is full: make room there"):
        prepare_out(session, force=True)
    assert sorted(path.name for path in session.iterdir()) == before


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (["--zones"], "zones.yaml"),
        (["--profile"], "overrides.yaml"),
        (["--robot"], "robot.yaml"),
        (["--movers"], "log/movers.yaml"),
        (["--size", "2", "2", "1", "--start", "0", "0", "0", "--world"], "map_top.png"),
    ],
)
def test_input_that_the_run_would_remove_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: list[str], name: str
) -> None:
    out = tmp_path / "out"
    file = out / name
    file.parent.mkdir(parents=True)
    file.write_text(json.dumps(robot_mapping(RobotBody())) if "--robot" in words else "{}")
    monkeypatch.setattr(explore_main, "limits_problem", lambda: None)
    monkeypatch.setattr(explore_main, "world_problem", lambda *_: None)
    monkeypatch.setattr(explore_main, "run_launch", lambda *_: 0)
    monkeypatch.setattr(arguments, "check_zones", lambda *_: None)
    monkeypatch.setattr(arguments, "check_movers", lambda *_: None)
    assert main(["--out", str(out), "--force", *words, str(file)]) == 2
    assert f"{file}: the run in {out} would overwrite it" in capsys.readouterr().err and file.exists()
    assert main(["--out", str(tmp_path / "other"), *words, str(file)]) == 0


def test_clock_goes_on_after_the_latest_stamp_of_a_session_whose_clock_was_set_back(session: Path) -> None:
    store, points = SessionStore(session), np.ones((300, 3))
    graph = store.graph_on_disk()
    graph.add_vertex(np.eye(4))
    store.add_sweep(1, 7.0, points, 0.0 * points, graph, Measured(np.eye(4)))
    assert clock_after(session, "--resume") > 50.0
