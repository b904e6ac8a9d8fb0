"""Algorithm 2 on literal graphs. Vertices are numbers on the page, distances are metres."""

import numpy as np
import pytest

from pose_graph_mapping.config import MappingConfig
from pose_graph_mapping.graph.loop_closure import (
    add_neighbours,
    beyond_correction,
    candidate_radii,
    detect_loop_closures,
    find_closest_vertex,
    find_groups,
    find_loose_vertex,
    find_vertices_in_range,
)
from pose_graph_mapping.graph.pose_graph import EdgeKind, PoseGraph
from pose_graph_mapping.registration.cloud import PointCloud
from pose_graph_mapping.registration.matching import RegistrationResult, Verdict
from rigid_geometry import inverse, transform_from_rpy

#   A hairpin, 2 m between columns, 4 m between rows:
#
#   9  8  7  6
#            5   <- halfway
#   0  1  2  3  4
HAIRPIN = [(0, 0), (2, 0), (4, 0), (6, 0), (8, 0), (7, 2), (6, 4), (4, 4), (2, 4), (0, 4)]
COVARIANCE = np.diag([1e-4] * 3 + [1e-3] * 3)
CONFIG = MappingConfig(loop_min_dist_m=8.0, loop_max_dist_m=5.0)


def graph_of(positions, covariance=COVARIANCE):
    graph = PoseGraph()
    for k, (x, y) in enumerate(positions):
        graph.add_vertex(transform_from_rpy((x, y, 0.0)))
        if k:
            graph.add_edge(k - 1, k, inverse(graph.pose(k - 1)) @ graph.pose(k), covariance, EdgeKind.ODOMETRY)
    return graph


def matcher(verdict=Verdict.ACCEPTED, ratio=0.9, correction=None):
    calls = []

    def match(reference, reading, T_guess, covariance):
        calls.append((reference, reading, T_guess, covariance))
        T = T_guess if correction is None else T_guess @ correction
        return RegistrationResult(T, COVARIANCE, ratio, 0.9, 0.0, 5, np.zeros((0, 6)), verdict, "fake")

    return match, calls


def clouds_of(graph):
    return [PointCloud([[float(k), 0.0, 0.0]]) for k in range(len(graph))].__getitem__


def test_range_is_near_in_a_straight_line_and_far_along_edges():
    graph = graph_of(HAIRPIN)
    assert find_vertices_in_range(graph, 9, 8.0, 5.0) == [0, 1]
    assert find_vertices_in_range(graph, 9, 8.0, 4.0) == [0]
    assert find_vertices_in_range(graph, 9, 30.0, 5.0) == []


def test_directly_connected_vertices_are_never_candidates():
    graph = graph_of(HAIRPIN)
    graph.add_edge(0, 9, np.eye(4), COVARIANCE, EdgeKind.LOOP)
    assert find_vertices_in_range(graph, 9, 8.0, 5.0) == []


def test_neighbours_join_when_they_are_far_along_edges_too():
    graph = graph_of(HAIRPIN)
    assert add_neighbours(graph, [0], 9, 8.0, 5.0) == [0, 1]
    assert add_neighbours(graph, [1], 9, 8.0, 5.0) == [0, 1, 2]
    assert add_neighbours(graph, [6], 9, 8.0, 5.0) == [5, 6]  # 7 is only 4 m along


def test_groups_are_places_apart():
    graph = graph_of([(0, 0), (1, 0), (2, 0), (20, 0), (21, 0), (40, 0)])
    assert find_groups(graph, [0, 1, 2, 3, 4, 5], 2, 4.0) == [[0, 1, 2], [3, 4], [5]]
    assert find_groups(graph, [5, 0], 2, 4.0) == [[0], [5]]
    assert find_groups(graph, [], 2, 4.0) == []


def test_closest_is_by_straight_distance_and_the_older_of_equals():
    graph = graph_of(HAIRPIN)
    assert find_closest_vertex(graph, [0, 1, 2], 9) == 0
    assert find_closest_vertex(graph, [7, 1], 8) == 7
    assert find_closest_vertex(graph_of([(-1, 0), (1, 0), (0, 0)]), [0, 1], 2) == 0


