"""./optimize_graph: the likeliest poses of a pose graph file, and which of its edges contradict the rest."""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypedDict

from explore_command.arguments import ArgumentProblem, OneLineParser
from mapping_tools.graph_solving import NumberedGraph, SolvedGraph, numbered, solve_plain, solve_robust
from pose_graph_mapping.graph.graph_files import GraphFile, g2o_text, read_graph_file
from pose_graph_mapping.graph.graph_measurements import GraphNotSolvable
from pose_graph_mapping.session.session_files import write_atomically

SOLVED, NOT_SOLVABLE, BAD_INPUT = 0, 1, 2
ERROR_UNIT = "half of the sum of squared Mahalanobis distances of the edges"
_MOST_PRINTED = 20


def parser() -> argparse.ArgumentParser:
    p = OneLineParser(
        prog="./optimize_graph",
        description="Finds the likeliest poses of the pose graph in GRAPH: a g2o file (VERTEX_SE3:QUAT, EDGE_SE3:QUAT, FIX) or TORO's 3-D "
        "(VERTEX3, EDGE3: x y z roll pitch yaw). Ids need not follow each other. A vertex without a line starts where edges put it. "
        "Edges between ids that follow each other are odometry and believed, all others are left out where they contradict the rest; "
        "lines '# KIND I J odometry|match|loop', one for every edge, say otherwise.",
        epilog="Without FIX the vertex of the lowest id keeps its pose. OUT holds the vertices and the kept edges, in g2o's format. "
        "Exit code: 0 solved, 1 not solvable (parts without an edge between them, a singular information matrix), 2 a file or argument "
        "is wrong.",
    )
    p.add_argument("graph", type=Path, metavar="GRAPH", help="the graph to be solved; it is only read")
    p.add_argument("--out", type=Path, required=True, metavar="OUT.g2o", help="the graph with its new poses")
    p.add_argument("--plain", action="store_true", help="believe every edge: least squares without leaving any out")
    limit = "squared Mahalanobis distance (6 degrees of freedom) beyond which an edge contradicts the rest; default %(default)g"
    p.add_argument("--outlier-chi2", type=float, default=30.0, metavar="X", help=limit)
    p.add_argument("--strict", action="store_true", help="an edge to a vertex without a line of its own is an error")
    p.add_argument("--json", type=Path, metavar="FILE", help="errors, counts and the edges that were left out, for other programs")
    return p


def optimize(options: argparse.Namespace) -> int:
    """Read, solve and write; ArgumentProblem, ValueError and OSError for what is wrong with files and arguments."""
    _check(options)
    start = time.monotonic()
    file = read_graph_file(options.graph)
    try:
        graph = numbered(file, options.strict)
    except GraphNotSolvable:
        raise
    except ValueError as error:
        raise ValueError(f"{options.graph}: {error}") from error
    _say(f"{options.graph}: {len(graph.ids)} vertices, {graph.initialised} of them without a line, {len(file.edges)} edges")
    if options.plain:
        solved = solve_plain(graph.problem)
    else:
        solved = solve_robust(graph.problem, options.outlier_chi2, _say)
    content = report(file, graph, solved, options.plain, time.monotonic() - start)
    write_atomically(options.out, output(graph, solved).encode("ascii"))
    if options.json:
        _write_json(options.json, content)
    print(summary(content))
    return SOLVED


def output(graph: NumberedGraph, solved: SolvedGraph) -> str:
    """The text of OUT: the file's ids, new poses, kept edges."""
    ids, edges = graph.ids, graph.problem.edges
    named = [edge.__class__(ids[edge.i], ids[edge.j], edge.T_i_j, edge.covariance, edge.kind) for edge in edges]
    kept = [edge for edge, keep in zip(named, solved.kept, strict=True) if keep]
    return g2o_text(dict(zip(ids, solved.poses, strict=True)), kept, [ids[k] for k in graph.problem.fixed])


class RejectedEdge(TypedDict):
    """An edge that was left out, with its line in the file and its error."""

    i: int
    j: int
    line: int
    kind: str
    error: float


class Report(TypedDict):
    """What --json writes of a solved graph."""

    solved: bool
    vertices: int
    edges: int
    initialised_vertices: int
    fixed: list[int]
    robust: bool
    initial_error: float
    final_error: float
    error_unit: str
    rejected_edges: list[RejectedEdge]
    time_s: float


def report(file: GraphFile, graph: NumberedGraph, solved: SolvedGraph, plain: bool, seconds: float) -> Report:
    """What --json writes of a solved graph."""
    rejected: list[RejectedEdge] = [
        {"i": edge.i, "j": edge.j, "line": line, "kind": edge.kind.value, "error": float(error)}
        for edge, line, error, keep in zip(file.edges, file.edge_lines, solved.edge_errors, solved.kept, strict=True)
        if not keep
    ]
    return {
        "solved": True,
        "vertices": len(graph.ids),
        "edges": len(file.edges),
        "initialised_vertices": graph.initialised,
        "fixed": [graph.ids[k] for k in graph.problem.fixed],
        "robust": not plain,
        "initial_error": solved.initial_error,
        "final_error": solved.final_error,
        "error_unit": ERROR_UNIT,
        "rejected_edges": rejected,
        "time_s": round(seconds, 3),
    }


def summary(content: Report) -> str:
    """What is printed of a solved graph."""
    rejected = content["rejected_edges"]
    lines = [f"error {content['initial_error']:.6g} -> {content['final_error']:.6g} over {content['edges'] - len(rejected)} edges"]
    lines += [f"left out: {e['i']} - {e['j']} (line {e['line']}, error {e['error']:.4g})" for e in rejected[:_MOST_PRINTED]]
    if len(rejected) > _MOST_PRINTED:
        lines.append(f"left out: {len(rejected) - _MOST_PRINTED} edges more; --json names them all")
    return "\n".join(lines)


def _check(options: argparse.Namespace) -> None:
    if not (math.isfinite(options.outlier_chi2) and options.outlier_chi2 > 0):
        raise ArgumentProblem(f"--outlier-chi2 {options.outlier_chi2:g}: expected a positive number")
    for path in (options.out, options.json):
        if path is not None and not path.parent.is_dir():
            raise ArgumentProblem(f"{path}: there is no folder {path.parent}")


def _write_json(path: Path, content: Mapping[str, object]) -> None:
    write_atomically(path, (json.dumps(content, indent=1) + "\n").encode("ascii"))


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def main(argv: Sequence[str] | None = None) -> int:
    """The program; its exit code."""
    options = None
    try:
        options = parser().parse_args(argv)
        return optimize(options)
    except GraphNotSolvable as error:
        _say(f"./optimize_graph: not solvable: {error}")
        if options is not None and options.json:
            _write_json(options.json, {"solved": False, "reason": str(error)})
        return NOT_SOLVABLE
    except OSError as error:
        _say(f"./optimize_graph: {error.filename or (options and options.graph)}: {error.strerror or error}")
    except (ArgumentProblem, ValueError) as error:
        _say(f"./optimize_graph: {' '.join(str(error).split())}")
    except KeyboardInterrupt:
        _say("./optimize_graph: interrupted, nothing was written")
        return NOT_SOLVABLE
    return BAD_INPUT


if __name__ == "__main__":
    sys.exit(main())
