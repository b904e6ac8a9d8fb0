"""./optimize_graph: the likeliest poses of a pose graph file, and which of its edges contradict the rest."""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from explore_command.arguments import ArgumentProblem, OneLineParser
from mapping_tools.graph_report import remarks, report, summary
from mapping_tools.graph_solving import NumberedGraph, SolvedGraph, numbered, solve_plain, solve_robust
from mapping_tools.sesync_error import isotropic
from mapping_tools.tool_errors import code_of, say
from pose_graph_mapping.graph.graph_files import GraphFile, g2o_text, read_graph_file
from pose_graph_mapping.graph.graph_measurements import GraphNotSolvable
from whole_files import check_files, write_all, write_whole

_OUTLIER_CHI2 = 30.0
SOLVED, NOT_SOLVABLE = 0, 1


def parser() -> argparse.ArgumentParser:
    p = OneLineParser(
        prog="./optimize_graph",
        description="Finds the likeliest poses of the pose graph in GRAPH. Read are g2o's files (VERTEX_SE3:QUAT, EDGE_SE3:QUAT, "
        "EDGE_SE3_PRIOR, EDGE_SE3_OFFSET, FIX) and TORO's (VERTEX3, EDGE3: x y z roll pitch yaw), and 2-D ones (VERTEX_SE2, EDGE_SE2, "
        "EDGE_PRIOR_SE2; VERTEX2, EDGE2), solved in the plane. Other lines, of landmarks and planes for example, are counted and left out. "
        "Ids need not follow each other. A vertex without a line starts where edges put it. An information matrix that is singular is used "
        "in the directions it knows. Edges between ids that follow each other are odometry and believed, all others are left out where "
        "they contradict the rest; lines '# KIND I J odometry|match|loop', one for every edge, say otherwise.",
        epilog="Without FIX and priors the vertex of the lowest id keeps its pose. OUT holds the vertices, priors and kept edges, in g2o's "
        "format. Example: ./optimize_graph graph.g2o --out solved.g2o. "
        "Exit code: 0 solved, 1 not solvable (parts without an edge between them, poses that nothing holds), 2 a file or argument "
        "is wrong, 130 interrupted.",
    )
    p.add_argument("graph", type=Path, metavar="GRAPH", help="the graph to be solved; it is only read")
    p.add_argument("--out", type=Path, required=True, metavar="OUT.g2o", help="the graph with its new poses")
    p.add_argument("--plain", action="store_true", help="believe every edge: least squares without leaving any out")
    p.add_argument("--isotropic", action="store_true", help="one weight for turns and one for shifts an edge, as SE-Sync has them")
    limit = "squared Mahalanobis distance beyond which an edge contradicts the rest, by the noise that the graph shows"
    p.add_argument("--outlier-chi2", type=float, metavar="X", help=f"{limit}; default {_OUTLIER_CHI2:g}")
    p.add_argument("--strict", action="store_true", help="an edge to a vertex without a line of its own is an error")
    p.add_argument("--json", type=Path, metavar="FILE", help="errors, counts and the edges that were left out, for other programs")
    return p


def optimize(options: argparse.Namespace) -> int:
    """Read, solve and write; ArgumentProblem, ValueError and OSError for what is wrong with files and arguments."""
    _check(options)
    start = time.monotonic()
    try:
        file = read_graph_file(options.graph)
    except OSError as error:
        raise ValueError(f"{options.graph}: {error.strerror or error}") from error
    try:
        graph = numbered(file, options.strict)
    except GraphNotSolvable:
        raise
    except ValueError as error:
        raise ValueError(f"{options.graph}: {error}") from error
    for remark in remarks(file, graph):
        say(f"{options.graph}: {remark}")
    if options.isotropic:
        graph = replace(graph, problem=isotropic(graph.problem))
    if options.plain:
        solved = solve_plain(graph.problem)
    else:
        solved = solve_robust(graph.problem, _OUTLIER_CHI2 if options.outlier_chi2 is None else options.outlier_chi2, say, graph.freedom)
    content = report(file, graph, solved, options.plain)
    content["time_s"] = round(time.monotonic() - start, 3)
    files = {options.out: output(file, graph, solved).encode("ascii")}
    write_all(files | ({options.json: _json_bytes(content)} if options.json else {}))
    print(summary(content))
    return SOLVED


def output(file: GraphFile, graph: NumberedGraph, solved: SolvedGraph) -> str:
    """The text of OUT: the file's ids, new poses, its priors and kept edges as they were."""
    kept = [edge for edge, keep in zip(file.edges, solved.kept, strict=True) if keep]
    poses = dict(zip(graph.ids, solved.poses, strict=True))
    return g2o_text(poses, kept, [graph.ids[k] for k in graph.problem.fixed], file.priors, file.is_2d)


def _check(options: argparse.Namespace) -> None:
    if options.plain and options.outlier_chi2 is not None:
        raise ArgumentProblem("--outlier-chi2: has no effect with --plain, which leaves no edge out")
    if options.outlier_chi2 is not None and not (math.isfinite(options.outlier_chi2) and options.outlier_chi2 > 0):
        raise ArgumentProblem(f"--outlier-chi2 {options.outlier_chi2:g}: expected a positive number")
    json_file = [] if options.json is None else [("--json", options.json)]
    check_files([("--out", options.out), *json_file], [options.graph])


def _json_bytes(content: Mapping[str, object]) -> bytes:
    return (json.dumps(content, indent=1) + "\n").encode("ascii")


def main(argv: Sequence[str] | None = None) -> int:
    """The program; its exit code."""
    return code_of("optimize_graph", lambda: _optimized_or_told(parser().parse_args(argv)))


def _optimized_or_told(options: argparse.Namespace) -> int:
    try:
        return optimize(options)
    except GraphNotSolvable as error:
        say(f"./optimize_graph: not solvable: {error}")
        if options.json:
            write_whole(options.json, _json_bytes({"solved": False, "reason": str(error)}))
        return NOT_SOLVABLE


if __name__ == "__main__":
    sys.exit(main())