def test_hairpin_is_closed_once_with_the_closest_vertex():
    graph, (match, calls) = graph_of(HAIRPIN), matcher()
    found = detect_loop_closures(graph, clouds_of(graph), match, CONFIG)
    assert [(loop.closest_vertex, loop.closed) for loop in found] == [(0, True)]
    assert graph.edges()[-1] == (0, 9, EdgeKind.LOOP)
    reference, reading, T_guess, covariance = calls[0]
    assert (reference.points[0, 0], reading.points[0, 0]) == (0.0, 9.0)
    np.testing.assert_allclose(T_guess, transform_from_rpy((0.0, 4.0, 0.0)), atol=1e-6)
    assert covariance[3, 3] > 9 * COVARIANCE[3, 3]  # of nine edges, and turned by the way between


def test_loop_pulls_the_last_vertex_to_where_the_match_puts_it():
    graph, (match, _) = graph_of(HAIRPIN), matcher(correction=transform_from_rpy((0.0, -0.05, 0.0)))
    detect_loop_closures(graph, clouds_of(graph), match, CONFIG)
    assert graph.pose(9)[1, 3] < 3.98


@pytest.mark.parametrize(
    ("verdict", "ratio", "correction"),
    [
        (Verdict.REFUSED, 0.9, None),
        (Verdict.DEGENERATE, 0.9, None),
        (Verdict.ACCEPTED, 0.4, None),
        (Verdict.ACCEPTED, 0.9, transform_from_rpy((3.0, 0, 0))),
        (Verdict.ACCEPTED, 0.9, transform_from_rpy((0, 0, 0), (0, 0, 2.0))),
    ],
)
def test_doubtful_match_gives_no_edge(verdict, ratio, correction):
    graph, (match, calls) = graph_of(HAIRPIN), matcher(verdict, ratio, correction)
    found = detect_loop_closures(graph, clouds_of(graph), match, CONFIG)
    assert len(calls) == 1 and not found[0].closed
    assert EdgeKind.LOOP not in [kind for *_, kind in graph.edges()]


#   Out and back again, 10 m apart at the ends: too far for a loop, unless drift is known to be large.
OUT_AND_BACK = [(0, 0), (5, 0), (10, 0), (15, 0), (15, 5), (15, 9), (10, 9), (5, 9), (0, 7)]


def test_place_beyond_the_usual_distance_is_a_candidate_when_drift_may_have_led_there():
    sure, unsure = graph_of(OUT_AND_BACK), graph_of(OUT_AND_BACK, np.diag([1e-4] * 3 + [0.3**2] * 3))
    for graph in (sure, unsure):
        graph.optimise()
    assert candidate_radii(sure, 8, CONFIG)[0] < 7.0 <= candidate_radii(unsure, 8, CONFIG)[0]
    assert detect_loop_closures(sure, clouds_of(sure), matcher()[0], CONFIG) == []
    assert detect_loop_closures(unsure, clouds_of(unsure), matcher()[0], CONFIG)[0].closest_vertex == 0


def test_candidates_are_never_farther_than_the_largest_distance():
    graph = graph_of(OUT_AND_BACK, np.diag([1e-2] * 3 + [4.0] * 3))
    graph.optimise()
    radii = candidate_radii(graph, 8, MappingConfig(loop_grown_dist_m=7.5))
    assert radii[0] == 7.5 and radii.max() == 7.5


def test_match_may_correct_what_drift_allows():
    sure, unsure = np.diag([1e-6] * 3 + [1e-4] * 3), np.diag([0.4**2] * 3 + [1.0] * 3)
    moved, turned = transform_from_rpy((2.5, 0, 0)), transform_from_rpy((0, 0, 0), (0, 0, 1.1))
    for T in (moved, turned):
        assert "moves the prediction" in beyond_correction(np.eye(4), T, sure, CONFIG)
        assert beyond_correction(np.eye(4), T, unsure, CONFIG) is None
    assert "allowed are 3.00 m" in beyond_correction(np.eye(4), transform_from_rpy((3.5, 0, 0)), unsure, CONFIG)


def test_loop_that_contradicts_the_graph_is_not_closed():
    graph, (match, _) = graph_of(HAIRPIN), matcher(correction=transform_from_rpy((1.2, 0.5, 0.0), (0, 0, 0.5)))
    found = detect_loop_closures(graph, clouds_of(graph), match, CONFIG)
    assert not found[0].closed and EdgeKind.LOOP not in [kind for *_, kind in graph.edges()]
    assert [(e.i, e.j) for e in graph.rejected()] == [(0, 9)]


def test_vertex_too_few_sweeps_ago_is_not_even_matched():
    graph, (match, calls) = graph_of(HAIRPIN), matcher()
    assert detect_loop_closures(graph, clouds_of(graph), match, MappingConfig(loop_min_dist_match=9)) == []
    assert calls == []


