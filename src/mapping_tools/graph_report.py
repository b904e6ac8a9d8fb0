"""What ./optimize_graph says of a graph: what of its file is not used, how it was solved, and which edges were left out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypedDict

import numpy as np

from mapping_tools.graph_solving import NumberedGraph, SolvedGraph
from mapping_tools.graph_starts import polished
from mapping_tools.sesync_error import is_isotropic, isotropic, sesync_error
from pose_graph_mapping.graph.graph_files import GraphFile
from pose_graph_mapping.graph.graph_problem import GraphProblem, poses_of

ERROR_UNIT = "half of the sum of squared Mahalanobis distances of the edges"
_MOST_PRINTED = 20


class RejectedEdge(TypedDict):
    """An edge that was left out, with its line in the file and its error."""

    i: int
    j: int
    line: int
    kind: str
    error: float


class Report(TypedDict):
    """What --json writes of a solved graph; sesync_least: the least that SE-Sync's error of the kept edges can be near these poses."""

    solved: bool
    vertices: int
    edges: int
    priors: int
    is_2d: bool
    initialised_vertices: int
    fixed: list[int]
    unused_lines: dict[str, int]
    robust: bool
    initial_error: float
    final_error: float
    error_unit: str
    sesync_error: float | None
    sesync_least: float | None
    rejected_edges: list[RejectedEdge]
    time_s: float


def remarks(file: GraphFile, graph: NumberedGraph) -> Iterator[str]:
    """What of the file is not used or not as it stands there, a line each."""
    yield f"{len(graph.ids)} vertices, {graph.initialised} of them without a line, {len(file.edges)} edges, {len(file.priors)} priors"
    if file.is_2d:
        yield "it is 2-D: solved in the plane, and written as 2-D"
    if file.left_out:
        yield "not used, and left out: " + ", ".join(f"{count} {tag}" for tag, count in sorted(file.left_out.items()))
    if file.empty_edges:
        yield f"information matrices of zeros, lines left out: {len(file.empty_edges)}, the first in line {file.empty_edges[0]}"
    partial = [line for line, edge in zip(file.edge_lines, file.edges, strict=True) if edge.information is not None]
    if partial:
        yield f"singular information matrices, used in the directions that they know: {len(partial)}, the first in line {partial[0]}"
    if file.stretched:
        yield f"quaternions that are not of length one, and are scaled to it: {file.stretched}"


def report(file: GraphFile, graph: NumberedGraph, solved: SolvedGraph, plain: bool) -> Report:
    """What --json writes of a solved graph; its time is for the caller to add."""
    rejected: list[RejectedEdge] = [
        {"i": edge.i, "j": edge.j, "line": line, "kind": edge.kind.value, "error": float(error)}
        for edge, line, error, keep in zip(file.edges, file.edge_lines, solved.edge_errors, solved.kept, strict=True)
        if not keep
    ]
    error, least = (None, None) if file.is_2d or file.priors else _sesync(graph.problem, solved)
    return {
        "solved": True,
        "vertices": len(graph.ids),
        "edges": len(file.edges),
        "priors": len(file.priors),
        "is_2d": file.is_2d,
        "initialised_vertices": graph.initialised,
        "fixed": [graph.ids[k] for k in graph.problem.fixed],
        "unused_lines": dict(sorted(file.left_out.items())),
        "robust": not plain,
        "initial_error": solved.initial_error,
        "final_error": solved.final_error,
        "error_unit": ERROR_UNIT,
        "sesync_error": error,
        "sesync_least": least,
        "rejected_edges": rejected,
        "time_s": 0.0,
    }


def summary(content: Report) -> str:
    """What is printed of a solved graph."""
    rejected = content["rejected_edges"]
    lines = [f"error {content['initial_error']:.6g} -> {content['final_error']:.6g} over {content['edges'] - len(rejected)} edges"]
    if content["sesync_error"] is not None:
        lines.append(f"as SE-Sync counts: {content['sesync_error']:.6g}; the least by its weights: {content['sesync_least']:.6g}")
    lines += [f"left out: {e['i']} - {e['j']} (line {e['line']}, error {e['error']:.4g})" for e in rejected[:_MOST_PRINTED]]
    if len(rejected) > _MOST_PRINTED:
        lines.append(f"left out: {len(rejected) - _MOST_PRINTED} edges more; --json names them all")
    return "\n".join(lines)


def _sesync(problem: GraphProblem, solved: SolvedGraph) -> tuple[float, float]:
    """SE-Sync's error of the kept edges, and the least that it comes to from there."""
    kept = [edge for edge, keep in zip(problem.edges, solved.kept, strict=True) if keep]
    here = GraphProblem(solved.poses, kept, fixed=problem.fixed)
    error = sesync_error(kept, solved.poses)
    if is_isotropic(kept):
        return error, error
    by_weights = isotropic(here)
    best = poses_of(polished(by_weights.factors(), by_weights.values()), len(solved.poses))
    return error, min(error, sesync_error(kept, np.asarray(best)))
