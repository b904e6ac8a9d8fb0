"""What bounds and no-go zones make of the terrain: obstacles, known or not, no frontiers, and goals and paths that keep off."""

import math

import numpy as np
import pytest
from terrain_worlds import UNKNOWN, decide, opening, pose, room, runs_of, terrain_of

from map_zones import NO_ZONES, Zone, Zones
from octomap_server_3dnav.exploration.decide import Explorer
from octomap_server_3dnav.exploration.decision import DecisionKind
from octomap_server_3dnav.navigation.local_grid import LETHAL, project
from octomap_server_3dnav.navigation.passages import TerrainSettings, navigable_terrain
from octomap_server_3dnav.navigation.planner import PlannerConfig, nearest_traversable, plan_path
from octomap_server_3dnav.terrain.classified_terrain import Terrain, TerrainClass
from robot_body import RobotBody

AT = (2.0, 2.0)
ROBOT = RobotBody()


def square(x: float, y: float, x2: float, y2: float, low: float = -math.inf, high: float = math.inf) -> Zone:
    return Zone(np.array([[x, y], [x2, y], [x2, y2], [x, y2]]), low, high)


def terrain_with(zones: Zones, world: np.ndarray | None = None, at: tuple[float, float] = AT, radius_m: float | None = None) -> Terrain:
    runs = runs_of(room() if world is None else world)
    return navigable_terrain(runs, pose(*at), TerrainSettings(zones=zones), radius_m)


def open_ground(terrain: Terrain) -> np.ndarray:
    return terrain.centers(np.flatnonzero(terrain.label == TerrainClass.TRAVERSABLE)).astype(np.float64)


BOUNDS, NO_GO = Zones(bounds=(square(0.9, 0.9, 5.2, 5.0),)), Zones(no_go=(square(3.4, 3.2, 4.6, 4.4),))
TURNED = Zones(bounds=(Zone(np.array([[2.6, 0.6], [6.0, 3.2], [3.0, 6.4], [0.6, 3.0]])),), no_go=(square(3.4, 3.2, 3.8, 3.6),))


@pytest.mark.parametrize("zones", [BOUNDS, NO_GO, TURNED], ids=["bounds", "no-go", "both, turned"])
@pytest.mark.parametrize("radius_m", [None, 3.0])
def test_robot_that_turns_keeps_its_radius_from_what_is_closed_and_little_more(zones: Zones, radius_m: float | None) -> None:
    terrain, plain = terrain_with(zones, at=(2.4, 2.4), radius_m=radius_m), terrain_with(NO_ZONES, at=(2.4, 2.4), radius_m=radius_m)
    around = np.linspace(0.0, 2 * np.pi, 60)
    ring = np.stack([np.cos(around), np.sin(around), 0 * around], axis=1)
    disc = np.concatenate([share * ring for share in (0.0, 0.25, 0.5, 0.75, 1.0)])
    ground, everywhere = open_ground(terrain), open_ground(plain)
    outlines = ground[:, None] + ROBOT.turning_radius_m * disc
    assert len(ground) > 50 and zones.depth_m(outlines.reshape(-1, 3)).max() == 0.0
    wider_m = ROBOT.turning_radius_m + 0.08 * 1.5 * math.sqrt(2) + 0.03  # a voxel and a half, cornerwise, and the margin
    wider = (everywhere[:, None] + wider_m * disc).reshape(-1, 3)
    is_clear = ~zones.closed(wider).reshape(len(everywhere), -1).any(axis=1)
    assert is_clear.sum() > 50 and set(map(tuple, everywhere[is_clear])) <= set(map(tuple, ground))


@pytest.mark.parametrize("turned_rad", [0.0, 0.6, math.pi / 4])
def test_line_that_is_thinner_than_a_voxel_parts_the_ground(turned_rad: float) -> None:
    """A virtual wall of 2 cm, which no voxel's centre lies in."""
    along, aside = (np.array([math.cos(turned_rad), math.sin(turned_rad)]), np.array([-math.sin(turned_rad), math.cos(turned_rad)]))
    ends = np.array([3.2, 3.2]) + 0.01 * np.array([[1], [1], [-1], [-1]]) * aside + 6.0 * np.array([[-1], [1], [1], [-1]]) * along
    terrain = terrain_with(Zones(no_go=(Zone(ends),)), at=tuple(np.array([3.2, 3.2]) - 1.2 * aside))
    beyond = (open_ground(terrain)[:, :2] - 3.2) @ aside > 0.0
    reached = terrain.reached[terrain.label == TerrainClass.TRAVERSABLE]
    assert beyond.sum() > 50 and reached[~beyond].sum() > 50 and not reached[beyond].any()
    grid = project(terrain, terrain.robot_xyz[:2], 5.0)
    line = np.array([3.2, 3.2]) + np.linspace(-1.0, 1.0, 40)[:, None] * along
    column, row = np.floor((line - grid.origin_xy) / grid.resolution).astype(int).T
    near = [grid.cost[r - 1 : r + 2, c - 1 : c + 2].max() for r, c in zip(row, column, strict=True)]
    assert min(near) == LETHAL


