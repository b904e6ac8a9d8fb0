"""The graph: distances, optimisation with a known answer, robustness, and g2o files against gtsam's own."""

import gtsam
import numpy as np
import pytest

from pose_graph_mapping.graph.pose_graph import EdgeKind, PoseGraph
from rigid_geometry import inverse, rotation_angle, tilt_angle, transform_from_rpy, translation_distance

COVARIANCE = np.diag([1e-4, 2e-4, 3e-4, 1e-3, 2e-3, 3e-3])


def square_poses(side=3.0, per_side=3):
    """Poses driving once around a square and back to its start."""
    poses, step = [np.eye(4)], transform_from_rpy((side / per_side, 0, 0))
    for _ in range(4):
        for k in range(per_side):
            turn = transform_from_rpy((0, 0, 0), (0, 0, np.pi / 2 if k == per_side - 1 else 0.0))
            poses.append(poses[-1] @ step @ turn)
    return poses


def chain(poses, scale=1.0, kind=EdgeKind.ODOMETRY):
    """A graph of consecutive edges whose translations are `scale` times the truth, with vertices where those lead."""
    graph, at = PoseGraph(), poses[0]
    graph.add_vertex(at)
    for k in range(1, len(poses)):
        measured = inverse(poses[k - 1]) @ poses[k]
        measured[:3, 3] *= scale
        at = at @ measured
        graph.add_edge(k - 1, graph.add_vertex(at), measured, COVARIANCE, kind)
    return graph


def worst_error(graph, poses):
    return max(translation_distance(a, b) for a, b in zip(graph.poses(), poses, strict=True))


def test_exact_edges_leave_exact_poses():
    poses = square_poses()
    graph = chain(poses)
    graph.optimise()
    assert worst_error(graph, poses) < 1e-9


def test_single_vertex_stays_where_it_is():
    graph = PoseGraph()
    graph.add_vertex(transform_from_rpy((1, 2, 3), (0.1, 0.2, 0.3)))
    graph.optimise()
    np.testing.assert_allclose(graph.pose(0), transform_from_rpy((1, 2, 3), (0.1, 0.2, 0.3)))


def drifted_square():
    """A square whose odometry turns 2 degrees too far at every edge, and says that it may."""
    poses = square_poses()
    graph, at = PoseGraph(), poses[0]
    graph.add_vertex(at)
    for k in range(1, len(poses)):
        measured = inverse(poses[k - 1]) @ poses[k] @ transform_from_rpy((0, 0, 0), (0, 0, np.radians(2)))
        at = at @ measured
        graph.add_edge(k - 1, graph.add_vertex(at), measured, np.diag([3e-3] * 3 + [1e-2] * 3), EdgeKind.ODOMETRY)
    return poses, graph


def test_loop_edge_closes_a_drifted_square():
    poses, graph = drifted_square()
    before = translation_distance(graph.pose(len(poses) - 1), poses[-1])
    graph.add_edge(0, len(poses) - 1, inverse(poses[0]) @ poses[-1], COVARIANCE, EdgeKind.LOOP)
    graph.optimise()
    assert before > 0.5
    assert translation_distance(graph.pose(len(poses) - 1), poses[-1]) < 0.1


def test_one_false_loop_is_ignored_by_a_trusted_chain():
    poses = square_poses()
    graph = chain(poses)
    graph.add_edge(3, 9, transform_from_rpy((4.0, 4.0, 0.0)), COVARIANCE, EdgeKind.LOOP)
    graph.optimise()
    assert worst_error(graph, poses) < 0.05


def test_one_false_loop_hardly_moves_a_graph_with_true_ones():
    poses = square_poses()
    graph = chain(poses)
    for i, j in ((0, 12), (1, 11), (2, 10)):
        graph.add_edge(i, j, inverse(poses[i]) @ poses[j], COVARIANCE, EdgeKind.LOOP)
    graph.add_edge(3, 9, transform_from_rpy((4.0, 4.0, 0.0)), COVARIANCE, EdgeKind.LOOP)
    graph.optimise()
    assert worst_error(graph, poses) < 0.05


def test_gravity_levels_a_tilted_start():
    graph, up_true = PoseGraph(), np.array([0.0, 0.0, 1.0])
    for k in range(4):
        T = transform_from_rpy((0, 0, 0), (0.05, -0.03, 0.0)) @ transform_from_rpy((2.0 * k, 0, 0), (0, 0, 0.4 * k))
        graph.add_vertex(T)
        graph.add_gravity(k, up_true, np.radians(0.5))
        if k:
            graph.add_edge(k - 1, k, inverse(graph.pose(k - 1)) @ T, COVARIANCE, EdgeKind.MATCH)
    graph.optimise()
    assert max(tilt_angle(T) for T in graph.poses()) < 1e-3
    np.testing.assert_allclose(graph.pose(0)[:3, 3], 0.0, atol=1e-6)


def test_tilt_of_a_start_without_gravity_stays():
    graph = PoseGraph()
    graph.add_vertex(transform_from_rpy((0, 0, 0), (0.1, 0, 0)))
    graph.add_vertex(transform_from_rpy((1, 0, 0), (0.1, 0, 0)))
    graph.add_edge(0, 1, transform_from_rpy((1, 0, 0)), COVARIANCE, EdgeKind.ODOMETRY)
    graph.optimise()
    assert rotation_angle(graph.pose(0)) == pytest.approx(0.1, abs=1e-6)


