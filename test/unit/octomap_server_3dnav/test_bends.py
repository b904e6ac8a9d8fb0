"""Ways that bend where the robot cannot turn round: doors beside a corridor, gaps that wind; never where the outline does not fit."""

import math

import numpy as np
import pytest
from terrain_worlds import BELOW, FREE, OCCUPIED, RESOLUTION, UNKNOWN, decide, grid_of_heights, pose, runs_of, terrain_of, way
from virtual_explorer import explore

from octomap_server_3dnav.exploration.decide import Explorer
from octomap_server_3dnav.exploration.decision import DecisionKind
from octomap_server_3dnav.navigation.passages import TerrainSettings, is_along, navigable_terrain, rest_from, ways_if_floor
from octomap_server_3dnav.navigation.planner import PlannerConfig
from octomap_server_3dnav.navigation.straight_lines import PassageConfig
from octomap_server_3dnav.terrain.classified_terrain import Passage, TerrainClass
from octomap_server_3dnav.terrain.config import TerrainConfig
from rigid_geometry import legs_of

CONFIG = PlannerConfig()
AXIS_Y = 70  # the column in the middle of the corridor
LOBBY, NORTH, SOUTH = (2.0, 5.6), (6.9, 9.0), (10.4, 1.8)


def solid(nx: int, ny: int) -> np.ndarray:
    """Rock, its floor at height 0.04 m."""
    states = grid_of_heights(lambda x, y: 0.04 + 0 * x * y, nx, ny)
    states[:, :, BELOW:] = OCCUPIED
    return states


def dig(states: np.ndarray, x: slice | np.ndarray, y: slice | np.ndarray) -> None:
    states[x, y, BELOW + 1 :] = FREE


def office(corridor: int, door: int = 12) -> np.ndarray:
    """A lobby, a corridor so many columns wide, and a room on each of its sides behind a door; corridor and door too short to run up."""
    states, low = solid(180, 140), AXIS_Y - corridor // 2
    dig(states, slice(5, 50), slice(AXIS_Y - 22, AXIS_Y + 22))
    dig(states, slice(50, 160), slice(low, low + corridor))
    for x, room, strip in ((80, slice(low + corridor + 2, 132), slice(AXIS_Y, 132)), (125, slice(8, low - 2), slice(8, AXIS_Y))):
        dig(states, slice(x, x + door), strip)
        dig(states, slice(x - 15, x + 30), room)
    return states


def bent_gap(wide_m: float, bend_rad: float) -> np.ndarray:
    """Two rooms joined by a gap so wide that bends by an angle in its middle, where it is round."""
    states = solid(130, 90)
    dig(states, slice(5, 40), slice(20, 70))
    dig(states, slice(90, 125), slice(20, 85))
    x, y = (np.stack(np.meshgrid(np.arange(130), np.arange(90), indexing="ij")) + 0.5) * RESOLUTION - np.array([5.2, 3.6])[:, None, None]
    for dx, dy in ((-1.0, 0.0), (math.cos(bend_rad), math.sin(bend_rad))):
        along = np.clip(x * dx + y * dy, 0.0, 2.3)
        dig(states, *np.nonzero(np.hypot(x - along * dx, y - along * dy) <= wide_m / 2))
    return states


def posts(seed: int, apart: float) -> np.ndarray:
    """Two rooms, and between them posts of a column each, so many columns apart at least and nowhere much farther."""
    states, rng, placed = solid(100, 60), np.random.default_rng(seed), list[tuple[int, int]]()
    for x, y in ((slice(5, 95), slice(15, 45)), (slice(5, 30), slice(5, 55)), (slice(70, 95), slice(5, 55))):
        dig(states, x, y)
    for _ in range(300):
        x, y = int(rng.integers(33, 67)), int(rng.integers(15, 45))
        if all(math.hypot(x - px, y - py) >= apart for px, py in placed):
            placed.append((x, y))
            states[x, y, BELOW + 1 :] = OCCUPIED
    return states


def legs(passage: Passage) -> np.ndarray:
    """(L, 2, 2) ends of its legs."""
    return np.array([passage.line[[first, last], :2] for first, last in legs_of(passage.line)])


def poses_along(passage: Passage) -> np.ndarray:
    """(K, 3) poses of a robot that drives its legs, and turns the short way, nose or rear ahead, between them."""
    found, axis = [], None
    for a, b in legs(passage):
        to = math.atan2(*(b - a)[::-1])
        if axis is not None:
            by = math.remainder(to - axis, math.pi)
            found += [(*a, axis + by * share) for share in np.linspace(0, 1, 40)]
        found += [(*(a + (b - a) * share), to) for share in np.linspace(0, 1, 60)]
        axis = to
    return np.array(found)


