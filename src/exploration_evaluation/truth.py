"""The ground that the robot can reach, from the world's true mesh alone.

First step of the judge: it needs no run, and it shares nothing with the terrain classifier that it judges. The mesh is
pierced by vertical rays on a grid (`ground_surfaces`), and every surface with enough room above it becomes a node, so that floors over
floors are kept apart. Nodes of neighbouring columns are linked when the step between them can be climbed. Everything
that ends a link (a wall, a drop, a low ceiling) and everything too steep is a barrier (`ground_ends`). A robot centre that turns keeps its
circumscribed radius from barriers (thesis 7.2). What such centres reach from the start, turning on the way or straight through
narrow places (`straight_drives`), is the reachable ground.

The inside of a solid is kept out by its side faces, which end all links to it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from exploration_evaluation.config import RobotShape
from exploration_evaluation.ground_ends import TrueGround, true_ground
from exploration_evaluation.ground_grid import Floats, Ints, Mask, Surfaces, among, components, distances, grid_over
from exploration_evaluation.ground_surfaces import TrueWorld
from exploration_evaluation.mesh import RayScene, checked_mesh
from exploration_evaluation.straight_drives import straight_drives

ON_GROUND_M = 0.3
"""A point on the ground is known to that, up or down: the ground beside a robot on a slope is higher."""
CELL_M = 0.10  # edge of a cell of ground in the truth
_START_SEARCH_M = 1.5


@dataclass(frozen=True)
class ReachableGround:
    """Ground that the robot can reach; areas are horizontal projections, each level counted for itself.

    points (N, 3): cells of ground, world frame, over which the robot's centre can be and turn in place; area_m2 is theirs.
    covered_points (K, 3): cells under the body (its inscribed circle) in any of these places; they include `points`. covered_area_m2 is
    theirs; a cell on the border of either counts by its part inside, so that areas hardly depend on the grid.
    straight_points (S, 3): `covered_points`, and cells under the outline where it drives straight to and fro without room to turn.
    way_points (W, 3): cells over which the centre may pass at all, as far from things as its side is, less a cell. way_links (W, 4): index
    of the way point one cell along +x, -x, +y and -y that is driven to from each; -1 where none is.
    """

    points: Floats
    covered_points: Floats
    straight_points: Floats
    area_m2: float
    covered_area_m2: float
    cell_area_m2: float
    way_points: Floats
    way_links: Ints

    @property
    def straight_area_m2(self) -> float:
        """Area of `straight_points`."""
        return max(self.covered_area_m2, len(self.straight_points) * self.cell_area_m2)


def true_world(vertices: ArrayLike, triangles: ArrayLike, cell_m: float) -> TrueWorld:
    """A mesh, (V, 3) metres and (T, 3) indices, as the judge looks at it; ValueError for one that is none or too large."""
    mesh = checked_mesh(vertices, triangles)
    return TrueWorld(*mesh, RayScene(*mesh), grid_over(mesh[0], cell_m))


def size_problem(vertices: Floats) -> str:
    """Why a world of (V, 3) vertices is too large to be judged, and what to do; empty where it is not."""
    try:
        grid_over(vertices, CELL_M)
    except ValueError as error:
        return f"{error}; --area X Y explores a part of it"
    return ""


def reachable_ground(
    vertices: ArrayLike,
    triangles: ArrayLike,
    start_xyz: ArrayLike,
    robot: RobotShape | None = None,
    cell_m: float = CELL_M,
    closed: Callable[[Floats], Mask] | None = None,
) -> ReachableGround:
    """The ground of a mesh that a robot can reach from a start and turn on, level by level.

    vertices (V, 3) metres and triangles (T, 3) indices in the world frame; start_xyz (3,) the robot's base_link at its
    start; `closed` tells of points (N, 3) whether the robot may not be there. ValueError for a mesh that is none, one too large
    for the grid, or when there is no ground, or no room, at the start.
    """
    robot = robot or RobotShape()
    world = true_world(vertices, triangles, cell_m)
    ground = true_ground(world, robot)
    nodes, links, level_m = ground.nodes, ground.links, robot.level_m
    barriers = ground.barriers if closed is None else np.vstack([ground.barriers, _border(ground, closed(nodes.xyz))])
    turn_m, body_m = robot.circumscribed_radius_m, robot.inscribed_radius_m
    clear = distances(world.grid, nodes, barriers, turn_m + cell_m, level_m)
    room = clear >= turn_m - 1e-6
    start = _start_node(nodes, links, room, np.asarray(start_xyz, dtype=np.float64), robot.base_height_m)
    pieces = np.where(room, components(links, room), -1)
    drives = straight_drives(world.grid, nodes, barriers, pieces, int(pieces[start]), robot)
    reached = np.isin(pieces, drives.pieces)
    beside = reached | (reached[links] & (links >= 0)).any(axis=1)
    away = distances(world.grid, nodes, nodes.xyz[reached], body_m + cell_m, level_m, clear[reached] - turn_m)
    covered = reached | (away <= body_m + 1e-6)
    straight = covered | drives.under
    passable = components(links, clear >= body_m - cell_m)
    ways = (clear >= body_m - cell_m) & np.isin(passable, np.unique(passable[reached]))
    return ReachableGround(
        points=nodes.xyz[reached],
        covered_points=nodes.xyz[covered],
        straight_points=nodes.xyz[straight],
        area_m2=_area((clear - turn_m)[beside], cell_m),
        covered_area_m2=_area(body_m - away, cell_m),
        cell_area_m2=cell_m**2,
        way_points=nodes.xyz[ways],
        way_links=among(links, ways),
    )


def _border(ground: TrueGround, closed: Mask) -> Floats:
    """(B, 3) the `closed` nodes from which a link leads to open ones: the robot keeps as far from them as from a wall."""
    leads_out = np.append(~closed, False)[ground.links].any(axis=1)
    return ground.nodes.xyz[closed & leads_out]


def _area(inside_m: Floats, cell_m: float) -> float:
    """Area of cells whose centres lie so far inside a border, negative outside it; a cell on the border counts by its part inside."""
    return float(np.clip(0.5 + inside_m / cell_m, 0.0, 1.0).sum() * cell_m**2)


def _start_node(nodes: Surfaces, links: Ints, room: Mask, start_xyz: Floats, base_height_m: float) -> int:
    """The place of the centre nearest to the start, on ground that is connected with it."""
    if start_xyz.shape != (3,) or not np.isfinite(start_xyz).all():
        raise ValueError(f"a start is a finite x, y, z, not {start_xyz!r}")
    away = np.linalg.norm(nodes.xyz[:, :2] - start_xyz[:2], axis=1)
    off_m = np.abs(start_xyz[2] - base_height_m - nodes.xyz[:, 2])
    under = np.flatnonzero((away < 0.3) & (off_m < ON_GROUND_M))
    if not len(under):
        raise ValueError(f"no ground to stand on at the start {start_xyz.round(2).tolist()}")
    piece = components(links, np.ones(len(room), dtype=np.bool_))
    places = np.flatnonzero(room & (away <= _START_SEARCH_M) & (piece == piece[under[np.argmin(away[under])]]))
    if not len(places):
        raise ValueError(f"no room to turn within {_START_SEARCH_M} m of the start {start_xyz.round(2).tolist()}")
    return int(places[np.argmin(away[places])])
