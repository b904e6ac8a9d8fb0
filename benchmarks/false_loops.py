"""Does a false loop harm the map? Graphs of finished sessions, grown again edge by edge, as they were and with false loops among the true.

    python benchmarks/false_loops.py SESSION [SESSION ..] [--share 0.1] [--seeds 1 2 3 4 5] [--json FILE]

With PYTHONPATH as benchmarks/README.md sets it; sessions are the folders of runs. The mapper's own graph gets vertices, edges and gravity
in the order in which they came, is optimised after each as while the robot drives, and solved at the end. False loops come at random
moments between random vertices and claim the covariance of a true loop of the session. They are consistent with gravity, as all matches
are, and say either that one vertex is within 3 m of the other, in any heading (anywhere), or that it is 0.3 to 1.5 m and up to 30 degrees
from where it is (beside): no further than a match may move its guess. Their number is a share of that of the true loops (at least one), or
of all edges. Exit code 1 when a vertex ends more than 1 cm from where it ends without them.
"""

import argparse
import itertools
import math
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from registration_scores import text_table, write_json

from pose_graph_mapping.config import MappingConfig
from pose_graph_mapping.graph.dead_reckoning import gravity_sigma
from pose_graph_mapping.graph.mapper import empty_graph
from pose_graph_mapping.graph.pose_graph import Edge, EdgeKind, PoseGraph
from pose_graph_mapping.session.session_index import SessionIndex
from pose_graph_mapping.session.session_record import StoredSweep
from rigid_geometry import inverse, rotation_from_rpy

Array = NDArray[np.float64]
Key = tuple[int, int, str, bytes]

BAR_CM = 1.0
ANYWHERE_M, BESIDE_M, BESIDE_RAD = 3.0, (0.3, 1.5), math.radians(30.0)
HEIGHT_SHARE = 0.1  # of the horizontal distance that a false loop claims
CONFIG = MappingConfig()
LEAST_APART = CONFIG.loop_min_dist_match + 1  # vertices at both ends of a loop
KINDS = ("anywhere", "beside")
HEADER = ("session", "kind", "share of", "loops", "injected", "believed first", "left out", "false still in", "right out", "worst cm")


@dataclass(frozen=True)
class Outcome:
    """One graph with false loops beside the one without: edges counted, and the largest distance between the two places of a vertex."""

    session: str
    kind: str
    share_of: str
    seed: int
    true_loops: int
    injected: int
    believed_at_first: int
    left_out: int
    false_still_in: int
    right_thrown_out: int
    displaced_cm: float


@dataclass(frozen=True, eq=False)
class Grown:
    """A graph at its end, and how many of the false loops it took for true when they came."""

    graph: PoseGraph
    believed_at_first: int


def grown(sweeps: Sequence[StoredSweep], false: Mapping[int, Sequence[Edge]]) -> Grown:
    """The graph of a session, grown as the mapper grows it; `false` loops come after the sweep that they are listed under."""
    graph, believed, stamps_s = empty_graph(CONFIG), 0, [sweep.stamp_s for sweep in sweeps]
    for k, sweep in enumerate(sweeps):
        assert sweep.change is not None and sweep.measured is not None
        placing = [e for e in sweep.change.added if e.kind is not EdgeKind.LOOP]
        surest = min(placing, key=lambda e: float(np.trace(e.covariance)), default=None)
        graph.add_vertex(sweep.change.poses[0] if surest is None else graph.pose(surest.i) @ surest.T_i_j)
        for edge in placing:
            add(graph, edge)
        if sweep.measured.gravity_base is not None:
            sigma_rad = gravity_sigma(sweep.measured.gravity_sigma_rad, stamps_s, k, CONFIG)
            graph.add_gravity(k, sweep.measured.gravity_base, sigma_rad)
        graph.optimise()
        for edge in (e for e in sweep.change.added if e.kind is EdgeKind.LOOP):
            add(graph, edge)
            graph.optimise()
        for edge in false.get(k, ()):
            add(graph, edge)
            graph.optimise()
            believed += key(edge) in keys(graph.measurements())
    graph.solve()
    return Grown(graph, believed)


def add(graph: PoseGraph, edge: Edge) -> None:
    graph.add_edge(edge.i, edge.j, edge.T_i_j, edge.covariance, edge.kind)


def key(edge: Edge) -> Key:
    return edge.i, edge.j, edge.kind.value, edge.T_i_j.tobytes()


def keys(edges: Sequence[Edge]) -> set[Key]:
    return {key(edge) for edge in edges}