def test_optimisation_is_bit_identical_when_repeated():
    def run():
        poses, graph = drifted_square()
        graph.add_edge(0, len(poses) - 1, inverse(poses[0]) @ poses[-1], COVARIANCE, EdgeKind.LOOP)
        graph.optimise()
        return graph.poses().tobytes()

    assert run() == run()


def test_distance_runs_along_edges():
    poses = square_poses(side=3.0, per_side=3)
    graph = chain(poses)
    np.testing.assert_allclose(graph.distances_from(0), np.arange(13.0))
    graph.add_edge(0, 12, np.eye(4), COVARIANCE, EdgeKind.LOOP)
    np.testing.assert_allclose(graph.distances_from(0)[[11, 12]], [1.0, 0.0], atol=1e-9)


def test_vertex_without_edge_is_infinitely_far():
    graph = chain(square_poses())
    lonely = graph.add_vertex(np.eye(4))
    assert np.isinf(graph.distances_from(0)[lonely])


def test_edges_and_neighbours_name_what_was_added():
    graph = chain(square_poses()[:3])
    graph.add_edge(0, 2, np.eye(4), COVARIANCE, EdgeKind.LOOP)
    assert graph.edges() == [(0, 1, EdgeKind.ODOMETRY), (1, 2, EdgeKind.ODOMETRY), (0, 2, EdgeKind.LOOP)]
    assert graph.neighbours(0) == [1, 2]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((0, 50, np.eye(4), COVARIANCE), "vertex 50 is unknown"),
        ((1, 1, np.eye(4), COVARIANCE), "itself"),
        ((0, 1, np.zeros((4, 4)), COVARIANCE), "rigid"),
        ((0, 1, np.eye(4), np.zeros((6, 6))), "positive definite"),
        ((0, 1, np.eye(4), np.full((6, 6), np.nan)), "finite"),
    ],
)
def test_bad_edges_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        chain(square_poses()).add_edge(*values, EdgeKind.MATCH)


@pytest.mark.parametrize("up", [(0, 0, 0), (np.nan, 0, 1), (0, 1)])
def test_up_without_direction_is_refused(up):
    with pytest.raises(ValueError, match="up direction"):
        chain(square_poses()).add_gravity(0, up, 0.01)


def tilted_graph():
    rng = np.random.default_rng(7)
    graph = PoseGraph()
    for k in range(5):
        graph.add_vertex(transform_from_rpy(rng.normal(0, 3, 3), tuple(rng.uniform(-1, 1, 3))))
        if k:
            root = rng.normal(0, 0.1, (6, 6))
            graph.add_edge(k - 1, k, inverse(graph.pose(k - 1)) @ graph.pose(k), root @ root.T + 0.01 * np.eye(6), EdgeKind.MATCH)
    graph.add_edge(0, 4, inverse(graph.pose(0)) @ graph.pose(4), COVARIANCE, EdgeKind.LOOP)
    return graph


def test_g2o_round_trip_keeps_everything(tmp_path):
    graph = tilted_graph()
    (tmp_path / "graph.g2o").write_text(graph.g2o_text())
    again = PoseGraph.load_g2o(tmp_path / "graph.g2o")
    np.testing.assert_allclose(again.poses(), graph.poses(), atol=1e-12)
    assert again.edges() == graph.edges()
    for ours, theirs in zip(graph.measurements(), again.measurements(), strict=True):
        np.testing.assert_allclose(theirs.T_i_j, ours.T_i_j, atol=1e-12)
        np.testing.assert_allclose(theirs.covariance, ours.covariance, rtol=1e-6, atol=1e-12)


def gtsam_graph(graph):
    factors, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for k, T in enumerate(graph.poses()):
        values.insert(k, gtsam.Pose3(T))
    for e in graph.measurements():
        factors.add(gtsam.BetweenFactorPose3(e.i, e.j, gtsam.Pose3(e.T_i_j), gtsam.noiseModel.Gaussian.Covariance(e.covariance)))
    return factors, values


def test_gtsam_reads_what_we_write(tmp_path):
    graph = tilted_graph()
    (tmp_path / "ours.g2o").write_text(graph.g2o_text())
    factors, values = gtsam.readG2o(str(tmp_path / "ours.g2o"), True)
    wanted_factors, wanted_values = gtsam_graph(graph)
    assert values.equals(wanted_values, 1e-9)
    assert factors.equals(wanted_factors, 1e-3)
    for k in range(factors.size()):
        np.testing.assert_allclose(factors.at(k).noiseModel().covariance(), graph.measurements()[k].covariance, rtol=1e-6, atol=1e-12)


def test_we_read_what_gtsam_writes(tmp_path):
    graph = tilted_graph()
    gtsam.writeG2o(*gtsam_graph(graph), str(tmp_path / "theirs.g2o"))
    again = PoseGraph.load_g2o(tmp_path / "theirs.g2o")
    np.testing.assert_allclose(again.poses(), graph.poses(), atol=1e-4)
    assert [kind for *_, kind in again.edges()] == [EdgeKind.ODOMETRY] * 4 + [EdgeKind.LOOP]
    for ours, theirs in zip(graph.measurements(), again.measurements(), strict=True):
        np.testing.assert_allclose(theirs.covariance, ours.covariance, rtol=1e-3, atol=1e-6)


def test_unreadable_g2o_names_its_line(tmp_path):
    (tmp_path / "bad.g2o").write_text("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 0 zero 0 0 0 0 1\n")
    with pytest.raises(ValueError, match="line 2"):
        PoseGraph.load_g2o(tmp_path / "bad.g2o")
