"""Sweeps and events on disk: whole, cut off and damaged ones."""

import numpy as np
import pytest

from exploration_evaluation.run_files import mapped_sweeps, read_events, read_sweep_poses, read_sweeps, read_trajectory

HEADER = "stamp_s,wall_s,state,reason,sweeps\n"
ROWS = '1.000,0.5,starting,waiting,0\n2.500,1.25,settling,"2.5 m, far",0\n'


def write_sweep(folder, number, stamp_s, points):
    (folder / "sweeps").mkdir(exist_ok=True)
    np.savez(folder / "sweeps" / f"{number:06d}.npz", points=points, origins=points, stamp_s=np.float64(stamp_s))


def test_events_are_read_with_commas_in_their_reasons(tmp_path):
    (tmp_path / "events.csv").write_text(HEADER + ROWS)
    stamps, wall, states = read_events(tmp_path / "events.csv")
    np.testing.assert_allclose(stamps, [1.0, 2.5])
    np.testing.assert_allclose(wall, [0.5, 1.25])
    assert states == ("starting", "settling")


def test_half_a_last_event_of_a_killed_run_is_left_out(tmp_path):
    (tmp_path / "events.csv").write_text(HEADER + ROWS + "3.0,2.0,dri")
    assert read_events(tmp_path / "events.csv")[2] == ("starting", "settling")


@pytest.mark.parametrize("text", ["", "time,what\n1,2\n", HEADER + "1.0,x,starting,,0\n", HEADER + "1.0\n", HEADER + "nan,0,starting,,0\n"])
def test_damaged_events_are_refused(tmp_path, text):
    (tmp_path / "events.csv").write_text(text)
    with pytest.raises(ValueError, match=r"events\.csv"):
        read_events(tmp_path / "events.csv")


def test_absent_events_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"events\.csv is not there"):
        read_events(tmp_path / "events.csv")


def test_sweeps_are_read_in_the_order_of_their_vertices(tmp_path):
    for k in range(3):
        write_sweep(tmp_path, k, 5.0 * k, np.full((k + 1, 3), k, np.float32))
    assert [len(points) for points in read_sweeps(tmp_path, [0.0, 5.0, 10.0])] == [1, 2, 3]


def test_sweep_that_is_absent_damaged_or_of_another_vertex_is_refused(tmp_path):
    write_sweep(tmp_path, 0, 5.0, np.zeros((4, 3), np.float32))
    for stamps, text in (([6.0], "is of 5.000 s"), ([5.0, 6.0], "000001.npz is not there")):
        with pytest.raises(ValueError, match=text):
            list(read_sweeps(tmp_path, stamps))
    write_sweep(tmp_path, 0, 5.0, np.zeros((4, 2), np.float32))
    with pytest.raises(ValueError, match=r"not \(N, 3\)"):
        list(read_sweeps(tmp_path, [5.0]))
    (tmp_path / "sweeps" / "000000.npz").write_bytes(b"PK\x03\x04 cut off")
    with pytest.raises(ValueError, match="000000.npz cannot be read"):
        list(read_sweeps(tmp_path, [5.0]))


def write_trajectory(folder, stamps):
    (folder / "trajectory.txt").write_text("".join(f"{stamp} {k} 0 0 0 0 0 1\n" for k, stamp in enumerate(stamps)))
    return folder / "trajectory.txt"


def test_sweeps_of_a_robot_whose_clock_was_set_back_are_read_in_their_order(tmp_path):
    path = write_trajectory(tmp_path, [10.0, 20.0, 18.0])
    stamps, poses = read_sweep_poses(path)
    assert (stamps.tolist(), poses[:, 0, 3].tolist()) == ([10.0, 20.0, 18.0], [0.0, 1.0, 2.0])
    with pytest.raises(ValueError, match="do not increase"):
        read_trajectory(path)


@pytest.mark.parametrize(("stamps", "count"), [([1.0, 2.0, 10.0, 20.0], 2), ([1.0, 2.0, 10.0, 20.0, 3.0, 4.0], 4), ([1.0, 2.0], 0)])
def test_sweeps_of_a_run_are_those_since_its_first_event_also_when_the_clock_was_set_back_in_it(tmp_path, stamps, count):
    write_trajectory(tmp_path, stamps)
    (tmp_path / "events.csv").write_text(HEADER + "9.0,0.5,starting,waiting,0\n")
    assert mapped_sweeps(tmp_path) == count
