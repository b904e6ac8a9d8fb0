"""./optimize_graph: what it solves, what it leaves out, and what it says of bad input, all without a traceback."""

import json

import gtsam
import numpy as np
import pytest
from graph_texts import circle, edge, edges_of, noisy, quat_text, rpy_text, upper

from mapping_tools.optimize_graph import main
from pose_graph_mapping.graph.graph_files import read_graph_file
from rigid_geometry import transform_from_rpy, translation_distance


def run(folder, lines, *options):
    """Exit code, the graph written and the JSON; None where there is none."""
    path, out, report = folder / "graph.g2o", folder / "out.g2o", folder / "out.json"
    path.write_text("".join(line + "\n" for line in lines))
    code = main([str(path), "--out", str(out), "--json", str(report), *options])
    return code, read_graph_file(out) if out.exists() else None, json.loads(report.read_text()) if report.exists() else None


def worst_error(graph, poses, ids=None):
    ids = range(len(poses)) if ids is None else ids
    return max(translation_distance(graph.poses[k], T) for k, T in zip(ids, poses, strict=True))


def gtsam_optimum(path):
    factors, values = gtsam.readG2o(str(path), True)
    factors.add(gtsam.PriorFactorPose3(0, values.atPose3(0), gtsam.noiseModel.Isotropic.Sigma(6, 1e-3)))
    return factors.error(gtsam.LevenbergMarquardtOptimizer(factors, values).optimize())


def with_vertices(poses, seed=2):
    """Vertex lines that are half a metre off, but the first."""
    rng = np.random.default_rng(seed)
    off = [T if k == 0 else noisy(T, rng, 0.3) for k, T in enumerate(poses)]
    return [f"VERTEX_SE3:QUAT {k} {quat_text(T)}" for k, T in enumerate(off)]


@pytest.mark.parametrize("options", [(), ("--plain",)])
def test_error_is_that_of_gtsam_s_optimum(tmp_path, capsys, options):
    poses = circle()
    code, graph, report = run(tmp_path, with_vertices(poses) + edges_of(poses), *options)
    assert code == 0 and report["solved"] and report["rejected_edges"] == []
    assert report["final_error"] == pytest.approx(gtsam_optimum(tmp_path / "graph.g2o"), rel=1e-4)
    assert report["initial_error"] > 100 * report["final_error"] and worst_error(graph, poses) < 0.2
    assert "error" in capsys.readouterr().out


def test_toro_graph_without_vertices_is_solved_like_the_same_in_g2o_s_format(tmp_path):
    poses = circle()
    first = f"VERTEX3 0 {rpy_text(poses[0])}"
    code, toro, report = run(tmp_path, [first, *edges_of(poses, toro=True)])
    assert code == 0 and report["initialised_vertices"] == len(poses) - 1
    _, g2o, _ = run(tmp_path, [f"VERTEX_SE3:QUAT 0 {quat_text(poses[0])}", *edges_of(poses)])
    for k in range(len(poses)):
        np.testing.assert_allclose(toro.poses[k], g2o.poses[k], atol=1e-6)


def test_ids_need_not_follow_each_other_and_stay_what_they_were(tmp_path):
    poses = circle()
    ids = [7 + 10 * k for k in range(len(poses))]
    code, graph, report = run(tmp_path, [f"VERTEX_SE3:QUAT 7 {quat_text(poses[0])}", *edges_of(poses, ids)])
    assert code == 0 and sorted(graph.poses) == ids and report["fixed"] == [7]
    assert worst_error(graph, poses, ids) < 0.2


def test_fixed_vertex_stays(tmp_path):
    poses = circle()
    code, graph, report = run(tmp_path, [*with_vertices(poses), "FIX 5", *edges_of(poses)])
    start = read_graph_file(tmp_path / "graph.g2o").poses[5]
    assert code == 0 and report["fixed"] == [5] and graph.fixed == [5]
    np.testing.assert_allclose(graph.poses[5], start, atol=1e-5)


def test_false_loops_are_named_and_have_no_influence(tmp_path):
    poses = circle()
    lines = [f"VERTEX_SE3:QUAT 0 {quat_text(poses[0])}", *edges_of(poses)]
    _, clean, _ = run(tmp_path, lines)
    false = [edge(2, 20, transform_from_rpy((3, 4, 1), (0, 0, 2.0))), edge(5, 17, transform_from_rpy((-8, 1, 0), (0.3, 0, -1.0)))]
    code, graph, report = run(tmp_path, lines + false)
    assert code == 0
    assert [(e["i"], e["j"], e["line"]) for e in report["rejected_edges"]] == [(2, 20, len(lines) + 1), (5, 17, len(lines) + 2)]
    assert len(graph.edges) == len(lines) - 1
    np.testing.assert_allclose([graph.poses[k] for k in graph.poses], [clean.poses[k] for k in clean.poses], atol=1e-5)
    _, bent, plain = run(tmp_path, lines + false, "--plain")
    assert plain["rejected_edges"] == [] and worst_error(bent, poses) > 1.0


def test_gtsam_reads_what_is_written(tmp_path):
    poses = circle()
    _, _, report = run(tmp_path, with_vertices(poses) + edges_of(poses))
    factors, values = gtsam.readG2o(str(tmp_path / "out.g2o"), True)
    assert values.size() == len(poses)
    assert factors.error(values) == pytest.approx(report["final_error"], rel=1e-4)


CHAIN = [edge(k, k + 1, transform_from_rpy((1, 0, 0))) for k in range(3)]


