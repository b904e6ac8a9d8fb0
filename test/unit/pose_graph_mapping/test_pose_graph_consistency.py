"""Edges that contradict the rest: which are left out, when, and that they come back."""

import gtsam
import numpy as np
import pytest

from pose_graph_mapping.graph.graph_measurements import GraphNotSolvable
from pose_graph_mapping.graph.graph_problem import GraphProblem, minimised, poses_of, tree_poses
from pose_graph_mapping.graph.pose_graph import Edge, EdgeKind, PoseGraph
from rigid_geometry import inverse, transform_from_rpy, translation_distance

ODOMETRY = np.diag([0.02**2] * 3 + [0.1**2] * 3)
MATCH = np.diag([0.002**2] * 3 + [0.006**2] * 3)


def drive(rounds=2):
    """Rounds of a square of 12 m a side, a vertex every 2 m."""
    poses = [np.eye(4)]
    for k in range(1, 24 * rounds):
        poses.append(poses[-1] @ transform_from_rpy((2.0, 0, 0), (0, 0, np.pi / 2 if k % 6 == 0 else 0.0)))
    return poses


def measured(poses, i, j, covariance, rng):
    noise = gtsam.Pose3.Expmap(rng.multivariate_normal(np.zeros(6), covariance)).matrix()
    return inverse(poses[i]) @ poses[j] @ noise


def driven(poses, seed=1, matches=True, wrong_match=None, loops_from=24):
    """A graph that grew as the mapper lets it grow, with a loop to the round before every third vertex."""
    rng, graph = np.random.default_rng(seed), PoseGraph()
    graph.add_vertex(poses[0])
    graph.optimise()
    for k in range(1, len(poses)):
        odometry, match = measured(poses, k - 1, k, ODOMETRY, rng), measured(poses, k - 1, k, MATCH, rng)
        if k == wrong_match:
            match = match @ transform_from_rpy((0.8, -0.5, 0.0), (0, 0, 0.3))
        graph.add_vertex(graph.pose(k - 1) @ (match if matches else odometry))
        graph.add_edge(k - 1, k, odometry, ODOMETRY, EdgeKind.ODOMETRY)
        if matches:
            graph.add_edge(k - 1, k, match, MATCH, EdgeKind.MATCH)
        graph.optimise()
        if k >= loops_from and k % 3 == 0:
            graph.add_edge(k - 24, k, measured(poses, k - 24, k, MATCH, rng), MATCH, EdgeKind.LOOP)
            graph.optimise()
    return graph


def worst_error(graph, poses):
    return max(translation_distance(a, b) for a, b in zip(graph.poses(), poses, strict=True))


def test_right_edges_are_all_kept():
    poses = drive()
    graph = driven(poses)
    assert graph.solve() == () and graph.rejected() == []
    assert worst_error(graph, poses) < 0.5


def test_running_solution_is_the_batch_solution():
    graph = driven(drive())
    running = graph.poses()
    graph.solve()
    np.testing.assert_allclose(graph.poses(), running, atol=1e-4)


def test_false_loops_are_left_out_at_once_and_named():
    poses = drive()
    graph, clean = driven(poses), driven(poses)
    false = [(3, 40, transform_from_rpy((1.0, 2.0, 0.0), (0, 0, 1.0))), (10, 30, transform_from_rpy((-2.0, 0.5, 0.1)))]
    for i, j, T in false:
        graph.add_edge(i, j, T, MATCH, EdgeKind.LOOP)
        graph.optimise()
    assert [(e.i, e.j) for e in graph.rejected()] == [(3, 40), (10, 30)]
    assert (3, 40, EdgeKind.LOOP) not in graph.edges() and 40 not in graph.neighbours(3)
    clean.solve()
    np.testing.assert_allclose(graph.poses(), clean.poses(), atol=1e-4)


def test_false_loop_that_was_believed_goes_when_others_disagree():
    poses = drive()
    graph = driven(poses, matches=False, loops_from=1000)
    graph.add_edge(2, 26, inverse(poses[2]) @ poses[26] @ transform_from_rpy((1.2, 0.8, 0.0), (0, 0, 0.1)), MATCH, EdgeKind.LOOP)
    graph.optimise()
    assert graph.rejected() == []
    left_out = []
    for k in (1, 3, 4, 6):
        graph.add_edge(k, k + 24, inverse(poses[k]) @ poses[k + 24], MATCH, EdgeKind.LOOP)
        graph.optimise()
        left_out.append([(e.i, e.j) for e in graph.rejected()])
    assert left_out[-1] == [(2, 26)]
    assert translation_distance(inverse(graph.pose(2)) @ graph.pose(26), inverse(poses[2]) @ poses[26]) < 0.25


