"""Where the ground of a mesh ends: at walls, posts, drops, low ceilings and slopes that are too steep; and which links are left.

After `ground_surfaces`. Horizontal rays and the edges of steep faces find what stands on the ground, finer vertical rays where it ends that
nothing stands on.
"""

from dataclasses import dataclass

import numpy as np

from exploration_evaluation.config import RobotShape
from exploration_evaluation.ground_grid import STEPS, Floats, Ints, Surfaces, first_of, nearest_in_height, neighbour_columns
from exploration_evaluation.ground_surfaces import TrueWorld, all_surfaces, ground_links, steepest, without_steep

_PARTS_OF_CELL = 10  # in which the end of the ground is looked for
_EDGE_RAD = 0.3  # by which a face is steeper than the ground beside it where both meet at an edge


@dataclass(frozen=True)
class TrueGround:
    """The ground of a world for a robot.

    surfaces: all with headroom; nodes: those of them that are ground; links (M, 4): node one cell along +x, -x, +y, -y that is driven to
    from each node, -1 where none is; ends (E, 3): where the links that are -1 end, at their node's height, all of one direction after the
    other; thin (B, 3): things so thin that all rays miss them.
    """

    surfaces: Surfaces
    nodes: Surfaces
    links: Ints
    ends: Floats
    thin: Floats

    @property
    def barriers(self) -> Floats:
        """All that ends ground."""
        return np.vstack([self.ends, self.thin])


def true_ground(world: TrueWorld, robot: RobotShape) -> TrueGround:
    """Surfaces, ground, links and what ends it."""
    surfaces = all_surfaces(world, robot)
    nodes = without_steep(surfaces, robot)
    ends, links = _ends_of_ground(world, surfaces, nodes, robot)
    return TrueGround(surfaces, nodes, links, ends, _thin_things(world, nodes, robot))


def _ends_of_ground(world: TrueWorld, surfaces: Surfaces, nodes: Surfaces, robot: RobotShape) -> tuple[Floats, Ints]:
    """(E, 3) points, at their node's height, where ground ends or something stands on it; and the (M, 4) links that are left.

    Short horizontal rays at several heights of the body find things between the columns, and find them exactly; `_ends_between` finds
    where it ends that nothing stands on.
    """
    grid = world.grid
    links = ground_links(grid, nodes.column, nodes.first, nodes.xyz[:, 2], nodes.slope, robot)
    points, kept = [], links.copy()
    for direction in range(4):
        step = STEPS[direction] * grid.cell
        linked = links[:, direction] >= 0
        rise = np.where(linked, nodes.xyz[links[:, direction], 2] - nodes.xyz[:, 2], 0.0)
        free = world.free_fraction(nodes.xyz, np.column_stack([np.tile(step, (len(rise), 1)), rise]), robot)
        ended = ~linked | (free <= 1.0)
        kept[ended, direction] = -1
        share = free[ended]
        open_ends = np.flatnonzero(ended)[share > 1.0]
        share[share > 1.0] = _ends_between(world, surfaces, nodes.some_of(open_ends), direction, robot)
        end = nodes.xyz[ended].copy()
        end[:, :2] += share[:, None] * step
        points.append(end)
    return np.vstack(points), kept


def _ends_between(world: TrueWorld, surfaces: Surfaces, at: Surfaces, direction: int, robot: RobotShape) -> Floats:
    """(N,) at which part of the way to the next column the ground of each node ends, as a drop, below a ceiling or as too steep a slope.

    Drops, ceilings and faces that begin at an edge are looked for by vertical rays between the columns. Where ground gets too steep by and
    by it ends where the steepness between both columns would be at its limit; a steep flank above the floor is none that this leads to.
    """
    grid, z = world.grid, at.xyz[:, 2]
    beyond = nearest_in_height(surfaces.first, surfaces.xyz[:, 2], neighbour_columns(grid, at.column, direction), z, grid.cell)
    here, there = at.steepness, np.where(beyond >= 0, surfaces.steepness[beyond], 0.0)
    is_steep = there > steepest(robot)
    last, face = _last_floor(world, at, STEPS[direction] * grid.cell, robot)
    by_and_by = np.where(is_steep, (steepest(robot) - here) / np.where(is_steep, there - here, 1.0), 0.5)
    return np.where(np.isfinite(face) & (is_steep | np.isinf(last)), face, np.where(np.isinf(last), by_and_by, last))


