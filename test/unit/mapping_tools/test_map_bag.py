"""A recording becomes a session folder: bags whole, cut and wrong, folders with and without poses, and runs that go on."""

import itertools
import json
import os
import signal
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import open3d as o3d
import pytest
import recordings
from recordings import TRUTH, cloud_message, drive, odometry, odometry_message, pose, refusal, write_bag, write_folder
from rosbags.rosbag1 import Writer

from mapping_tools import map_bag, mapping_run
from mapping_tools.bag_records import BagRecords
from mapping_tools.bag_sweeps import BagSweeps, BagTopics, gravity_of
from mapping_tools.recording import Recording
from mapping_tools.session_sweeps import SessionSweeps
from pose_graph_mapping.graph.pose_graph import PoseGraph
from pose_graph_mapping.registration.matching import RegistrationResult, Verdict
from pose_graph_mapping.session.session_store import NotOnDiskError, SessionStore
from rigid_geometry import inverse, transform_from_rpy, transform_points, translation_distance

FAST = ("--set", "num_icp_tries=1")


@pytest.fixture(autouse=True)
def signals_as_in_the_foreground():
    """A shell has interrupts ignored in the background; the tests' conftest puts back what was there."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


@pytest.fixture(scope="session")
def clouds():
    return recordings.sweeps()


@pytest.fixture(scope="session")
def bag(tmp_path_factory, clouds):
    return write_bag(tmp_path_factory.mktemp("bag") / "run.bag", drive(clouds))


def mapped(recording, out, *words):
    """Exit code and summary of a run."""
    code = map_bag.main([str(recording), "--out", str(out), "--quiet", *map(str, words)])
    path = out / map_bag.SUMMARY
    return code, json.loads(path.read_text()) if path.exists() else None


TOPICS_OF = {
    "as it is": BagTopics().tracked(["/odom", "/odom_tracked"]),
    "named": BagTopics(odometry="/odom_tracked").tracked(["/odom", "/odom_tracked"]),
    "not tracked": BagTopics().tracked(["/odom"]),
}


def error_of(out, truth=TRUTH):
    """Greatest distance of the final poses from the true ones, both seen from the first."""
    poses = PoseGraph.load_g2o(out / "graph.g2o").poses()
    pairs = zip(poses, truth, strict=True)
    return max(translation_distance(inverse(poses[0]) @ a, inverse(truth[0]) @ b) for a, b in pairs)


def test_sweeps_that_were_tracked_are_placed_by_the_tracked_odometry_and_have_up_from_the_other(tmp_path, clouds):
    leaning = transform_from_rpy((0.3, 0.0, 0.0), (0.02, 0.0, 0.1))
    plain, tracked = odometry()[:3], [leaning @ T for T in odometry()[:3]]
    messages = drive(clouds[:3], plain)
    others = [m for m in drive(clouds[:3], tracked, odom_topic="/odom_tracked") if m[0] == "/odom_tracked"]
    path = write_bag(tmp_path / "x.bag", [*messages[:3], *others[:2], *messages[3:6], *others[2:4], *messages[6:], *others[4:]])
    found = {name: list(BagSweeps(Recording([path]), t, None, None).sweeps()) for name, t in TOPICS_OF.items()}
    assert [len(rows) for rows in found.values()] == [3, 3, 3]
    for k in range(3):
        np.testing.assert_allclose(found["as it is"][k].T_odom_base, tracked[k], atol=1e-9)
        np.testing.assert_allclose(found["as it is"][k].gravity_base, plain[k][2, :3], atol=1e-9)
        np.testing.assert_allclose(found["named"][k].T_odom_base, tracked[k], atol=1e-9)
        np.testing.assert_allclose(found["named"][k].gravity_base, tracked[k][2, :3], atol=1e-9)
        np.testing.assert_allclose(found["not tracked"][k].T_odom_base, plain[k], atol=1e-9)


def test_odometry_that_is_named_comes_before_the_tracked_one(tmp_path, clouds):
    tracked = [transform_from_rpy((9.0, 0.0, 0.0)) @ T for T in odometry()[:2]]
    messages = drive(clouds[:2], odometry()[:2]) + [
        m for m in drive(clouds[:2], tracked, odom_topic="/odom_tracked") if m[0] == "/odom_tracked"
    ]
    path = write_bag(tmp_path / "x.bag", messages)
    mapped(path, tmp_path / "plain", "--odom-topic", "/odom", *FAST)
    mapped(path, tmp_path / "tracked", *FAST)
    first = [SessionStore(tmp_path / name).sweeps[0].measured.T_odom_base for name in ("plain", "tracked")]
    np.testing.assert_allclose(first, [odometry()[0], tracked[0]], atol=1e-6)


def test_bag_becomes_a_session_that_others_open(bag, tmp_path):
    code, summary = mapped(bag, tmp_path)
    assert code == 0 and summary["complete"] and (summary["read"], summary["vertices"], summary["not_placed"]) == (5, 5, [])
    assert translation_distance(odometry()[-1], TRUTH[-1]) > 0.15 and error_of(tmp_path) < 0.03
    assert [s.stamp_s for s in SessionStore(tmp_path).sweeps] == pytest.approx([5.0, 15.0, 25.0, 35.0, 45.0])
    assert len(np.loadtxt(tmp_path / "trajectory.txt")) == 5
    for name in ("cloud.ply", "cloud.pcd"):
        assert len(o3d.io.read_point_cloud(str(tmp_path / name)).points) > 5000
    assert summary["config"]["mapping"]["map_voxel_m"] == 0.04
    assert SessionStore(tmp_path).sweeps[1].measured.gravity_sigma_rad == pytest.approx(recordings.SIGMA_RAD)


@pytest.mark.parametrize("compression", [Writer.CompressionFormat.BZ2, Writer.CompressionFormat.LZ4, None])
def test_bag_that_was_cut_gives_what_it_holds(tmp_path, clouds, compression):
    path = write_bag(tmp_path / "whole.bag", drive(clouds), compression)
    cut = tmp_path / "cut.bag"
    cut.write_bytes(path.read_bytes()[: int(0.7 * path.stat().st_size)])
    code, summary = mapped(cut, tmp_path / "out", *FAST)
    assert code == 1 and 2 <= summary["vertices"] < 5 and summary["read_until_s"] == pytest.approx(10 * summary["vertices"] - 5)
    assert "breaks off after" in summary["problems"][0]


def test_bag_whose_recorder_was_killed_is_read_without_its_index(tmp_path, bag):
    data = bag.read_bytes()
    at = data.index(b"index_pos=") + len(b"index_pos=")
    unclosed = tmp_path / "killed.bag"
    unclosed.write_bytes(data[:at] + bytes(8) + data[at + 8 : int.from_bytes(data[at : at + 8], "little")])
    code, summary = mapped(unclosed, tmp_path / "out", *FAST)
    assert code == 1 and summary["vertices"] == 5 and "never closed" in summary["problems"][0]


def test_records_are_the_messages_of_the_bag(bag):
    with BagRecords(bag) as records:
        topics = [message.topic for message in records.messages()]
        assert topics == ["/odom", "/sweep_cloud", "/odom"] * 5 and records.problem is None
        assert records.topics == {"/odom": "nav_msgs/msg/Odometry", "/sweep_cloud": "sensor_msgs/msg/PointCloud2"}


def test_garbage_in_the_middle_of_a_bag_ends_it_there(tmp_path, bag):
    data = bytearray(bag.read_bytes())
    middle = len(data) // 2
    data[middle:] = b"\xff" * (len(data) - middle)
    (tmp_path / "bad.bag").write_bytes(data)
    with BagRecords(tmp_path / "bad.bag") as records:
        assert 0 < len(list(records.messages())) < 15
        assert records.problem is not None


def test_sweeps_that_cannot_be_placed_are_named_and_the_others_mapped(tmp_path, clouds):
    messages = drive(clouds[:3], odometry()[:3])
    messages[4] = ("/sweep_cloud", cloud_message(15.0, *(part[:50] for part in clouds[1])))
    messages.append(("/sweep_cloud", cloud_message(99.0, *clouds[3])))
    code, summary = mapped(write_bag(tmp_path / "some.bag", messages), tmp_path / "out", *FAST)
    assert (code, summary["vertices"], summary["complete"]) == (1, 2, False)
    assert [entry["sweep"] for entry in summary["not_placed"]] == ["/sweep_cloud 1", "/sweep_cloud 3"]
    assert "50 finite points" in summary["not_placed"][0]["reason"] and "does not reach" in summary["not_placed"][1]["reason"]


def test_robot_that_was_carried_is_looked_for_in_the_map(tmp_path, clouds):
    path = write_bag(tmp_path / "x.bag", recordings.lifted(clouds, odometry(), since=3))
    code, summary = mapped(path, tmp_path / "out", *FAST)
    assert code == 0 and summary["vertices"] == len(TRUTH) and error_of(tmp_path / "out") < 0.06
    found = list(SessionSweeps(SessionStore(tmp_path / "out"), range(len(TRUTH)), 0.0).sweeps())
    backwards = list(SessionSweeps(SessionStore(tmp_path / "out"), range(len(TRUTH) - 1, -1, -1), 0.0).sweeps())
    assert [sweep.lost for sweep in found] == [False, False, False, True, False]
    assert [sweep.lost for sweep in backwards] == [False, False, True, False, False]


def test_match_that_is_refused_leaves_odometry_and_says_so(tmp_path, clouds):
    strange = [(np.asarray(points * [1.3, 1, 1], np.float32), origins) for points, origins in clouds[:2]]
    code, summary = mapped(write_bag(tmp_path / "x.bag", drive([clouds[0], strange[1]], odometry()[:2])), tmp_path / "out", *FAST)
    assert code == 0 and summary["vertices"] == 2
    assert [entry["vertex_id"] for entry in summary["by_odometry_alone"]] == [1]


def test_wrong_recordings_and_arguments_are_refused_with_the_reason(tmp_path, clouds, bag, capsys):
    out = ("--out", tmp_path / "out")
    (tmp_path / "text.bag").write_text("hello")
    (tmp_path / "empty").mkdir()
    odd = write_bag(tmp_path / "odd.bag", [("/sweep_cloud", odometry_message(0.0, TRUTH[0]))])
    cases = [
        ((tmp_path / "no.bag", *out), "no such bag"),
        ((tmp_path / "text.bag", *out), "not a rosbag of version 2.0"),
        ((tmp_path / "empty", *out), "no .ply or .pcd or .vtk or .xyz or .npz files"),
        (
            (bag, *out, "--cloud-topic", "/points"),
            "no sensor_msgs/msg/PointCloud2 on topic /points; topics in it: /odom (nav_msgs/msg/Odometry), /sweep_cloud",
        ),
        ((bag, *out, "--odom-topic", "/o"), "no nav_msgs/msg/Odometry on topic /o; topics in it: /odom"),
        ((odd, *out), "topic /sweep_cloud holds nav_msgs/msg/Odometry"),
        ((bag,), "--out"),
        ((bag, *out, "--set", "vertex_voxel=1"), "did you mean vertex_voxel_m?"),
        ((bag, *out, "--set", "vertex_voxel_m=-1"), "is below"),
        ((bag, *out, "--set", "vertex_voxel_m=[1"), "'[1' is no value"),
        ((bag, *out, "--mount", 0, 0, "nan", 0, 0, 0), "--mount 0 0 nan 0 0 0: expected 6 finite numbers"),
        ((bag, *out, "--sensor", 0, 0, "inf"), "--sensor 0 0 inf: expected 3 finite numbers"),
        ((bag, *out, "--min-travel", -1), "--min-travel -1: expected 0 or more"),
        ((bag, *out, "--min-travel", "nan"), "--min-travel nan"),
        ((bag, *out, "--moved"), "--moved: has no effect without --resume"),
        ((bag, *out, "--no-odometry", "--odom-topic", "/odom"), "--odom-topic: has no effect"),
        ((bag, *out, "--no-odometry", "--min-travel", 1), "--min-travel: has no effect"),
        ((bag, *out, "--imu-topic", "/imu"), "--imu-topic: has no effect on finished clouds"),
        ((bag, *out, "--robot", "husky"), "--robot: has no effect on finished clouds"),
        ((bag, *out, "--mount-calibration", "auto"), "--mount-calibration: has no effect"),
        ((bag, *out, "--resume"), "holds no session"),
        ((bag, "--out", tmp_path / "text.bag" / "x"), "text.bag is a file, expected a folder"),
        ((bag, "--out", tmp_path / "text.bag"), "--out"),
        ((bag, "--out", bag), "is the recording, which is only read"),
        ((bag, "--out", bag.parent), "run.bag itself lies there"),
        ((write_folder(tmp_path / "scans", clouds[:1]), "--out", tmp_path / "scans"), "is the recording"),
    ]
    for words, reason in cases:
        assert reason in refusal(capsys, *words, "--quiet"), words
    assert [path.name for path in bag.parent.iterdir()] == ["run.bag"] and not (tmp_path / "scans" / "sweeps").exists()


@pytest.mark.parametrize("own", ["run.json", "sweeps/index.json"])
def test_folder_of_a_run_is_no_folder_of_sweeps_and_its_sweeps_are(tmp_path, clouds, capsys, own):
    run = write_folder(tmp_path / "run", clouds[:1])
    (run / own).parent.mkdir(exist_ok=True)
    (run / own).write_text("{}")
    assert "is the folder of a run or session" in refusal(capsys, run, "--out", tmp_path / "out", "--quiet")
    SessionStore(tmp_path / "session").add_sweep(0, 0.0, *clouds[0])
    assert mapped(tmp_path / "session" / "sweeps", tmp_path / "again", *FAST)[0] == 0


def test_session_that_is_there_is_not_overwritten(tmp_path, bag, clouds, capsys):
    SessionStore(tmp_path).add_sweep(0, 0.0, *clouds[0])
    assert "--resume goes on with it" in refusal(capsys, bag, "--out", tmp_path)
    assert "stored without its odometry" in refusal(capsys, bag, "--out", tmp_path, "--resume")


@pytest.mark.parametrize("name", ["trajectory.txt", "cloud.pcd", "cloud.ply", "graph.g2o", "map_summary.json", "map_origin.json"])
def test_file_of_somebody_s_own_is_not_replaced(tmp_path, bag, capsys, name):
    (tmp_path / name).write_text("mine")
    assert f"would replace its {name}; name another folder" in refusal(capsys, bag, "--out", tmp_path)
    assert (tmp_path / name).read_text() == "mine"


def test_what_a_run_left_that_placed_no_sweep_is_no_file_of_somebody_s_own(tmp_path, clouds):
    far = transform_from_rpy((500_000.0, 5_000_000.0, 0.0))
    few = [(points[:50], origins[:50]) for points, origins in clouds[:2]]
    code, summary = mapped(write_bag(tmp_path / "few.bag", drive(few, [far @ T for T in odometry()[:2]])), tmp_path / "out", *FAST)
    assert (code, summary["vertices"]) == (1, 0) and (tmp_path / "out" / "map_origin.json").exists()
    code, summary = mapped(write_bag(tmp_path / "x.bag", drive(clouds[:2], odometry()[:2])), tmp_path / "out", *FAST)
    assert (code, summary["vertices"]) == (0, 2) and not (tmp_path / "out" / "map_origin.json").exists()


def test_clouds_in_another_frame_need_a_mount(tmp_path, clouds, capsys):
    T_base_laser = transform_from_rpy((0.2, 0.0, 0.8), (0, 0, np.pi / 2))
    moved = [(transform_points(inverse(T_base_laser), p).astype(np.float32), None) for p, _ in clouds[:3]]
    path = write_bag(tmp_path / "laser.bag", drive(moved, odometry()[:3], frame="laser", kind="<f8"))
    assert "--mount" in refusal(capsys, path, "--out", tmp_path / "out", "--quiet")
    code, summary = mapped(path, tmp_path / "mounted", "--mount", 0.2, 0, 0.8, 0, 0, np.pi / 2)
    assert (code, summary["vertices"]) == (0, 3) and error_of(tmp_path / "mounted", TRUTH[:3]) < 0.03
    np.testing.assert_allclose(SessionStore(tmp_path / "mounted").load_sweep(0).origins[0], [0.2, 0.0, 0.8], atol=1e-6)


def test_near_sweeps_are_passed_by(tmp_path, bag):
    code, summary = mapped(bag, tmp_path, "--min-travel", 1.5, *FAST)
    assert (code, summary["vertices"], summary["passed_by"]) == (0, 4, 1)


def test_bag_without_odometry_is_mapped_by_matching_alone(tmp_path, clouds):
    path = write_bag(tmp_path / "clouds.bag", [m for m in drive(clouds[:3], odometry()[:3]) if m[0] != "/odom"])
    code, summary = mapped(path, tmp_path / "out", "--no-odometry")
    assert (code, summary["vertices"]) == (0, 3) and error_of(tmp_path / "out", TRUTH[:3]) < 0.03


@pytest.mark.parametrize("suffix", [".pcd", ".ply"])
def test_folder_without_poses_is_mapped_by_matching_alone(tmp_path, clouds, suffix):
    code, summary = mapped(write_folder(tmp_path / "scans", clouds, suffix), tmp_path / "out")
    assert (code, summary["vertices"]) == (0, 5), summary
    sensor = transform_from_rpy(clouds[0][1].mean(axis=0))
    assert error_of(tmp_path / "out", [T @ sensor for T in TRUTH]) < 0.03


def test_folder_with_poses_takes_them_for_odometry(tmp_path, clouds):
    folder = write_folder(tmp_path / "scans", clouds[:3], poses=odometry()[:3])
    (folder / "notes.md").write_text("not a cloud")
    code, summary = mapped(folder, tmp_path / "out")
    assert (code, summary["vertices"]) == (0, 3)
    assert [s.stamp_s for s in SessionStore(tmp_path / "out").sweeps] == [0.0, 10.0, 20.0]


def test_file_in_a_folder_that_is_damaged_is_named_and_the_others_mapped(tmp_path, clouds):
    folder = write_folder(tmp_path / "scans", clouds[:3], poses=odometry()[:3])
    path = folder / "scan_01.pcd"
    path.write_bytes(path.read_bytes()[:2000])
    code, summary = mapped(folder, tmp_path / "out", *FAST)
    assert (code, summary["vertices"], [entry["sweep"] for entry in summary["not_placed"]]) == (1, 2, ["scan_01.pcd"])


def test_what_is_mapped_is_saved_where_the_source_ends_with_an_error(tmp_path, bag, monkeypatch):
    def broken(self, *_):
        yield from itertools.islice(sweeps(self), 2)
        raise OSError(5, "Input/output error")

    sweeps = BagSweeps.sweeps
    monkeypatch.setattr(BagSweeps, "sweeps", broken)
    code, summary = mapped(bag, tmp_path / "out", *FAST)
    assert (code, summary["vertices"], summary["complete"]) == (1, 2, False) and "Input/output error" in summary["problems"][0]
    assert (tmp_path / "out" / "cloud.pcd").exists()


@pytest.mark.parametrize(
    "words",
    [
        ("--raw",),
        ("--cloud-topic", "/c"),
        ("--robot", "husky"),
        ("--mount-calibration", "auto"),
        ("--no-odometry",),
        ("--odom-topic", "/o"),
        ("--scan-topic", "/s"),
    ],
)
def test_option_that_says_nothing_of_a_folder_is_refused(tmp_path, clouds, capsys, words):
    folder = write_folder(tmp_path / "scans", clouds[:1])
    assert f"{words[0]}: has no effect on clouds of a folder" in refusal(capsys, folder, "--out", tmp_path / "out", *words)
    assert not (tmp_path / "out").exists()


def test_poses_that_do_not_fit_are_refused(tmp_path, clouds, capsys):
    folder = write_folder(tmp_path / "scans", clouds[:2], poses=odometry()[:3])
    assert "3 poses in poses.txt for 2 sweeps" in refusal(capsys, folder, "--out", tmp_path / "out")
    (folder / "poses.txt").write_text("0 1 2 3 0 0 0 1\n1 2 3\n")
    assert "poses.txt, line 2" in refusal(capsys, folder, "--out", tmp_path / "out")


@pytest.mark.parametrize("form", ["TUM", "KITTI"])
def test_poses_far_from_their_origin_make_a_map_with_one_of_its_own(tmp_path, clouds, capsys, form):
    sensor = transform_from_rpy(clouds[0][1].mean(axis=0))
    poses = [transform_from_rpy((448260.4, 5412345.2, 412.0)) @ T @ sensor for T in odometry()[:3]]
    folder = write_folder(tmp_path / "scans", clouds[:3], poses=poses)
    if form == "KITTI":
        np.savetxt(folder / "poses.txt", [T[:3].ravel() for T in poses])
    code, summary = mapped(folder, tmp_path / "out")
    assert (code, summary["vertices"], summary["by_odometry_alone"]) == (0, 3, [])
    assert error_of(tmp_path / "out", [T @ sensor for T in TRUTH[:3]]) < 0.03
    assert summary["origin_m"] == json.loads((tmp_path / "out" / "map_origin.json").read_text())["origin_m"] == [448258, 5412344, 413]
    assert np.abs(np.loadtxt(tmp_path / "out" / "trajectory.txt")[:, 1:4]).max() < 10
    assert "relative to the origin 448258 5412344 413 m" in capsys.readouterr().err
    assert mapped(folder, tmp_path / "out", "--resume")[1]["origin_m"] == [448258, 5412344, 413]


def test_clouds_that_lie_far_away_themselves_are_named(tmp_path, clouds):
    folder = write_folder(tmp_path / "scans", [(points + np.float32(5e5), origins) for points, origins in clouds[:1]])
    code, summary = mapped(folder, tmp_path / "out")
    assert code == 1 and "give clouds in the sensor's frame" in summary["not_placed"][0]["reason"]


def test_beams_without_an_echo_are_counted_and_no_hits(tmp_path, clouds, capsys):
    with_zeros = [(np.vstack([points, np.tile(origins.mean(axis=0), (100, 1))]), origins) for points, origins in clouds[:2]]
    code, summary = mapped(write_folder(tmp_path / "scans", with_zeros, poses=odometry()[:2]), tmp_path / "out", *FAST)
    assert code == 0 and summary["notes"][0] in capsys.readouterr().err and summary["notes"][0].startswith("200 points at 0 0 0")
    assert len(SessionStore(tmp_path / "out").load_sweep(0)) == len(clouds[0][0])


def test_run_that_was_killed_goes_on_and_ends_like_one_that_was_not(tmp_path, bag):
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    assert mapped(bag, whole)[0] == 0
    path = os.pathsep.join(p for p in sys.path if p)
    command = [sys.executable, "-m", "mapping_tools.map_bag", str(bag), "--out", str(cut)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": path})
    for line in process.stderr:
        if "vertex 1" in line:
            break
    process.kill()
    process.communicate()
    found = len(SessionStore(cut).sweeps)
    code, summary = mapped(bag, cut, "--resume")
    assert (code, summary["known"], summary["vertices"]) == (0, found, 5) and found >= 2
    a, b = (PoseGraph.load_g2o(folder / "graph.g2o") for folder in (whole, cut))
    assert a.edges() == b.edges()
    np.testing.assert_allclose(a.poses(), b.poses(), atol=2e-3)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_run_that_is_interrupted_saves_what_it_has(tmp_path, bag, monkeypatch, number):
    monkeypatch.setattr(map_bag, "say", lambda text: os.kill(os.getpid(), number) if "vertex 1" in text else None)
    assert map_bag.main([str(bag), "--out", str(tmp_path), *FAST]) == 1
    summary = json.loads((tmp_path / map_bag.SUMMARY).read_text())
    assert summary["problems"] == ["stopped after 40 % of it"] and summary["vertices"] == 2 and (tmp_path / "cloud.pcd").exists()


def test_second_interrupt_does_not_wait_for_the_sweep(tmp_path, bag, monkeypatch):
    monkeypatch.setattr(map_bag, "say", lambda text: [os.kill(os.getpid(), signal.SIGINT) for _ in range(2 * ("vertex 1" in text))])
    with pytest.raises(KeyboardInterrupt, match="holds a session; --resume goes on with it"):
        map_bag.main([str(bag), "--out", str(tmp_path), *FAST])
    assert not (tmp_path / map_bag.SUMMARY).exists()


@pytest.mark.parametrize("at, said", [("recorded", ""), ("_saved", "holds a session; --resume goes on with it")])
def test_interrupt_before_or_after_mapping_says_what_is_there(tmp_path, bag, monkeypatch, at, said):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(map_bag, at, interrupted)
    with pytest.raises(KeyboardInterrupt) as found:
        map_bag.main([str(bag), "--out", str(tmp_path / "out"), "--quiet", *FAST])
    assert str(found.value) == (f"{tmp_path / 'out'} {said}" if said else "")
    assert (tmp_path / "out").exists() == bool(said)


def test_other_recording_of_the_same_place_goes_on_where_it_is_found(tmp_path, bag):
    out = tmp_path / "out"
    mapped(bag, out, *FAST)
    truth = [pose(-0.5, 0.5, 2.0), pose(-1.5, 0.8, 2.4)]
    poses = [transform_from_rpy((40.0, 0.0, 0.0)) @ T for T in truth]
    later = [
        ("/odom", odometry_message(1000.0, poses[0])),
        *(("/sweep_cloud", cloud_message(1000.0 + 10 * k, *cloud)) for k, cloud in enumerate(recordings.sweeps(truth))),
        ("/odom", odometry_message(1010.0, poses[1])),
    ]
    code, summary = mapped(write_bag(tmp_path / "later.bag", later), out, "--resume", "--moved")
    assert (code, summary["vertices"]) == (0, 7) and error_of(out, [*TRUTH, *truth]) < 0.05


PASSED_OVER = "5 sweeps up to stamp 45.00 s are taken for the session's own, and were passed over"


def test_other_recording_whose_clock_began_anew_is_told_of_and_not_taken_for_mapped(tmp_path, bag, clouds, capsys):
    out, (other,) = tmp_path / "out", [write_bag(tmp_path / "other.bag", drive(clouds[:2], odometry()[:2]))]
    mapped(bag, out, *FAST)
    for _ in range(2):  # the second try is no better
        code, summary = mapped(other, out, "--resume", *FAST)
        assert (code, summary["complete"], summary["known"], summary["vertices"]) == (1, False, 2, 5)
        assert PASSED_OVER.replace("5 sweeps up to stamp 45", "2 sweeps up to stamp 15") in capsys.readouterr().err
        assert "nothing of it was mapped" in summary["problems"][0]
    code, summary = mapped(bag, out, "--resume", *FAST)
    assert (code, summary["complete"]) == (0, True) and PASSED_OVER in capsys.readouterr().err


def test_recording_that_is_mapped_already_goes_on_wherever_it_is_called_from(tmp_path, bag, monkeypatch):
    mapped(bag, tmp_path, *FAST)
    monkeypatch.chdir(bag.parent)
    assert mapped(bag.name, tmp_path, "--resume", *FAST)[0] == 0
    (tmp_path / map_bag.SUMMARY).unlink()  # as of a run that was killed at its end
    assert mapped(bag, tmp_path, "--resume", *FAST)[0] == mapped(bag, tmp_path, "--resume", *FAST)[0] == 0


def test_recording_whose_clock_began_anew_is_no_part_of_an_explored_run(tmp_path, bag):
    mapped(bag, tmp_path, *FAST)
    (tmp_path / map_bag.SUMMARY).unlink()
    (tmp_path / "run.json").write_text("{}")
    assert mapped(bag, tmp_path, "--resume", *FAST)[0] == 1


def test_octree_of_an_explored_run_goes_when_sweeps_are_added_and_stays_when_none_is(tmp_path, bag, clouds, capsys):
    """Else ./export_map would believe it."""
    half = write_bag(tmp_path / "half.bag", drive(clouds[:3], odometry()[:3]))
    out = tmp_path / "out"
    mapped(half, out, *FAST)
    for name in ("map.ot", "terrain.npz", "run.json"):
        (out / name).write_text("of three sweeps")
    mapped(half, out, "--resume", *FAST)
    assert (out / "map.ot").exists()
    _, summary = mapped(bag, out, "--resume", *FAST)
    assert summary["vertices"] == 5 and not (out / "map.ot").exists() and not (out / "terrain.npz").exists() and (out / "run.json").exists()
    assert "map.ot, terrain.npz: are of the earlier sweeps, and were removed" in capsys.readouterr().err


def test_full_disk_is_said_and_ends_with_code_1(tmp_path, bag, monkeypatch, capsys):
    def full(self, *values):
        raise NotOnDiskError(28, "sweep 0 is not on disk: No space left on device", "there")

    monkeypatch.setattr(SessionStore, "add_sweep", full)
    monkeypatch.setattr(SessionStore, "save", full)
    assert map_bag.main([str(bag), "--out", str(tmp_path), *FAST]) == 1
    text = capsys.readouterr().err
    assert text.count("is not on disk") >= 5 and "could not be saved" in text


def test_progress_names_share_sweep_and_verdict(tmp_path, bag, capsys):
    map_bag.main([str(bag), "--out", str(tmp_path), *FAST])
    lines = capsys.readouterr().err.splitlines()
    assert "/sweep_cloud 0 at 5.00 s: vertex 0, the first" in lines[0] and "%" in lines[0]
    assert "vertex 4, accepted" in lines[4] and "5 vertices" in lines[-1]


def as_driver_writes(message, dialect):
    """The same cloud, big-endian, or with the whole cloud's bytes for a row's and in two rows."""
    if dialect == "big-endian":
        message.is_bigendian, message.data = True, message.data.view("<f4").astype(">f4").view(np.uint8)
        return message
    half = message.width // 2
    message.data, message.height, message.width = message.data[: 2 * half * message.point_step], 2, half
    message.row_step = len(message.data)
    return message


@pytest.mark.parametrize("dialect", ["big-endian", "total row_step"])
def test_clouds_are_read_as_drivers_write_them(tmp_path, clouds, dialect):
    messages = [(topic, as_driver_writes(m, dialect) if topic == "/sweep_cloud" else m) for topic, m in drive(clouds[:2], odometry()[:2])]
    code, summary = mapped(write_bag(tmp_path / "run.bag", messages), tmp_path / "out")
    assert (code, summary["vertices"]) == (0, 2) and error_of(tmp_path / "out", TRUTH[:2]) < 0.03


def test_gravity_is_unknown_where_the_odometry_s_covariance_is():
    assert gravity_of(np.eye(4), np.zeros(36)) is None
    covariance = np.zeros(36)
    covariance[[21, 28]] = 0.01, 0.04
    up, sigma = gravity_of(transform_from_rpy((0, 0, 0), (0.1, 0, 0)), covariance)
    assert sigma == pytest.approx(0.2) and up[1] == pytest.approx(np.sin(0.1))


def test_help_tells_of_exit_codes(capsys):
    with pytest.raises(SystemExit) as ended:
        map_bag.main(["--help"])
    assert ended.value.code == 0 and "Exit code: 0 mapped" in " ".join(capsys.readouterr().out.split())


@pytest.fixture(scope="session")
def set_back_bag(tmp_path_factory, clouds):
    """As `bag`, with a clock that is set back by 17 s before the fourth sweep; odometry begins anew there, at its origin."""
    poses = odometry()
    poses = [*poses[:3], *(inverse(poses[3]) @ T for T in poses[3:])]
    messages = drive(clouds, poses)
    for _, message in messages[9:]:
        message.header.stamp.sec -= 17
    return write_bag(tmp_path_factory.mktemp("set_back") / "run.bag", messages)


def test_sweep_after_the_clock_was_set_back_is_looked_for_in_the_map_and_mapped(tmp_path, set_back_bag):
    code, summary = mapped(set_back_bag, tmp_path, *FAST)
    assert (code, summary["vertices"], summary["not_placed"]) == (0, 5, []) and error_of(tmp_path) < 0.05
    assert [s.stamp_s for s in SessionStore(tmp_path).sweeps] == [5.0, 15.0, 25.0, 18.0, 28.0]


def test_cloud_of_a_bad_stamp_is_no_clock_that_was_set_back(tmp_path, clouds, monkeypatch):
    """Else the next sweep would be looked for in the whole map."""
    messages = drive(clouds[:2], odometry()[:2])
    times_s = [m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for _, m in messages]
    path = write_bag(
        tmp_path / "x.bag",
        [*messages[:3], ("/sweep_cloud", cloud_message(0.0, *clouds[2])), *messages[3:]],
        times_s=[*times_s[:3], 6.0, *times_s[3:]],
    )
    asked = []
    monkeypatch.setattr(mapping_run, "localise", lambda *_values, **_named: asked.append(1))
    code, summary = mapped(path, tmp_path / "out", *FAST)
    assert (code, summary["vertices"], asked) == (1, 2, [])


def refused(_area, _reading, T_guess, _covariance=None):
    return RegistrationResult(T_guess, np.eye(6), 0.1, 0.1, np.nan, 0, np.zeros((0, 6)), Verdict.REFUSED, "nothing fits")


def test_late_sweep_is_left_out_and_the_next_goes_on_by_odometry(tmp_path, clouds, monkeypatch):
    """A clock that was set back is half a second off or more."""
    monkeypatch.setattr(map_bag, "create_registration", lambda _: SimpleNamespace(match=refused))
    poses = [("/odom", odometry_message(t, transform_from_rpy((t, 0.0, 0.0)))) for t in np.arange(0.9, 1.7, 0.1)]
    stamps_s = [1.0, 1.1, 1.2, 1.18, 1.3, 1.4, 1.5]
    path = write_bag(
        tmp_path / "x.bag",
        [*poses, *(("/sweep_cloud", cloud_message(t, *clouds[0])) for t in stamps_s)],
        times_s=np.linspace(1.0, 2.0, len(poses) + len(stamps_s)),
    )
    code, summary = mapped(path, tmp_path / "out", *FAST)
    assert (code, summary["vertices"], summary["read_until_s"]) == (1, 6, 1.5)
    ((name, reason),) = [(entry["sweep"], entry["reason"]) for entry in summary["not_placed"]]
    assert name == "/sweep_cloud 3" and "is late: it came after that of 1.200 s" in reason
    assert [entry["stamp_s"] for entry in summary["by_odometry_alone"]] == [1.1, 1.2, 1.3, 1.4, 1.5]


@pytest.mark.parametrize("kept", [2, 3, 4, 5])
def test_run_that_goes_on_has_each_sweep_once_where_the_clock_was_set_back(tmp_path, set_back_bag, kept, monkeypatch):
    last = f"vertex {kept - 1}"
    monkeypatch.setattr(map_bag, "say", lambda text: os.kill(os.getpid(), signal.SIGINT) if last in text else None)
    map_bag.main([str(set_back_bag), "--out", str(tmp_path), *FAST])
    code, summary = mapped(set_back_bag, tmp_path, "--resume", *FAST)
    assert (code, summary["known"], summary["vertices"], summary["not_placed"]) == (0, kept, 5, [])