def test_right_loop_that_was_left_out_comes_back_when_others_agree_with_it():
    poses = drive()
    graph = driven(poses, wrong_match=20, loops_from=1000)
    rng, kept = np.random.default_rng(5), []
    for k in (0, 3, 6, 9):
        graph.add_edge(k, k + 24, measured(poses, k, k + 24, MATCH, rng), MATCH, EdgeKind.LOOP)
        graph.optimise()
        kept.append(sum(kind is EdgeKind.LOOP for *_, kind in graph.edges()))
    assert kept[-1] == 4
    assert [(e.i, e.j, e.kind) for e in graph.rejected()] == [(19, 20, EdgeKind.MATCH)]
    assert worst_error(graph, poses) < 1.0


def hanging_by_a_match(odometry_off_m, match_off_m):
    """Ten vertices 2 m apart, the first two tied to the others by one step alone; how much too long odometry and match measure it."""
    graph = PoseGraph()
    graph.add_vertex(np.eye(4))
    for k in range(1, 10):
        odometry, match = (transform_from_rpy((2.0 + (off if k == 2 else 0.0), 0.0, 0.0)) for off in (odometry_off_m, match_off_m))
        graph.add_vertex(graph.pose(k - 1) @ match)
        graph.add_edge(k - 1, k, odometry, ODOMETRY, EdgeKind.ODOMETRY)
        graph.add_edge(k - 1, k, match, MATCH, EdgeKind.MATCH)
        graph.optimise()
    for i, j in ((2, 6), (3, 7), (4, 8), (2, 8), (5, 9)):
        add_loop(graph, i, j, 0.0)
    return graph


def add_loop(graph, i, j, off_m):
    graph.add_edge(i, j, transform_from_rpy((2.0 * (j - i) + off_m, 0.0, 0.0)), MATCH, EdgeKind.LOOP)
    graph.optimise()
    return [(edge.i, edge.j) for edge in graph.rejected()]


def test_one_new_loop_does_not_overturn_a_match_where_odometry_hardly_tells():
    graph = hanging_by_a_match(odometry_off_m=0.25, match_off_m=0.0)
    assert add_loop(graph, 1, 6, 0.45) == [(1, 6)]
    graph.solve()
    assert [(edge.i, edge.j) for edge in graph.rejected()] == [(1, 6)]


def test_one_new_loop_overturns_a_match_that_odometry_contradicts():
    assert add_loop(hanging_by_a_match(odometry_off_m=0.0, match_off_m=0.7), 1, 6, 0.0) == [(1, 2)]


def test_two_new_loops_overturn_a_match_that_odometry_agrees_with():
    graph = hanging_by_a_match(odometry_off_m=0.2, match_off_m=0.4)
    add_loop(graph, 1, 6, 0.0)
    assert add_loop(graph, 0, 5, 0.0) == [(1, 2)]


def test_same_calls_give_the_same_bits():
    def run():
        graph = driven(drive(), seed=3)
        graph.add_edge(3, 40, transform_from_rpy((1.0, 2.0, 0.0), (0, 0, 1.0)), MATCH, EdgeKind.LOOP)
        graph.optimise()
        running = graph.poses().tobytes()
        graph.solve()
        return running, graph.poses().tobytes()

    assert run() == run()


def test_relative_covariance_is_that_of_gtsam_s_marginals():
    graph = driven(drive(1))
    problem = GraphProblem(graph.poses(), graph.measurements())
    marginals = gtsam.Marginals(problem.factors(), minimised(problem.factors(), problem.values()))
    joint = marginals.jointMarginalCovariance([4, 20])
    J = np.hstack([-gtsam.Pose3(inverse(graph.pose(20)) @ graph.pose(4)).AdjointMap(), np.eye(6)])
    full = np.block([[joint.at(4, 4), joint.at(4, 20)], [joint.at(20, 4), joint.at(20, 20)]])
    np.testing.assert_allclose(graph.relative_covariance(4, 20), J @ full @ J.T, rtol=1e-2, atol=5e-6)