def room_around(poses: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(K, M) metres from the sides of the outline of 0.99 x 0.67 m to places, negative inside it, by brute force."""
    off = places[None, :, :2] - poses[:, None, :2]
    c, s = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
    along, aside = off[..., 0] * c + off[..., 1] * s, off[..., 1] * c - off[..., 0] * s
    return np.maximum(np.abs(along) - 0.495, np.abs(aside) - 0.335)


def inside_outline(poses: np.ndarray, places: np.ndarray) -> int:
    """How many places the outline covers."""
    return int((room_around(poses, places) < -1e-6).sum())


@pytest.mark.parametrize("corridor", [15, 16, 17, 18])
def test_rooms_beside_a_corridor_without_run_up_are_reached(corridor: int) -> None:
    terrain = terrain_of(office(corridor), pose(*LOBBY))
    for room in (NORTH, SOUTH):
        assert terrain.reached[terrain.surface_near((*room, 0.04))]
        path = way(terrain, *room)
        assert path is not None and path.straight.any()


@pytest.mark.parametrize("corridor, door", [(17, 8), (11, 12)])
def test_rooms_stay_closed_where_the_outline_cannot_turn_in_or_pass(corridor: int, door: int) -> None:
    terrain = terrain_of(office(corridor, door), pose(*LOBBY))
    assert way(terrain, *NORTH) is None and way(terrain, *SOUTH) is None


WORLDS = {"corridor": office(16), "wider corridor": office(18), "bend": bent_gap(1.05, 0.5), "wider bend": bent_gap(1.15, 0.6)}


@pytest.mark.parametrize("states", WORLDS.values(), ids=WORLDS)
def test_outline_stays_off_all_barriers_on_every_way(states: np.ndarray) -> None:
    terrain = terrain_of(states, pose(2.0, 5.6) if states.shape[0] == 180 else pose(1.6, 3.6))
    walls = terrain.centers(terrain.nodes_of(TerrainClass.OBSTACLE))
    assert terrain.passages
    for passage in terrain.passages:
        assert not inside_outline(poses_along(passage), walls)
        assert all(terrain.label[node] == TerrainClass.TRAVERSABLE for node in passage.nodes)


@pytest.mark.parametrize("seed, apart", [(756, 9.0), (765, 9.0)])
def test_outline_stays_off_posts_while_it_turns_between_two_legs(seed: int, apart: float) -> None:
    """Both legs at a corner are free in these, and shorter than the way that has room to turn."""
    terrain = terrain_of(posts(seed, apart), pose(1.4, 2.4))
    walls = terrain.centers(terrain.nodes_of(TerrainClass.OBSTACLE))
    assert terrain.passages
    for passage in terrain.passages:
        assert len(legs(passage)) > 2 and not inside_outline(poses_along(passage), walls)


def legs_and_room(config: PassageConfig) -> tuple[int, float]:
    """Of the way through a gap that bends: how many legs it has, and the least room of the outline."""
    terrain = navigable_terrain(runs_of(bent_gap(1.1, 0.7)), pose(1.6, 3.6), TerrainSettings(passages=config), None)
    (passage,) = terrain.passages
    room = room_around(poses_along(passage), terrain.centers(terrain.nodes_of(TerrainClass.OBSTACLE)))
    return len(legs(passage)), float(room.min())


def test_way_that_bends_weighs_room_against_corners_as_configured() -> None:
    usual = legs_and_room(PassageConfig())
    assert legs_and_room(PassageConfig(corner_m=0.0))[0] > usual[0] > legs_and_room(PassageConfig(corner_m=1.0))[0]
    assert legs_and_room(PassageConfig(close_weight=0.0))[1] < usual[1] < legs_and_room(PassageConfig(close_weight=10.0))[1]
    assert legs_and_room(PassageConfig(ample_room_m=0.04))[1] < usual[1]


def test_gap_that_winds_is_passed_on_legs_with_corners_between() -> None:
    terrain = terrain_of(bent_gap(1.05, 0.5), pose(1.6, 3.6))
    (passage,) = terrain.passages
    assert len(legs(passage)) >= 2
    path = way(terrain, 8.6, 5.0)
    assert path is not None
    inside = np.flatnonzero(path.straight)
    driven = path.points[inside[0] : inside[-1] + 2]
    corners = legs(passage)[1:, 0]
    assert np.linalg.norm(driven[None, :, :2] - corners[:, None], axis=2).min(axis=1).max() < 1e-6
    assert terrain_of(bent_gap(0.75, 0.5), pose(1.6, 3.6)).passages == ()


def test_robot_in_a_way_that_bends_looks_along_the_leg_that_it_stands_in() -> None:
    """A robot after the corner of a right angle."""
    line = np.array([[0.0, 0, 0], [0.5, 0, 0], [1.0, 0, 0], [1.0, 0.5, 0], [1.0, 1.0, 0]])
    rest = rest_from(Passage((1, 2), line), (1.0, 0.4, 0.0), 7)
    assert rest is not None
    assert is_along(rest, math.pi / 2) and not is_along(rest, 0.0)
    assert is_along(Passage((1, 2), line), 0.0) and not is_along(Passage((1, 2), line), math.pi / 4)


@pytest.mark.parametrize(
    "states, at", [(office(17), LOBBY), (office(15), LOBBY), (bent_gap(1.1, 0.8), (1.6, 3.6))], ids=["17", "15", "bend"]
)
def test_robot_that_sees_by_rays_explores_what_lies_behind_narrow_bends(states: np.ndarray, at: tuple[float, float]) -> None:
    journey = explore(states, *at, 0.08, Explorer(), most=30)
    assert journey.decisions[-1].kind is DecisionKind.EXPLORED and not journey.decisions[-1].set_aside
    ground = (states[:, :, BELOW] == OCCUPIED) & (states[:, :, BELOW + 1] == FREE)
    assert journey.known is not None
    assert np.count_nonzero(journey.known[:, :, BELOW][ground] == OCCUPIED) > 0.97 * np.count_nonzero(ground)


def test_rooms_beside_a_corridor_without_any_room_to_turn_are_found_by_looks_from_within() -> None:
    """The robot keeps so much off walls when it turns that none of the corridor is room to turn."""
    states, settings = office(16), TerrainSettings(terrain=TerrainConfig(margin_m=0.07))
    journey = explore(states, *LOBBY, 0.08, Explorer(terrain=settings), most=40)
    assert journey.decisions[-1].kind is DecisionKind.EXPLORED and journey.known is not None
    ground = (states[:, :, BELOW] == OCCUPIED) & (states[:, :, BELOW + 1] == FREE)
    assert np.count_nonzero(journey.known[:, :, BELOW][ground] == OCCUPIED) > 0.93 * np.count_nonzero(ground)


def with_shadow(states: np.ndarray, x: slice, y: slice) -> np.ndarray:
    """The same with floor that nobody has seen."""
    shadowed = states.copy()
    shadowed[x, y] = UNKNOWN
    return shadowed


@pytest.mark.parametrize("x, y", [(slice(58, 61), slice(40, 43)), (slice(80, 83), slice(48, 51))], ids=["before the bend", "behind it"])
def test_floor_that_closes_a_way_is_looked_at_from_near(x: slice, y: slice) -> None:
    """Three columns beside a side of the gap: nothing else is open."""
    states = bent_gap(1.05, 0.5)
    closed = with_shadow(states, x, y)
    terrain, planner, runs = terrain_of(closed, pose(1.6, 3.6)), Explorer(), runs_of(closed)
    assert not terrain.passages and terrain_of(states, pose(1.6, 3.6)).passages
    ((_, unknown),) = ways_if_floor(terrain, planner.terrain_settings)
    assert unknown.size and set(unknown.tolist()) <= set(terrain.frontiers().tolist())
    here, stands = pose(1.6, 3.6), []
    for _ in range(8):
        decision = decide(planner, runs, here)
        if decision.kind is not DecisionKind.GOAL:
            break
        stands.append(decision.goal[:2])
        here = pose(*decision.goal[:2], yaw=decision.goal[3])
    assert decision.kind is DecisionKind.EXPLORED  # it was looked at in vain
    places = terrain.centers(unknown)[:, :2]
    assert min(np.linalg.norm(places - stand, axis=1).min() for stand in stands) < 2.0


def test_rock_is_no_floor_to_look_at() -> None:
    terrain = terrain_of(bent_gap(0.75, 0.5), pose(1.6, 3.6))
    assert ways_if_floor(terrain, Explorer().terrain_settings) == []


def test_robot_that_can_turn_beside_a_door_only_departs_from_there() -> None:
    """Of the corridor the place before the door is all that is room to turn; the room behind the door is nearer than the lobby."""
    closed = with_shadow(office(16), slice(80, 92), slice(78, 81))
    settings = TerrainSettings(terrain=TerrainConfig(margin_m=0.045))
    terrain = navigable_terrain(runs_of(closed), pose(6.9, 5.72), settings, None)
    assert not terrain.is_inside and terrain.departure == terrain.start
    assert terrain.reached[terrain.surface_near((*LOBBY, 0.04))]
    path = way(terrain, *LOBBY)
    assert path is not None and path.straight.any()
