"""Poses and the files that they belong to: both forms, natural order, stamps as names, and counts that differ."""

from pathlib import Path

import numpy as np
import pytest

from mapping_tools.pose_files import in_order, paired, read_poses, stamps_of
from rigid_geometry import transform_from_rpy


def poses_of(tmp_path, text):
    (tmp_path / "poses.txt").write_text(text)
    return read_poses(tmp_path / "poses.txt")


def files(*names):
    return in_order(map(Path, names))


def tum(*stamps):
    return "".join(f"{stamp} {k} 0 0 0 0 0 1\n" for k, stamp in enumerate(stamps))


def test_tum_rows_skip_comments_and_must_go_forward(tmp_path):
    (pose,) = poses_of(tmp_path, "# stamp x y z qx qy qz qw\n\n1 4 5 6 0 0 0 1\r\n")
    assert pose.stamp_s == 1.0 and pose.T[:3, 3].tolist() == [4, 5, 6]
    with pytest.raises(ValueError, match=r"poses.txt, line 2: stamp 1.0 is not later"):
        poses_of(tmp_path, tum(1, 1))


def test_kitti_rows_of_few_digits_are_rotations(tmp_path):
    T = transform_from_rpy((1.0, 2.0, 3.0), (0.1, -0.2, 0.7))
    (pose,) = poses_of(tmp_path, " ".join(f"{v:.4e}" for v in T[:3].ravel()))
    assert pose.stamp_s is None
    np.testing.assert_allclose(pose.T, T, atol=2e-4)
    np.testing.assert_allclose(pose.T[:3, :3] @ pose.T[:3, :3].T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize(
    "text, said",
    [
        ("1 2 3\n", "line 1: 3 numbers where 8 .TUM.*12 .KITTI"),
        ("1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0\n", "line 2: 8 numbers where 12, as in the lines before"),
        ("2 0 0 0 0 1 0 0 0 0 1 0\n", "line 1: .* no rotation"),
        ("1 0 0 0 0 1 0 0 0 0 -1 0\n", "line 1: .* no rotation"),
        ("0 0,5 0 0 0 0 0 1\n", "line 1: '0,5' is no number; decimals"),
        ("0 nan 0 0 0 0 0 1\n", "line 1: a number is not finite"),
        ("0 0 0 0 0 0 0 0\n", "line 1"),
    ],
)
def test_line_that_is_no_pose_is_named(tmp_path, text, said):
    with pytest.raises(ValueError, match=said):
        poses_of(tmp_path, text)


def test_names_are_counted_as_people_count(tmp_path):
    names = ["scan11.pcd", "scan9.pcd", "scan10.pcd", "a2b10.pcd", "a2b9.pcd", "8.pcd"]
    assert [path.name for path in files(*names)] == ["8.pcd", "a2b9.pcd", "a2b10.pcd", "scan9.pcd", "scan10.pcd", "scan11.pcd"]


@pytest.mark.parametrize(
    "names",
    [
        ["9.35.ply", "12.0.ply", "12.05.ply", "12.1.ply", "12.15.ply", "12.2.ply", "12.25.ply", "100.0.ply"],
        ["1403636579.9.ply", "1403636580050.ply", "1403636580100000000.ply", "1403636581.ply"],
    ],
)
def test_names_that_are_stamps_are_in_the_order_of_time(names):
    assert [path.name for path in files(*reversed(names))] == names


def test_names_that_are_stamps_find_their_poses_among_more(tmp_path):
    poses = poses_of(tmp_path, tum(1403636579.70, 1403636579.80, 1403636579.9))
    for names in (["1403636579.7.pcd", "1403636579.899.pcd"], ["1403636579700000000.pcd", "1403636579900000000.pcd"]):
        found = paired(files(*names), poses, "poses.txt")
        assert [pose.T[0, 3] for pose in found] == [0, 2]
    with pytest.raises(ValueError, match=r"of 1403636579\.75\.pcd: the nearest of 3 is 0\.050 s away"):
        paired(files("1403636579.70.pcd", "1403636579.75.pcd"), poses, "poses.txt")


def test_names_that_only_count_are_paired_in_order_or_not_at_all(tmp_path):
    poses = poses_of(tmp_path, tum(0, 0.5, 1.0))
    assert stamps_of(["0000000000", "0000000001"]) is None  # as KITTI counts: no stamp since 1970 begins with 0
    assert stamps_of(["0", "1"]) is None and stamps_of(["000012", "1403636579.70"]) is None
    assert [pose.T[0, 3] for pose in paired(files("2.pcd", "9.pcd", "10.pcd"), poses, "poses.txt")] == [0, 1, 2]
    with pytest.raises(ValueError, match="3 poses in poses.txt for 2 sweeps"):
        paired(files("0.pcd", "1.pcd"), poses, "poses.txt")


def test_poses_of_a_camera_are_not_taken_for_those_of_a_robot(tmp_path):
    drive = [(0.1 * k, -0.01 * k, 0.8 * k) for k in range(10)]  # right, down, forward
    with pytest.raises(ValueError, match="z is wanted up"):
        poses_of(tmp_path, "".join(f"1 0 0 {x} 0 1 0 {y} 0 0 1 {z}\n" for x, y, z in drive))
    assert len(poses_of(tmp_path, "".join(f"1 0 0 {z} 0 1 0 {x} 0 0 1 {-y}\n" for x, y, z in drive))) == 10