def test_relative_covariances_of_many_are_those_of_each_while_the_graph_grows_and_is_levelled_anew():
    poses = drive(2)
    graph = PoseGraph(gravity_bias_sigma_rad=0.01)
    for number, T in enumerate(poses[:30]):
        graph.add_vertex(T)
        graph.add_gravity(number, transform_from_rpy((0, 0, 0), (0.003, 0.0, 0.0))[:3, :3] @ T[2, :3], 0.002)
        if number:
            graph.add_edge(number - 1, number, inverse(poses[number - 1]) @ T, ODOMETRY, EdgeKind.ODOMETRY)
        if number % 10 == 9:
            graph.add_edge(number - 9, number, inverse(poses[number - 9]) @ T, MATCH, EdgeKind.LOOP)
        graph.optimise()
        found = graph.relative_covariances(range(number), number)
        assert found.shape == (number, 6, 6)
        for k, covariance in enumerate(found):
            np.testing.assert_allclose(covariance, graph.relative_covariance(k, number), rtol=1e-5, atol=1e-10)
    assert np.linalg.norm(graph._bias) > 0.001


def test_graph_to_which_nothing_was_added_is_not_solved_again(monkeypatch):
    """The mapper asks three times a sweep; after 150 sweeps in one place each time took 0.1 s."""
    graph = driven(drive(1)[:12])
    graph.optimise()
    before, poses = graph.relative_covariances(range(11), 11), graph.poses()
    monkeypatch.setattr("pose_graph_mapping.graph.incremental_graph.splu", None)  # whoever solves anew needs it
    graph.optimise()
    assert (graph.relative_covariances(range(11), 11) == before).all() and (graph.poses() == poses).all()
    graph.add_edge(0, 11, inverse(poses[0]) @ poses[11], ODOMETRY, EdgeKind.ODOMETRY)
    graph.optimise()
    with pytest.raises(TypeError):
        graph.relative_covariances(range(11), 11)


def test_relative_covariance_of_a_single_edge_is_its_own():
    graph = PoseGraph()
    graph.add_vertex(transform_from_rpy((1, 2, 3), (0.1, 0.2, 0.3)))
    graph.add_vertex(graph.pose(0) @ transform_from_rpy((2, 0, 0), (0, 0, 1.0)))
    graph.add_edge(0, 1, transform_from_rpy((2, 0, 0), (0, 0, 1.0)), ODOMETRY, EdgeKind.ODOMETRY)
    with pytest.raises(ValueError, match="not optimised"):
        graph.relative_covariance(0, 1)
    graph.optimise()
    np.testing.assert_allclose(graph.relative_covariance(0, 1), ODOMETRY, rtol=1e-6, atol=1e-12)


def test_parts_without_an_edge_between_them_cannot_be_solved():
    graph = driven(drive(1)[:4])
    graph.add_vertex(np.eye(4))
    with pytest.raises(GraphNotSolvable, match="vertex 4"):
        graph.solve()
    with pytest.raises(GraphNotSolvable):
        graph.optimise()


def test_match_that_alone_holds_a_vertex_is_never_left_out():
    graph = driven(drive(1)[:6])
    lonely = graph.add_vertex(np.eye(4))
    graph.add_edge(2, lonely, transform_from_rpy((5, 5, 0)), MATCH, EdgeKind.MATCH)
    graph.add_edge(4, lonely, transform_from_rpy((-9, 5, 0)), MATCH, EdgeKind.LOOP)
    graph.optimise()
    assert [(e.i, e.j) for e in graph.rejected()] == [(4, lonely)]


def test_tree_takes_sure_edges_and_loops_only_where_nothing_else_leads():
    a, b, loop = transform_from_rpy((1, 0, 0)), transform_from_rpy((1.1, 0, 0)), transform_from_rpy((0, 7, 0))
    edges = [
        Edge(0, 1, b, ODOMETRY, EdgeKind.ODOMETRY),
        Edge(0, 1, a, MATCH, EdgeKind.MATCH),
        Edge(2, 1, inverse(b), ODOMETRY, EdgeKind.ODOMETRY),
        Edge(0, 2, loop, MATCH, EdgeKind.LOOP),
        Edge(2, 3, loop, MATCH, EdgeKind.LOOP),
    ]
    poses = tree_poses(4, edges, {0: np.eye(4)})
    np.testing.assert_allclose(poses[:, :3, 3], [[0, 0, 0], [1, 0, 0], [2.1, 0, 0], [2.1, 7, 0]], atol=1e-12)
    np.testing.assert_allclose(poses_of(GraphProblem(poses, edges).values(), 4), poses, atol=1e-12)
