"""Terrain classification (thesis 5.5, algorithm 3 lines 2-21): from column runs and a robot pose to classes and a navigation graph.

After the octree took in a sweep, before a goal is chosen. Free, occupied and unknown are three things here: a drop that was seen is a
cliff, a hole of a few unknown voxels is floor, and any other unknown floor is a frontier, worth a look.
"""

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.navigation.passages import Passage, connected_pieces, find_passages
from octomap_server_3dnav.navigation.straight_lines import Ground, KeptOff
from octomap_server_3dnav.octree.column_runs import ColumnRuns
from octomap_server_3dnav.octree.surface_heights import SurfaceHeights
from octomap_server_3dnav.terrain import kernels as kernels
from octomap_server_3dnav.terrain.assembly import Judged, assemble
from octomap_server_3dnav.terrain.barriers import Barriers, barriers_of, inflate, narrow_radii, passage_radii, turning_radii
from octomap_server_3dnav.terrain.classified_terrain import Terrain, TerrainClass
from octomap_server_3dnav.terrain.config import Limits, TerrainConfig
from octomap_server_3dnav.terrain.hit_extent import middles
from octomap_server_3dnav.terrain.judgement import (
    Departure,
    departure_of,
    first_flood,
    near_kerbs,
    off_doubtful_floor,
    soft_cost,
    start_candidates,
    unknown_floor,
)
from octomap_server_3dnav.terrain.scene import Scene, scene_around
from rigid_geometry import as_transform, yaw_of
from rigid_geometry.transforms import Transform

__all__ = ["Terrain", "TerrainClass", "TerrainConfig", "classify"]


def _pieces(scene: Scene, label: NDArray[np.uint8], departure: int, config: TerrainConfig) -> tuple[NDArray[np.int32], int]:
    """(N,) number of the piece of traversable ground of each node, -1 in none, and how many there are; small ones do not count."""
    piece, sizes = kernels.components(label, scene.links.graph, departure, label.size + 1)
    large = sizes >= config.min_traversable_voxels
    large[0] = True
    kernels.leave_out(piece, large)
    return piece, int(np.count_nonzero(large))


def _over_passages(
    scene: Scene, label: NDArray[np.uint8], passages: list[Passage], departure: Departure, config: TerrainConfig
) -> tuple[list[Passage], Departure]:
    """Those passages whose ends are traversable, and the departure with what they connect it with."""
    left = [p for p in passages if all(label[node] == TerrainClass.TRAVERSABLE for node in p.nodes)]
    if departure.node is None or not left:
        return left, departure
    piece, _ = _pieces(scene, label, departure.node, config)
    return left, departure._replace(reached=connected_pieces(piece, left, departure.node))


def _kept_off(scene: Scene, barriers: Barriers, edges: NDArray[np.int64], config: TerrainConfig, limits: Limits) -> KeptOff:
    """What the robot keeps off where it only drives straight: barriers in voxels, and floor that was not seen."""
    radii, unknown = passage_radii(config, limits), middles(edges[:, 0], edges[:, 1], scene.columns.ny)
    return KeptOff.of([*zip(barriers[:3], radii, strict=True), (unknown, radii.cliffs)])


def _passages(
    scene: Scene,
    label: NDArray[np.uint8],
    narrow: NDArray[np.bool_],
    kept_off: KeptOff,
    departure: Departure,
    config: TerrainConfig,
    limits: Limits,
) -> list[Passage]:
    """The passages between pieces of traversable ground."""
    if departure.node is None or not narrow.any():
        return []
    piece, count = _pieces(scene, label, departure.node, config)
    if count < 2:
        return []
    drivable = (label == TerrainClass.TRAVERSABLE) | (label == TerrainClass.INFLATION)
    passable = narrow | (label == TerrainClass.TRAVERSABLE)
    surfaces = scene.surfaces
    ground = Ground(scene.columns.ny, surfaces.start, surfaces.column, surfaces.z, scene.links.graph, drivable, passable, piece)
    return find_passages(ground, kept_off, scene, config, limits)


def classify(
    runs: ColumnRuns, T_map_base: Transform, config: TerrainConfig, radius_m: float | None, heights: SurfaceHeights | None = None
) -> Terrain:
    """The terrain around the robot at `T_map_base` out to `radius_m`, or of the whole map when it is None.

    `heights` are those of the hits in the voxels; without them steps are judged by voxels, 8 cm of which may be 1 cm or 15 cm.

    The ground plane beneath the robot must already be in the map (algorithm 3 line 2). When no start voxel has enough ground around it,
    the terrain has no nodes and `start` is None; when all ground is inflated `departure` is None. The flood goes on for one inflation
    radius beyond `radius_m`, so that what lies inside is inflated by what lies just outside. ValueError for a transform that is not rigid
    or a radius that is not positive. Thesis 5.5, algorithm 3 lines 2-21.
    """
    T_map_base = as_transform(T_map_base)
    if radius_m is not None and not radius_m > 0:
        raise ValueError(f"radius_m must be positive metres or None for the whole map, not {radius_m!r}")
    if config.step_heights != "measured" or heights is None or not len(heights):
        heights = None
    limits = Limits.of(config, runs.resolution, is_measured=heights is not None)
    robot = T_map_base[:3, 3]
    reach_m = None if radius_m is None else radius_m + (limits.inflation + 1) * runs.resolution
    scene = scene_around(runs, heights, robot, reach_m, config, limits)
    inside = scene.within(reach_m)
    label, seen, start = first_flood(scene, start_candidates(scene, T_map_base, config, limits), inside, config, limits)
    is_cliff = label == TerrainClass.CLIFF
    steps = kernels.mark_steps(label, scene.links.near, scene.links.graph, scene.surfaces.level)
    obstacles, beyond = kernels.barriers_seen(scene.columns, scene.surfaces, scene.links, label, inside, seen, limits)
    is_cliff[beyond] = True
    barriers, in_voxels = barriers_of(scene, label, obstacles, steps, np.flatnonzero(is_cliff), heights, limits)
    narrow = label.copy()
    inflate(
        scene, narrow, barriers._replace(steep=in_voxels.steep).as_points(), narrow_radii(config, limits), config.inflation_shape, limits
    )
    inflate(scene, label, barriers, turning_radii(config, limits), config.inflation_shape, limits)
    is_narrow = (narrow == TerrainClass.TRAVERSABLE) & (label == TerrainClass.INFLATION)
    unknown = unknown_floor(scene, label, seen, radius_m, limits)
    edges = unknown.frontiers
    before = departure_of(scene, label, start, config)
    kept_off = _kept_off(scene, in_voxels, edges, config, limits)
    passages = _passages(scene, label, is_narrow, kept_off, before, config, limits)
    passages, before = _over_passages(scene, label, passages, before, config)
    label, departure = off_doubtful_floor(scene, label, unknown, start, before, config, limits)
    passages, departure = _over_passages(scene, label, passages, departure, config)
    if start is not None:
        ways = [way for p in passages for way in (p, p.turned()) if is_narrow[start] or way.is_along(yaw_of(T_map_base))]
        passages += [rest for way in ways if (rest := way.rest_from((robot[0], robot[1]), start))]
    near_kerb = near_kerbs(scene, label, config, limits)
    cost = soft_cost(scene, label, near_kerb, edges, config, limits)
    beside_reached = before.reached[edges[:, 2]]
    judged = Judged(label, is_narrow, near_kerb, cost, obstacles, edges, beside_reached, start, departure, passages, kept_off)
    return assemble(scene, judged, limits, radius_m, robot)
