"""Graph files: g2o's and TORO's lines, kinds of edges, and the real sphere, whose loops close only in the right order of angles."""

from pathlib import Path

import numpy as np
import pytest

from pose_graph_mapping.graph.graph_files import g2o_text, read_graph_file
from pose_graph_mapping.graph.graph_measurements import Edge, EdgeKind, GraphNotSolvable
from pose_graph_mapping.graph.graph_problem import GraphProblem, minimised, tree_poses
from pose_graph_mapping.graph.pose_graph import PoseGraph
from rigid_geometry import transform_from_rpy

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"
UPPER = "1 0 0 0 0 0 2 0 0 0 0 3 0 0 0 4 0 0 5 0 6"


def read(folder, text):
    (folder / "graph").write_text(text)
    return read_graph_file(folder / "graph")


def real(name):
    if not (DATA / name).exists():
        pytest.skip("the shared measurement data are not on this machine")
    return read_graph_file(DATA / name)


def test_information_is_translation_first_and_covariance_rotation_first(tmp_path):
    for line in (f"EDGE_SE3:QUAT 3 5 0 0 0 0 0 0 1 {UPPER}", f"EDGE3 3 5 0 0 0 0 0 0 {UPPER}"):
        np.testing.assert_allclose(np.diag(read(tmp_path, line).edges[0].covariance), [1 / 4, 1 / 5, 1 / 6, 1, 1 / 2, 1 / 3])


def test_toro_s_angles_are_about_fixed_axes(tmp_path):
    file = read(tmp_path, f"VERTEX3 2 1 2 3 0.1 0.2 0.3\nEDGE3 2 4 4 5 6 -0.4 0.5 2.6 {UPPER}\n")
    np.testing.assert_allclose(file.poses[2], transform_from_rpy((1, 2, 3), (0.1, 0.2, 0.3)))
    np.testing.assert_allclose(file.edges[0].T_i_j, transform_from_rpy((4, 5, 6), (-0.4, 0.5, 2.6)))


def test_kinds_are_told_by_comments_or_by_neighbouring_ids(tmp_path):
    lines = [f"EDGE_SE3:QUAT {i} {j} 0 0 0 0 0 0 1 {UPPER}\n" for i, j in ((4, 10), (10, 20), (4, 20))]
    assert [e.kind for e in read(tmp_path, "".join(lines)).edges] == [EdgeKind.ODOMETRY, EdgeKind.ODOMETRY, EdgeKind.LOOP]
    told = "# KIND 4 10 match\n# KIND 10 20 loop\n# KIND 4 20 odometry\n"
    assert [e.kind.value for e in read(tmp_path, "".join(lines) + told).edges] == ["match", "loop", "odometry"]


def test_kinds_are_those_of_their_vertices_whatever_the_order_of_the_lines(tmp_path):
    lines = [f"EDGE_SE3:QUAT {i} {j} 0 0 0 0 0 0 1 {UPPER}\n" for i, j in ((0, 1), (0, 1), (1, 2))]
    told = "# KIND 1 2 loop\n# KIND 0 1 odometry\n# KIND 0 1 match\n"
    assert [e.kind.value for e in read(tmp_path, told + "".join(lines)).edges] == ["odometry", "match", "loop"]


@pytest.mark.parametrize(
    ("told", "reason"),
    [
        ("# KIND 0 1 match\n", "line 1: the edge from 4 to 10 has no comment # KIND, though others have"),
        ("# KIND 4 10 match\n# KIND 4 10 match\n", "line 3: no edge goes from 4 to 10"),
        ("# KIND 4 10 match\n# KIND 10 4 loop\n", "line 3: no edge goes from 10 to 4"),
    ],
)
def test_kinds_of_other_edges_are_refused(tmp_path, told, reason):
    with pytest.raises(ValueError, match=reason):
        read(tmp_path, f"EDGE_SE3:QUAT 4 10 0 0 0 0 0 0 1 {UPPER}\n{told}")


def test_text_comes_back(tmp_path):
    rng = np.random.default_rng(4)
    root = rng.normal(0, 0.1, (6, 6))
    poses = {k: transform_from_rpy(rng.normal(0, 3, 3), tuple(rng.uniform(-1, 1, 3))) for k in (2, 7, 30)}
    edges = [Edge(2, 30, poses[7], root @ root.T + 0.01 * np.eye(6), EdgeKind.MATCH)]
    file = read(tmp_path, g2o_text(poses, edges, [7]))
    assert sorted(file.poses) == [2, 7, 30] and file.fixed == [7] and file.edge_lines == [5]
    for k, T in poses.items():
        np.testing.assert_allclose(file.poses[k], T, atol=1e-12)
    np.testing.assert_allclose(file.edges[0].covariance, edges[0].covariance, rtol=1e-6, atol=1e-12)
    assert file.edges[0].kind is EdgeKind.MATCH


def test_singular_information_keeps_what_it_knows_and_indefinite_is_refused(tmp_path):
    edge = "EDGE_SE3:QUAT 0 1 0 0 0 0 0 0 1 "
    found = read(tmp_path, edge + UPPER[:-1] + "0").edges[0]
    np.testing.assert_allclose(np.diag(found.information), [4, 5, 0, 1, 2, 3], atol=1e-12)
    assert found.covariance[2, 2] > 1e6 * found.covariance[0, 0]
    with pytest.raises(ValueError, match="line 1: the information matrix is indefinite"):
        read(tmp_path, edge + UPPER[:-1] + "-6")
    with pytest.raises(GraphNotSolvable, match="line 3: the information matrix is singular"):
        (tmp_path / "graph").write_text("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 0 0 0 0 0 0 1\n" + edge + UPPER[:-1] + "0")
        PoseGraph.load_g2o(tmp_path / "graph")


def test_loops_of_the_true_sphere_close():
    file = real("sphere2500_groundtruth.txt")
    poses = tree_poses(2500, file.edges, {0: np.eye(4)})
    problem = GraphProblem(poses, file.edges)
    assert len(file.edges) == 4949 and problem.edge_errors(problem.values()).max() < 1e-4


def test_sphere_ends_at_the_known_optimum():
    file = real("sphere2500.txt")
    problem = GraphProblem(tree_poses(2500, file.edges, {0: np.eye(4)}), file.edges)
    assert problem.factors().error(minimised(problem.factors(), problem.values())) == pytest.approx(364.4949, rel=1e-5)