def test_without_zones_nothing_changes() -> None:
    assert terrain_with(NO_ZONES).label.tobytes() == terrain_of(room(), pose(*AT)).label.tobytes()


def test_zone_of_another_height_closes_nothing() -> None:
    above = Zones(no_go=(square(3.4, 3.2, 4.6, 4.4, 1.0, 3.0),))
    assert terrain_with(above).label.tobytes() == terrain_with(NO_ZONES).label.tobytes()
    assert terrain_with(Zones(no_go=(square(3.4, 3.2, 4.6, 4.4, -0.5, 0.5),))).label.tobytes() == terrain_with(NO_GO).label.tobytes()


def test_frontier_beyond_the_bounds_is_none_and_within_them_stays_one() -> None:
    world = opening(room())  # unknown floor at one side
    runs = runs_of(world)
    unbounded = Explorer()
    first = decide(unbounded, runs, pose(*AT))
    assert first.kind is DecisionKind.GOAL and first.frontier is not None
    x, y, _ = first.frontier
    wide = Zones(bounds=(square(-1.0, -1.0, 20.0, 20.0),))
    narrow = Zones(bounds=(square(0.5, 0.5, x - 0.5, 20.0),)) if x > y else Zones(bounds=(square(0.5, 0.5, 20.0, y - 0.5),))
    for zones, kind in ((wide, DecisionKind.GOAL), (narrow, DecisionKind.EXPLORED)):
        explorer = Explorer(terrain=TerrainSettings(zones=zones))
        assert decide(explorer, runs, pose(*AT)).kind is kind


def test_robot_keeps_its_radius_from_what_is_closed_also_where_nothing_is_known_of_it() -> None:
    world, zones = room(), Zones(bounds=(square(0.0, 0.0, 4.0, 9.0),))
    world[50:, :, :] = UNKNOWN  # from 4 m on
    bounded, unbounded = (open_ground(terrain_with(z, world))[:, 0].max() for z in (zones, NO_ZONES))
    assert unbounded > 3.9
    assert 4.0 - ROBOT.turning_radius_m - 0.2 < bounded < 4.0 - ROBOT.turning_radius_m


def test_unknown_floor_inside_a_no_go_zone_is_no_frontier() -> None:
    world = room()
    world[45:60, 45:60, :] = UNKNOWN
    runs = runs_of(world)
    assert decide(Explorer(), runs, pose(*AT)).kind is DecisionKind.GOAL
    zones = Zones(no_go=(square(3.6, 3.6, 4.8, 4.8),))
    assert decide(Explorer(terrain=TerrainSettings(zones=zones)), runs, pose(*AT)).kind is DecisionKind.EXPLORED


def test_path_leads_around_a_no_go_zone() -> None:
    zones = Zones(no_go=(square(3.0, -1.0, 3.4, 4.4),))
    terrain = terrain_with(zones)
    goal = nearest_traversable(terrain, (5.0, 2.0, 0.04), 0.3)
    assert goal is not None
    path = plan_path(terrain, goal, PlannerConfig())
    assert path is not None and path.points[:, 1].max() > 4.4 + ROBOT.turning_radius_m
    assert nearest_traversable(terrain, (3.2, 2.0, 0.04), 0.3) is None


def test_costmap_holds_what_is_closed_as_lethal_known_or_not() -> None:
    world = room()
    world[60:, :, :] = UNKNOWN
    zones = Zones(bounds=(square(0.9, 0.9, 4.7, 5.0),))
    terrain = terrain_with(zones, world)
    grid = project(terrain, (3.0, 3.0), 6.0)
    cells = np.indices(grid.cost.shape)
    x, y = ((cells[1 - axis] + 0.5) * 0.08 + grid.origin_xy[axis] for axis in (0, 1))
    outside = zones.closed(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)).reshape(x.shape)
    assert (grid.cost[outside] == 100).all() and (grid.cost[~outside & (x < 4.6)] == 0).mean() > 0.9
    assert (project(terrain_with(NO_ZONES, world), (3.0, 3.0), 6.0).cost[outside & (x > 5.0)] == -1).all()


def test_robot_outside_its_bounds_is_trapped_and_says_so() -> None:
    explorer = Explorer(terrain=TerrainSettings(zones=Zones(bounds=(square(3.0, 3.0, 6.0, 6.0),))))
    decision = decide(explorer, runs_of(room()), pose(*AT))
    assert decision.kind is DecisionKind.TRAPPED and "(2.00, 2.00) lies outside the bounds" in decision.reason


def test_zones_may_change_while_it_explores() -> None:
    explorer, runs = Explorer(), runs_of(opening(room()))
    first = decide(explorer, runs, pose(*AT))
    assert first.kind is DecisionKind.GOAL and first.frontier is not None
    explorer.set_zones(Zones(bounds=(square(0.5, 0.5, 4.0, 4.0),)))
    assert decide(explorer, runs, pose(*AT)).kind is DecisionKind.EXPLORED
    with pytest.raises(ValueError, match=r"bounds\[0\]"):
        explorer.set_zones(Zones(bounds=(square(1.0, 1.0, 1.0, 1.0),)))