def false_loops(poses: Array, edges: Sequence[Edge], count: int, kind: str, rng: np.random.Generator) -> dict[int, list[Edge]]:
    """`count` false loops by the sweep after which they come; poses (V, 4, 4) of the session without them."""
    covariances = [e.covariance for e in edges if e.kind is EdgeKind.LOOP] or [e.covariance for e in edges if e.kind is EdgeKind.MATCH]
    found: dict[int, list[Edge]] = {}
    for _ in range(count):
        moment = int(rng.integers(LEAST_APART, len(poses)))
        j = int(rng.integers(LEAST_APART, moment + 1))
        i = int(rng.integers(0, j - LEAST_APART + 1))
        T_claimed = claimed_pose(poses[i], poses[j], kind, rng)
        covariance = covariances[int(rng.integers(len(covariances)))]
        found.setdefault(moment, []).append(Edge(i, j, inverse(poses[i]) @ T_claimed, covariance, EdgeKind.LOOP))
    return found


def claimed_pose(T_map_i: Array, T_map_j: Array, kind: str, rng: np.random.Generator) -> Array:
    """Where in the map a false loop puts vertex j: turned about the vertical, and off."""
    anywhere = kind == "anywhere"
    bearing = rng.uniform(-math.pi, math.pi)
    distance = ANYWHERE_M * math.sqrt(rng.random()) if anywhere else rng.uniform(*BESIDE_M)
    yaw = rng.uniform(-1.0, 1.0) * (math.pi if anywhere else BESIDE_RAD)
    T = T_map_j.copy()
    T[:3, :3] = rotation_from_rpy(0.0, 0.0, yaw) @ T_map_j[:3, :3]
    offset = distance * np.array([math.cos(bearing), math.sin(bearing), HEIGHT_SHARE * rng.uniform(-1.0, 1.0)])
    T[:3, 3] = (T_map_i if anywhere else T_map_j)[:3, 3] + offset
    return T


def outcome(sweeps: Sequence[StoredSweep], clean: PoseGraph, name: str, kind: str, share_of: str, share: float, seed: int) -> Outcome:
    """A session grown once more, with false loops drawn by the seed."""
    true = [*clean.measurements(), *clean.rejected()]
    by_kind = Counter(e.kind for e in true)
    count = max(1, round(share * (by_kind[EdgeKind.LOOP] if share_of == "loops" else len(true))))
    rng = np.random.default_rng([seed, *f"{kind} {share_of}".encode()])
    false = false_loops(clean.poses(), clean.measurements(), count, kind, rng)
    harmed = grown(sweeps, false)
    false_keys, kept = keys([e for edges in false.values() for e in edges]), keys(harmed.graph.measurements())
    displaced = np.linalg.norm(harmed.graph.poses()[:, :3, 3] - clean.poses()[:, :3, 3], axis=1)
    return Outcome(
        session=name,
        kind=kind,
        share_of=share_of,
        seed=seed,
        true_loops=by_kind[EdgeKind.LOOP],
        injected=count,
        believed_at_first=harmed.believed_at_first,
        left_out=len(harmed.graph.rejected()),
        false_still_in=len(kept & false_keys),
        right_thrown_out=len(keys(clean.measurements()) - kept),
        displaced_cm=100.0 * float(displaced.max()),
    )


def row(found: Sequence[Outcome]) -> list[object]:
    """A line of the table, over seeds."""
    first = found[0]
    sums = [
        sum(numbers)
        for numbers in zip(
            *((o.injected, o.believed_at_first, o.left_out, o.false_still_in, o.right_thrown_out) for o in found), strict=True
        )
    ]
    return [first.session, first.kind, first.share_of, first.true_loops, *sums, f"{max(o.displaced_cm for o in found):.3f}"]


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sessions", type=Path, nargs="+", metavar="SESSION")
    parser.add_argument("--share", type=float, default=0.1, help="false loops for each true loop, or edge; default 0.1")
    parser.add_argument("--of", nargs="+", choices=("loops", "edges"), default=["loops", "edges"], help="what --share is of; default both")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument("--json", type=Path, metavar="FILE", help="every graph, for other programs")
    options = parser.parse_args()
    rows: list[list[object]] = []
    outcomes: list[Outcome] = []
    for folder in options.sessions:
        sweeps = SessionIndex(folder).sweeps
        if len(sweeps) <= LEAST_APART or any(s.change is None or s.measured is None for s in sweeps):
            parser.error(f"{folder} is no session of more than {LEAST_APART} sweeps with a graph")
        clean, name = grown(sweeps, {}).graph, f"{folder.parent.name}/{folder.name}"
        for kind, share_of in itertools.product(KINDS, options.of):
            found = [outcome(sweeps, clean, name, kind, share_of, options.share, seed) for seed in options.seeds]
            rows.append(row(found))
            outcomes += found
    print(text_table(HEADER, rows))
    worst = max(o.displaced_cm for o in outcomes)
    print(
        f"{sum(o.injected for o in outcomes)} false loops in {len(outcomes)} graphs: {sum(o.false_still_in for o in outcomes)} still in, "
        f"{sum(o.right_thrown_out for o in outcomes)} right edges thrown out; worst displacement {worst:.3f} cm"
    )
    write_json(options.json, {"graphs": [asdict(o) for o in outcomes]})
    return int(worst > BAR_CM)


if __name__ == "__main__":
    sys.exit(main())
