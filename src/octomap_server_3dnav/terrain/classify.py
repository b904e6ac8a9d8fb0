"""Terrain classification (thesis 5.5, algorithm 3 lines 2-21): from column runs and a robot pose to classes and a navigation graph.

After the octree took in a sweep, before a goal is chosen. Free, occupied and unknown are three things here: a drop that was seen is a
cliff, a hole of a few unknown voxels is floor, and any other unknown floor is a frontier, worth a look. docs/terrain.md has the principles.
"""

import numpy as np
from numpy.typing import NDArray

from map_zones import NO_ZONES, ClosedColumns, Zones
from octomap_server_3dnav.octree.column_runs import ColumnRuns
from octomap_server_3dnav.octree.surface_heights import SurfaceHeights
from octomap_server_3dnav.terrain.assembly import Judged, assemble
from octomap_server_3dnav.terrain.classified_terrain import INFLATION, OBSTACLE, TRAVERSABLE, Barriers, Terrain, TerrainClass
from octomap_server_3dnav.terrain.config import Limits, TerrainConfig
from octomap_server_3dnav.terrain.distance import barriers_of, distances
from octomap_server_3dnav.terrain.flood import mark_steps
from octomap_server_3dnav.terrain.frontiers import unknown_edges
from octomap_server_3dnav.terrain.judgement import departure_of, first_flood, near_kerbs, soft_cost, start_candidates
from octomap_server_3dnav.terrain.scene import Scene, scene_around
from rigid_geometry import as_transform
from rigid_geometry.transforms import Transform
from robot_body import RobotBody

__all__ = ["Terrain", "TerrainClass", "TerrainConfig", "classify"]


def classify(
    runs: ColumnRuns,
    T_map_base: Transform,
    config: TerrainConfig,
    robot: RobotBody,
    radius_m: float | None,
    heights: SurfaceHeights | None = None,
    zones: Zones = NO_ZONES,
) -> Terrain:
    """The terrain around the robot at `T_map_base`, of `radius_m` or of all of `runs` when it is None.

    `heights` tell where in their voxels surfaces lie; without them, as for a `.bt` file, only voxels are known. What `zones` close is an
    obstacle. ValueError for a transform that is none, a configuration out of its ranges, or a radius that is not positive.
    """
    T_map_base = as_transform(T_map_base)
    if problems := config.validate():
        raise ValueError("; ".join(problems))
    if radius_m is not None and not radius_m > 0:
        raise ValueError(f"radius_m must be positive metres or None, not {radius_m!r}")
    heights = heights if config.step_heights == "measured" else None
    limits = Limits.of(config, robot, runs.resolution)
    reach_m = None if radius_m is None else radius_m + (np.ceil(limits.keep_off) + 1) * runs.resolution
    scene = scene_around(runs, heights, T_map_base[:3, 3], reach_m, limits)
    # Lines 2 and 6-15: the start voxel, and the flood from the first candidate with enough ground around it.
    candidates = start_candidates(scene, T_map_base, robot, limits)
    label, seen, start = first_flood(scene, candidates, scene.within(reach_m), config.min_ground_voxels, limits)
    mark_steps(label, seen, scene.links.near)
    closed, places = ClosedColumns(zones, scene.columns.ny, scene.key, runs.resolution), (scene.surfaces.column, scene.surfaces.z)
    label[(label == TRAVERSABLE) & closed.at(*places)] = OBSTACLE
    # Line 18, addRobotPadding.
    barriers = Barriers(*closed.with_borders(barriers_of(scene, heights, label, seen, limits), *places, label == TRAVERSABLE))
    within = limits.keep_off + config.soft_clearance_m / runs.resolution
    distance = distances(
        barriers.node, barriers.x, barriers.y, (places[0], _over(label, scene), scene.columns.ny), within, limits.is_square
    )
    label[(label == TRAVERSABLE) & (distance <= limits.keep_off + 1e-6)] = INFLATION
    # Line 19, changeStartingPointIfInsidePadding.
    departure = departure_of(scene, label, start, config.min_ground_voxels)
    # Line 20, searchFrontiers.
    edges = closed.left_of(unknown_edges(scene.columns, scene.surfaces, label, scene.within(radius_m), seen, limits))
    kerbed = near_kerbs(scene, label, config, robot, limits)
    cost = soft_cost(scene, (label, distance, kerbed), edges, config, limits)
    return assemble(scene, Judged(label, kerbed[0], distance, cost, barriers, edges, start, departure), limits, radius_m, T_map_base[:3, 3])


def _over(label: NDArray[np.uint8], scene: Scene) -> NDArray[np.int32]:
    """(N, 4) neighbours by way of the ground that the flood found traversable."""
    graph = scene.links.graph
    is_ground = np.append(label == TRAVERSABLE, False)
    return np.where(is_ground[graph] & is_ground[:-1, None], graph, -1)