@pytest.mark.parametrize(
    ("lines", "options", "code", "message"),
    [
        (["VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1", *CHAIN], ["--strict"], 2, "line 2: vertex 1 has no line of its own"),
        ([*CHAIN, edge(10, 11, np.eye(4))], [], 1, "2 parts without an edge between them: vertices 0 to 3 (4 of 6); 10 to 11"),
        ([*CHAIN, "VERTEX_SE3:QUAT 9 0 0 0 0 0 0 1"], [], 1, "2 parts"),
        ([f"EDGE_SE3:QUAT 0 1 0 0 0 0 0 0 1 {upper(np.diag([1.0] * 5 + [0.0]))}"], [], 1, "do not say where all lie: vertices 1 (1 of 2)"),
        ([f"EDGE_SE3:QUAT 0 1 0 0 0 0 0 0 1 {upper(np.diag([1.0] * 5 + [-1.0]))}"], [], 2, "line 1: the information matrix is indefinite"),
        ([CHAIN[0], CHAIN[1].replace("1000.0", "nan")], [], 2, "line 2: nan is no finite number"),
        ([CHAIN[0].replace(" 1.0", " inf")], [], 2, "line 1: inf is no finite number"),
        ([CHAIN[0] + " 5"], [], 2, "line 1: 29 numbers where 28 are wanted"),
        (["EDGE_SE3:QUAT 0"], [], 2, "line 1"),
        (["EDGE_SE3:QUAT 0 x 0 0 0 0 0 0 1 " + upper()], [], 2, "line 1"),
        ([edge(1, 1, np.eye(4))], [], 2, "line 1: an edge connects two vertices, not 1 with itself"),
        (["VERTEX_SE3:QUAT 0 0 0 0 0 0 0 0"], [], 2, "line 1: not a unit quaternion"),
        ([f"VERTEX_SE3:QUAT 0 {x} 0 0 0 0 0 1" for x in (0, 1)], [], 2, "line 2: vertex 0 is there twice, with another pose"),
        (["vertex_se2 0 0 0 0"], [], 2, "line 1: 'vertex_se2' is none of"),
        (["VERTEX_SE2 0 0 0 0", *CHAIN], [], 2, "line 2: 2-D and 3-D poses are in one file"),
        (["VERTEX_PLANE 0 0 0 1 0"], [], 2, "neither a vertex nor an edge"),
        ([*CHAIN, "FIX 8"], [], 2, "FIX 8: there is no such vertex"),
        (["# nothing"], [], 2, "neither a vertex nor an edge"),
        (CHAIN, ["--outlier-chi2", "-1"], 2, "--outlier-chi2 -1: expected a positive number"),
        (CHAIN, ["--plain", "--outlier-chi2", "30"], 2, "--outlier-chi2: has no effect with --plain"),
        (CHAIN, ["--outlier-chi2", "many"], 2, "outlier-chi2"),
        (CHAIN, ["--out", "/nowhere/at/all.g2o"], 2, "no such folder"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path, capsys, lines, options, code, message):
    found, graph, report = run(tmp_path, lines, *options)
    said = capsys.readouterr().err.splitlines()
    assert (found, graph) == (code, None)
    assert message in said[-1] and said[-1].startswith("./optimize_graph: ")
    if code == 1:
        assert report == {"solved": False, "reason": report["reason"]} and message in report["reason"]


def test_absent_and_binary_files_are_bad_input(tmp_path, capsys):
    assert main([str(tmp_path / "absent"), "--out", str(tmp_path / "out.g2o")]) == 2
    (tmp_path / "noise").write_bytes(np.random.default_rng(1).bytes(5000))
    assert main([str(tmp_path / "noise"), "--out", str(tmp_path / "out.g2o")]) == 2
    assert main([str(tmp_path), "--out", str(tmp_path / "out.g2o")]) == 2
    assert all(line.startswith("./optimize_graph: ") for line in capsys.readouterr().err.splitlines())


def test_single_vertex_is_a_graph(tmp_path):
    code, graph, report = run(tmp_path, ["VERTEX_SE3:QUAT 4 1 2 3 0 0 0 1"])
    assert code == 0 and report["final_error"] == 0.0
    np.testing.assert_allclose(graph.poses[4][:3, 3], [1, 2, 3], atol=1e-9)


def test_help_names_formats_and_exit_codes(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert end.value.code == 0
    assert all(word in text for word in ("EDGE_SE3:QUAT", "EDGE3", "--strict", "--plain", "Exit code: 0 solved"))


@pytest.mark.parametrize(
    ("out", "report", "said"),
    [
        ("graph.g2o", "x.json", "--out"),
        ("x.g2o", "graph.g2o", "--json"),
        ("x", "x", "the same file as --out"),
        (".", "x.json", "is a folder, expected a file"),
        ("x.g2o", ".", "is a folder, expected a file"),
    ],
)
def test_output_is_looked_at_before_the_graph_is_read_and_nothing_is_written(tmp_path, capsys, monkeypatch, out, report, said):
    graph = tmp_path / "graph.g2o"
    graph.write_text("\n".join(CHAIN) + "\n")
    monkeypatch.setattr("mapping_tools.optimize_graph.read_graph_file", lambda _: pytest.fail("the graph was read"))
    assert main([str(graph), "--out", str(tmp_path / out), "--json", str(tmp_path / report)]) == 2
    text = capsys.readouterr().err
    assert said in text and text.startswith("./optimize_graph: --") and text.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["graph.g2o"] and graph.read_text().splitlines() == list(CHAIN)


def test_disk_that_takes_the_graph_but_not_the_report_gets_neither(tmp_path, monkeypatch, files_of_at_most):
    monkeypatch.setattr("mapping_tools.optimize_graph._json_bytes", lambda _: bytes(10_000))
    with files_of_at_most(8192):
        assert run(tmp_path, CHAIN) == (2, None, None)