def _last_floor(world: TrueWorld, ground: Surfaces, step_xy: Floats, robot: RobotShape) -> tuple[Floats, Floats]:
    """(N,) part of a step from N places of the ground over which there is floor with headroom, inf where that goes on all the way; and
    part of it at which the last edge to a much steeper face lies, inf where there is none."""
    count = len(ground.xyz)
    if not count:
        return np.zeros(0), np.zeros(0)
    shares = np.arange(1, _PARTS_OF_CELL + 1) / _PARTS_OF_CELL
    places = ground.xyz[:, None, :2] + shares[None, :, None] * step_xy
    place, floors, triangle = world.floors(places.reshape(-1, 2), robot.headroom_m)
    first, slopes = first_of(place, count * len(shares)), world.slopes[triangle]
    level, slope, left = ground.xyz[:, 2].copy(), ground.slope.copy(), np.arange(count)
    end, face = np.full((2, count), np.inf)
    for part, share in enumerate(shares):
        floor = nearest_in_height(first, floors, left * len(shares) + part, level[left], robot.max_step_m)
        middle = share - 0.5 / _PARTS_OF_CELL
        end[left[floor < 0]] = middle
        left, floor = left[floor >= 0], floor[floor >= 0]
        face[left[(slopes[floor] > steepest(robot)) & (slopes[floor] > slope[left] + _EDGE_RAD)]] = middle
        level[left], slope[left] = floors[floor], slopes[floor]
    return end, face


def _thin_things(world: TrueWorld, nodes: Surfaces, robot: RobotShape) -> Floats:
    """(B, 3) barriers where edges of steep faces rise out of the ground: posts so thin that all rays miss them."""
    column, xyz = _samples_of_steep_edges(world, robot.max_slope_rad)
    begin, end = nodes.first[column], nodes.first[column + 1]
    found = []
    for layer in range(int(max(0, (end - begin).max(initial=0)))):
        there = begin + layer < end
        ground = nodes.xyz[begin[there] + layer, 2]
        above = xyz[there, 2] - ground
        stands = (above > robot.ground_clearance_m) & (above <= robot.height_m)
        found.append(np.column_stack([xyz[there][stands, :2], ground[stands]]))
    return np.vstack([np.empty((0, 3)), *found])


def _samples_of_steep_edges(world: TrueWorld, max_slope_rad: float) -> tuple[Ints, Floats]:
    """Column and (S, 3) position of points every half cell along the edges of steep triangles."""
    vertices, grid = world.vertices, world.grid
    steep = world.triangles[world.slopes > max_slope_rad]
    edges = np.unique(np.sort(np.vstack([steep[:, [0, 1]], steep[:, [1, 2]], steep[:, [2, 0]]]), axis=1), axis=0)
    a, b = vertices[edges[:, 0]], vertices[edges[:, 1]]
    pieces = np.maximum(1, np.ceil(np.linalg.norm(b - a, axis=1) / (0.5 * grid.cell))).astype(np.int64)
    edge = np.repeat(np.arange(len(edges)), pieces + 1)
    number = np.arange(len(edge)) - np.repeat(np.cumsum(pieces + 1) - (pieces + 1), pieces + 1)
    xyz = a[edge] + (number / pieces[edge])[:, None] * (b - a)[edge]
    column = grid.columns_of(xyz[:, :2])
    return column[column >= 0], xyz[column >= 0]