def test_straight_drive_has_no_loops():
    graph, (match, calls) = graph_of([(3.0 * k, 0) for k in range(12)]), matcher()
    assert detect_loop_closures(graph, clouds_of(graph), match, CONFIG) == []
    assert calls == []


#   Between two walls the second sweep did not hold the first along them; the third and fourth see their end.
def graph_with_a_loose_first_leg(legs=3):
    graph = PoseGraph()
    for k in range(legs + 1):
        graph.add_vertex(transform_from_rpy((2.0 * k, 0.0, 0.0)))
        if k:
            loose = np.diag([1e-4] * 3 + [0.04, 1e-4, 1e-4]) if k == 1 else COVARIANCE / 10
            graph.add_edge(k - 1, k, transform_from_rpy((2.0, 0.0, 0.0)), loose, EdgeKind.MATCH)
    graph.optimise()
    return graph


def test_sweep_beyond_a_leg_that_no_match_held_is_matched_until_it_is_held():
    graph, (match, calls) = graph_with_a_loose_first_leg(), matcher(ratio=0.4, correction=transform_from_rpy((-0.09, 0.0, 0.0)))
    found = detect_loop_closures(graph, clouds_of(graph), match, CONFIG)
    assert [(loop.closest_vertex, loop.closed) for loop in found] == [(0, True)]
    assert graph.pose(3)[0, 3] - graph.pose(0)[0, 3] == pytest.approx(5.91, abs=0.01)
    assert find_loose_vertex(graph, 3, CONFIG) is None and len(calls) == 1


def test_sweep_that_holds_nothing_either_leaves_the_leg_loose():
    graph, (match, _) = graph_with_a_loose_first_leg(), matcher(Verdict.DEGENERATE)
    assert not detect_loop_closures(graph, clouds_of(graph), match, CONFIG)[0].closed
    assert find_loose_vertex(graph, 3, CONFIG) == 0


def test_leg_that_was_just_matched_or_lies_out_of_the_area_is_not_asked():
    assert find_loose_vertex(graph_with_a_loose_first_leg(1), 1, CONFIG) is None
    assert find_loose_vertex(graph_with_a_loose_first_leg(8), 8, CONFIG) is None


def test_only_legs_that_no_edge_holds_alone_ask_the_whole_graph(monkeypatch):
    """To and fro in one place every leg of hours is near; asking for each took seconds a sweep."""
    graph, asked = graph_with_a_loose_first_leg(), []
    covariance = graph.relative_covariance
    monkeypatch.setattr(graph, "relative_covariance", lambda i, j: asked.append((i, j)) or covariance(i, j))
    assert find_loose_vertex(graph, 3, CONFIG) == 0
    assert asked == [(0, 1)]


def graph_with_legs(*kinds):
    graph = PoseGraph()
    for k in range(len(kinds) + 1):
        graph.add_vertex(transform_from_rpy((2.0 * k, 0.0, 0.0)))
        if k:
            graph.add_edge(k - 1, k, transform_from_rpy((2.0, 0.0, 0.0)), COVARIANCE / 10, kinds[k - 1])
    graph.optimise()
    return graph


@pytest.mark.parametrize(
    ("kinds", "asked"),
    [
        ((EdgeKind.ODOMETRY, EdgeKind.MATCH, EdgeKind.MATCH), 0),
        ((EdgeKind.MATCH, EdgeKind.ODOMETRY, EdgeKind.MATCH), 1),
        ((EdgeKind.MATCH, EdgeKind.ODOMETRY, EdgeKind.ODOMETRY), None),  # nothing says that the last sweep sees what holds it
        ((EdgeKind.ODOMETRY, EdgeKind.ODOMETRY, EdgeKind.MATCH), 1),
        ((EdgeKind.MATCH, EdgeKind.MATCH, EdgeKind.MATCH), None),
    ],
)
def test_leg_that_no_match_spans_is_asked_again_whatever_odometry_says_of_itself(kinds, asked):
    """Found by chaos: a filter that had begun anew was sure of itself, and 28 cm off."""
    assert find_loose_vertex(graph_with_legs(*kinds), len(kinds), CONFIG) == asked


def test_leg_over_which_a_loop_leads_is_not_asked_again():
    graph = graph_with_legs(EdgeKind.ODOMETRY, EdgeKind.MATCH, EdgeKind.MATCH)
    graph.add_edge(0, 3, transform_from_rpy((6.0, 0.0, 0.0)), COVARIANCE, EdgeKind.LOOP)
    graph.optimise()
    assert find_loose_vertex(graph, 3, CONFIG) is None
