"""Edges of a pose graph against the true motion."""

import numpy as np
import pytest

from exploration_evaluation.graph_edges import read_edges, wrong_edges
from pose_graph_mapping.graph.pose_graph import EdgeKind, PoseGraph
from rigid_geometry import inverse, transform_from_rpy

TRUTH = [transform_from_rpy((2.0 * k, 0.1 * k, 0.1), (0.02, 0.0, 0.3 * k)) for k in range(5)]
TIGHT = np.diag([0.002**2] * 3 + [0.01**2] * 3)
OPEN_AHEAD = np.diag([0.002**2] * 3 + [2.0**2, 0.01**2, 0.01**2])


def written(path, *extra, graph_truth=TRUTH):
    """A graph of true odometry and match edges, and (i, j, error, covariance, kind) beside."""
    graph = PoseGraph()
    for k, T in enumerate(graph_truth):
        graph.add_vertex(T)
        if k:
            for kind in (EdgeKind.ODOMETRY, EdgeKind.MATCH):
                graph.add_edge(k - 1, k, inverse(graph_truth[k - 1]) @ T, TIGHT, kind)
    for i, j, error, covariance, kind in extra:
        graph.add_edge(i, j, inverse(graph_truth[i]) @ graph_truth[j] @ error, covariance, kind)
    (path / "graph.g2o").write_text(graph.g2o_text())
    return read_edges(path / "graph.g2o")


def shift(x, yaw=0.0):
    return transform_from_rpy((x, 0.0, 0.0), (0.0, 0.0, yaw))


def test_edges_come_back_with_their_kinds(tmp_path):
    edges = written(tmp_path, (0, 4, np.eye(4), TIGHT, EdgeKind.LOOP))
    assert edges.kinds == ("odometry", "match") * 4 + ("loop",)
    np.testing.assert_allclose(edges.T_i_j[-1], inverse(TRUTH[0]) @ TRUTH[4], atol=1e-12)
    np.testing.assert_allclose(np.linalg.inv(edges.information[-1]), np.diag([0.01**2] * 3 + [0.002**2] * 3), rtol=1e-6)


def test_true_graph_has_no_wrong_edge(tmp_path):
    assert wrong_edges(written(tmp_path), TRUTH) == []


@pytest.mark.parametrize("error", [shift(0.3), shift(0.0, 0.08)])
@pytest.mark.parametrize("kind", [EdgeKind.LOOP, EdgeKind.MATCH])
def test_edge_beyond_its_covariance_is_wrong(tmp_path, error, kind):
    assert wrong_edges(written(tmp_path, (0, 3, error, TIGHT, kind)), TRUTH) == [(0, 3, kind.value)]


def test_odometry_is_never_a_wrong_match(tmp_path):
    assert wrong_edges(written(tmp_path, (0, 3, shift(0.5), TIGHT, EdgeKind.ODOMETRY)), TRUTH) == []


def test_open_direction_is_no_error(tmp_path):
    assert wrong_edges(written(tmp_path, (0, 3, shift(0.5), OPEN_AHEAD, EdgeKind.MATCH)), TRUTH) == []


def test_edge_without_truth_is_not_judged(tmp_path):
    truth = np.array(TRUTH)
    truth[3] = np.nan
    assert wrong_edges(written(tmp_path, (0, 3, shift(0.5), TIGHT, EdgeKind.LOOP)), truth) == []
    assert wrong_edges(written(tmp_path, (0, 3, shift(0.5), TIGHT, EdgeKind.LOOP)), TRUTH[:3]) == []  # it was mapped after the end


def test_absent_and_malformed_graphs_are_errors(tmp_path):
    with pytest.raises(ValueError, match="not there"):
        read_edges(tmp_path / "graph.g2o")
    (tmp_path / "graph.g2o").write_text("EDGE_SE3:QUAT 0 1 0 0 0\n")
    with pytest.raises(ValueError, match="28 numbers"):
        read_edges(tmp_path / "graph.g2o")
