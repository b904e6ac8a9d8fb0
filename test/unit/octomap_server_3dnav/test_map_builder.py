"""From placed sweeps to the octree: insertion, the plane at the start, moved vertices, lost sweeps, beams that met nothing.

A map that follows moved vertices is compared, bit by bit, with one that was given the moved poses from the start.
"""

import math

import numpy as np
import pytest

from octomap_server_3dnav.navigation.local_grid import FREE, project
from octomap_server_3dnav.octree.column_runs import ColumnRuns, VoxelState
from octomap_server_3dnav.octree.map_builder import Beams, MapBuilder, MapConfig
from octomap_server_3dnav.octree.octree import OctreeMap, SensorModel
from octomap_server_3dnav.terrain.classify import TerrainConfig, classify
from rigid_geometry import transform_from_rpy
from robot_body import RobotBody

SENSOR = (0.2, 0.0, 0.75)
NOTHING = np.zeros((0, 3), np.float32)


def wall(x: float = 3.0, free_ends: np.ndarray = NOTHING) -> Beams:
    """Beams from the laser to a wall across the x axis of base_link."""
    y, z = (v.ravel() for v in np.meshgrid(np.arange(-1.0, 1.0, 0.04), np.arange(0.2, 1.2, 0.04)))
    points = np.column_stack([np.full(y.size, x), y, z]).astype(np.float32)
    origins = np.tile(np.float32(SENSOR), (y.size, 1))
    return Beams(points, origins, free_ends, np.tile(np.float32(SENSOR), (len(free_ends), 1)))


def pose(x: float = 0.0, yaw: float = 0.0) -> np.ndarray:
    return transform_from_rpy((x, 0.0, 0.132), (0.0, 0.0, yaw))


def builder() -> MapBuilder:
    return MapBuilder(MapConfig(), SensorModel(), RobotBody())


def state(built: MapBuilder, *xyz: float) -> VoxelState:
    return VoxelState(int(built.tree.states_at([xyz])[0]))


def test_sweep_makes_the_wall_occupied_the_way_to_it_free_and_the_ground_at_the_start_known():
    built = builder()
    assert not built.add_sweep(wall(), 0, [pose()])
    assert state(built, 3.0, 0.0, 0.832) is VoxelState.OCCUPIED
    assert state(built, 1.5, 0.0, 0.882) is VoxelState.FREE
    assert state(built, 0.4, 0.3, -0.02) is VoxelState.OCCUPIED


def test_beam_that_met_nothing_frees_its_way_and_occupies_nothing():
    down_a_hole = np.array([[6.0, 0.0, -6.0]], np.float32)
    built = builder()
    built.add_sweep(wall(free_ends=down_a_hole), 0, [pose()])
    halfway = (np.array(SENSOR) + (down_a_hole[0] - SENSOR) * 0.3 + [0, 0, 0.132]).tolist()
    assert state(built, *halfway) is VoxelState.FREE
    at_its_end = (down_a_hole[0] + [0.1, 0, 0.032]).tolist()
    assert state(built, *at_its_end) is VoxelState.UNKNOWN, "nobody knows what sends no echo from farther off"
    centers, _ = built.tree.occupied_voxels()
    assert centers[:, 2].min() > -0.1


def test_moved_vertices_build_the_same_tree_as_from_scratch():
    moved, fresh = builder(), builder()
    moved.add_sweep(wall(), 0, [pose()])
    assert moved.add_sweep(wall(2.0), 1, [pose(0.3), pose(0.5, 0.4)])
    fresh.add_sweep(wall(), 0, [pose(0.3)])
    fresh.add_sweep(wall(2.0), 1, [pose(0.3), pose(0.5, 0.4)])
    assert moved.tree.to_full() == fresh.tree.to_full()


def test_heights_follow_moved_vertices():
    built = builder()
    built.add_sweep(wall(), 0, [pose()])
    before, after = (np.array([[math.floor(x / 0.08)], [0], [10]]) for x in (3.0, 3.3))
    assert not np.isnan(built.heights.at(*before)).all() and np.isnan(built.heights.at(*after)).all()
    built.add_sweep(wall(1.0), 1, [pose(0.3), pose(0.5)])
    built.runs_around(pose(0.5), 5.0)
    assert np.isnan(built.heights.at(*before)).all() and not np.isnan(built.heights.at(*after)).all()


def random_beams(rng: np.random.Generator) -> Beams:
    """A few hundred beams all around, to anything, some of them to nothing."""
    ends = (rng.normal(size=(400, 3)) * [3.0, 3.0, 0.7]).astype(np.float32)
    origins = np.tile(np.float32(SENSOR), (400, 1))
    return Beams(ends[:300], origins[:300], ends[300:], origins[300:])


def random_pose(rng: np.random.Generator, spread_m: float = 6.0) -> np.ndarray:
    x, y = rng.uniform(-spread_m, spread_m, 2)
    return transform_from_rpy((x, y, 0.132 + rng.uniform(-0.5, 0.5)), (*rng.uniform(-0.2, 0.2, 2), rng.uniform(-3, 3)))


def from_scratch(beams: list[Beams], poses: np.ndarray) -> MapBuilder:
    built = builder()
    for i, sweep in enumerate(beams):
        built.add_sweep(sweep, i, poses[: i + 1])
    return built


def same_runs(a: ColumnRuns, b: ColumnRuns) -> bool:
    same_block = (a.origin_key, a.nx, a.ny) == (b.origin_key, b.nx, b.ny)
    return same_block and all(np.array_equal(getattr(a, name), getattr(b, name)) for name in ("start", "z_lo", "z_hi", "occupied"))


def same_heights(a: MapBuilder, b: MapBuilder, runs: ColumnRuns | None = None) -> bool:
    """At the tops of the runs, or of all."""
    runs = runs or b.tree.column_runs()
    x, y = np.divmod(runs.columns, runs.ny)
    tops = x + runs.origin_key[0], y + runs.origin_key[1], runs.z_hi
    return np.array_equal(a.heights.at(*tops), b.heights.at(*tops), equal_nan=True)


@pytest.mark.parametrize("seed", range(8))
def test_whatever_moves_the_map_is_the_one_from_scratch_bit_by_bit(seed):
    rng = np.random.default_rng(seed)
    built, beams, poses = builder(), [], np.zeros((0, 4, 4))
    for step in range(12):
        poses = np.concatenate([poses, [random_pose(rng)]])
        beams.append(random_beams(rng))
        for vertex in np.flatnonzero(rng.random(step) < rng.choice([0.0, 0.2, 1.0])):
            poses[vertex] = random_pose(rng)
        built.add_sweep(beams[-1], step, poses)
        if rng.random() < 0.5:
            built.runs_around(poses[-1], 1.0)
        if rng.random() < 0.4:
            scratch = from_scratch(beams, poses)
            assert built.tree.to_full() == scratch.tree.to_full()
            assert same_runs(built.tree.column_runs(), scratch.tree.column_runs())
            assert built.tree.memory_bytes == scratch.tree.memory_bytes
            assert same_heights(built, scratch)


@pytest.mark.parametrize("seed", range(4))
def test_surroundings_are_up_to_date_before_the_rest_is(seed, monkeypatch):
    rng = np.random.default_rng(seed)
    poses = np.array([random_pose(rng, spread_m=25.0) for _ in range(20)])
    beams = [random_beams(rng) for _ in poses]
    built = from_scratch(beams[:-1], poses[:-1])
    poses[1:-1, :2, 3] += rng.uniform(0.1, 2.0, (18, 2))
    assert built.add_sweep(beams[-1], 19, poses)
    traced = []
    trace = OctreeMap.trace_sweep
    monkeypatch.setattr(OctreeMap, "trace_sweep", lambda *args: traced.append(1) or trace(*args))
    local = built.runs_around(poses[-1], 2.0)
    assert len(traced) < 18
    monkeypatch.undo()
    scratch = from_scratch(beams, poses)
    assert same_runs(local, scratch.runs_around(poses[-1], 2.0))
    assert same_heights(built, scratch, local)
    assert built.tree.to_full() == scratch.tree.to_full()


def test_only_what_moved_is_traced_anew_and_only_once(monkeypatch):
    rng = np.random.default_rng(0)
    poses = np.array([random_pose(rng) for _ in range(6)])
    beams = [random_beams(rng) for _ in poses]
    built = from_scratch(beams[:5], poses[:5])
    traced = []
    trace = OctreeMap.trace_sweep
    monkeypatch.setattr(OctreeMap, "trace_sweep", lambda *args: traced.append(1) or trace(*args))
    poses[[1, 3]] = random_pose(rng), random_pose(rng)
    built.add_sweep(beams[5], 5, poses)
    built.runs_around(poses[-1], None)
    assert built.tree is built.tree and len(traced) == 3


def test_vertex_that_moved_back_before_anyone_looked_is_left_where_it_is(monkeypatch):
    built = builder()
    built.add_sweep(wall(), 0, [pose()])
    built.add_sweep(wall(), 1, [pose(1.0), pose(0.2)])
    traced = []
    monkeypatch.setattr(OctreeMap, "redraw", lambda *args: traced.append(1))
    assert not built.add_sweep(wall(), 2, [pose(), pose(0.2), pose(0.4)])
    assert built.tree.leaf_count and not traced


def test_plane_at_the_start_moves_with_the_first_sweep():
    built = builder()
    built.add_sweep(wall(), 0, [pose()])
    built.add_sweep(wall(), 1, [pose(10.0), pose(10.2)])
    assert state(built, 0.0, 0.0, -0.02) is VoxelState.UNKNOWN
    assert state(built, 10.0, 0.0, -0.02) is VoxelState.OCCUPIED


def on_a_slope(roll_rad: float, pitch_rad: float, blind_m: float = 0.7) -> tuple[Beams, np.ndarray]:
    """A sweep of a plane by a robot that stands on it, and its pose; it sees nothing within `blind_m`, where the laser is blind."""
    T_map_base = transform_from_rpy((0.0, 0.0, 0.0), (roll_rad, pitch_rad, 0.0)) @ transform_from_rpy((0.0, 0.0, 0.132))
    x, y = (v.ravel() for v in np.meshgrid(*[np.arange(-4.0, 4.0, 0.03)] * 2))
    seen = np.hypot(x, y) > blind_m
    points = np.column_stack([x[seen], y[seen], np.full(seen.sum(), -0.132)]).astype(np.float32)
    return Beams(points, np.tile(np.float32(SENSOR), (len(points), 1)), NOTHING, NOTHING), T_map_base


@pytest.mark.parametrize("roll_deg, pitch_deg", [(0, 0), (18, 0), (0, 18), (0, -18), (-12, 13)])
def test_robot_that_starts_on_a_slope_has_ground_around_it_and_nothing_in_its_way(roll_deg, pitch_deg):
    built = builder()
    beams, T_map_base = on_a_slope(math.radians(roll_deg), math.radians(pitch_deg))
    built.add_sweep(beams, 0, [T_map_base])
    terrain = classify(built.runs_around(T_map_base, 4.0), T_map_base, TerrainConfig(), RobotBody(), 2.0, built.heights)
    grid = project(terrain, (0.0, 0.0), 3.2)
    assert (grid.cost == FREE).all() and np.isinf(grid.distance).all()
    assert terrain.departure is not None and terrain.departure == terrain.start


@pytest.mark.parametrize(("blind_m", "reaches"), [(0.7, True), (1.35, True), (1.9, True), (2.6, False)])
def test_ground_is_put_around_the_robot_as_far_as_its_first_sweep_shows_none(blind_m, reaches):
    built = builder()
    beams, T_map_base = on_a_slope(0.0, 0.0, blind_m)
    built.add_sweep(beams, 0, [T_map_base])
    terrain = classify(built.runs_around(T_map_base, 4.0), T_map_base, TerrainConfig(), RobotBody(), 3.0, built.heights)
    assert (project(terrain, (0.0, 0.0), 4.4).cost == FREE).all() == reaches


def test_where_the_first_sweep_shows_no_ground_at_all_it_is_put_under_the_robot_only():
    built = builder()
    built.add_sweep(wall(), 0, [pose()])
    assert state(built, 0.7, 0.0, -0.02) is VoxelState.OCCUPIED
    assert state(built, 1.2, 0.0, -0.02) is VoxelState.UNKNOWN


def test_nothing_is_put_under_a_robot_that_lies_on_its_side():
    built = builder()
    built.add_sweep(wall(), 0, [transform_from_rpy((0.0, 0.0, 0.4), (1.4, 0.0, 0.0))])
    assert built.tree.occupied_voxels()[0][:, 0].min() > 2.5


def test_vertices_that_moved_less_than_a_centimetre_leave_the_tree_as_it_is():
    built = builder()
    built.add_sweep(wall(), 0, [pose()])
    assert not built.add_sweep(wall(), 1, [pose(0.009), pose(0.2)])
    assert built.add_sweep(wall(), 2, [pose(0.011), pose(0.2), pose(0.4)])


def test_vertices_that_only_turned_are_drawn_anew_beyond_a_centimetre_at_four_metres():
    built = builder()
    built.add_sweep(wall(), 0, [pose()])
    assert not built.add_sweep(wall(), 1, [pose(yaw=0.0024), pose(0.2)])
    assert built.add_sweep(wall(), 2, [pose(yaw=0.0026), pose(0.2), pose(0.4)])
    turned, fresh = builder(), builder()
    turned.add_sweep(wall(), 0, [pose()])
    turned.add_sweep(wall(), 1, [pose(yaw=0.05), pose(0.2)])
    fresh.add_sweep(wall(), 0, [pose(yaw=0.05)])
    fresh.add_sweep(wall(), 1, [pose(yaw=0.05), pose(0.2)])
    assert turned.tree.to_full() == fresh.tree.to_full()


def test_lost_sweep_is_no_trouble_for_the_next():
    built = builder()
    built.add_sweep(wall(), 0, [pose()])
    built.add_sweep(wall(3.6), 2, [pose(), pose(0.2), pose(0.4)])
    assert len(built) == 2 and state(built, 4.0, 0.0, 0.832) is VoxelState.OCCUPIED


@pytest.mark.parametrize("vertex_id", [0, 1, -1])
def test_repeated_or_unplaced_sweep_is_refused_and_changes_nothing(vertex_id):
    built = builder()
    built.add_sweep(wall(), 0, [pose()])
    before = built.tree.to_full()
    with pytest.raises(ValueError, match="sweep of vertex"):
        built.add_sweep(wall(), vertex_id, [pose()])
    assert built.tree.to_full() == before and len(built) == 1


BOX = ((2.5, -0.4, 0.0), (3.5, 0.4, 1.6))


def test_cleared_box_is_what_octomap_server_makes_of_it():
    built = builder()
    built.add_sweep(wall(), 0, [pose()])
    built.add_sweep(wall(), 1, [pose(), pose(0.02)])
    built.clear_box(*BOX)
    assert state(built, 3.0, 0.0, 0.832) is VoxelState.FREE and state(built, 3.0, 0.9, 0.832) is VoxelState.OCCUPIED
    assert state(built, 3.3, 0.0, 0.832) is VoxelState.UNKNOWN


def test_cleared_box_stays_cleared_when_the_graph_moves_and_counts_what_is_seen_later():
    built = builder()
    built.add_sweep(wall(), 0, [pose()])
    built.clear_box(*BOX)
    built.add_sweep(Beams(NOTHING, NOTHING, NOTHING, NOTHING), 1, [pose(0.0, 0.02), pose()])  # the first sweep is drawn anew
    assert state(built, 3.0, 0.0, 0.832) is VoxelState.FREE and state(built, 3.0, -0.9, 0.832) is VoxelState.OCCUPIED
    for k in range(6):
        built.add_sweep(wall(), 2 + k, [pose(0.0, 0.02), *[pose()] * (2 + k)])
    assert state(built, 3.0, 0.0, 0.832) is VoxelState.OCCUPIED


def test_clearing_an_empty_map_or_no_box_is_no_harm():
    built = builder()
    built.clear_box(*BOX)
    assert built.tree.node_count == 0
    with pytest.raises(ValueError, match="lo <= hi"):
        built.clear_box(BOX[1], BOX[0])
    with pytest.raises(ValueError, match="miss is 0.5"):
        MapBuilder(MapConfig(), SensorModel(miss=0.5), RobotBody()).clear_box(*BOX)


def test_map_under_another_sensor_model_and_range_is_as_if_it_had_always_been_so():
    rng = np.random.default_rng(7)
    beams, poses = [random_beams(rng) for _ in range(4)], np.array([random_pose(rng) for _ in range(4)])
    tuned = MapConfig(max_range_m=4.0), SensorModel(hit=0.6, miss=0.4, min=0.2)
    built, fresh = from_scratch(beams[:2], poses[:2]), MapBuilder(*tuned, RobotBody())
    built.configure(*tuned)
    for i, sweep in enumerate(beams):
        fresh.add_sweep(sweep, i, poses[: i + 1])
    for i in (2, 3):
        built.add_sweep(beams[i], i, poses[: i + 1])
    assert built.tree.to_full() == fresh.tree.to_full() != from_scratch(beams, poses).tree.to_full()
    assert same_heights(built, fresh)


def test_box_that_was_cleared_stays_so_under_another_sensor_model():
    built = builder()
    built.add_sweep(wall(), 0, [pose()])
    built.clear_box((2.5, -1.0, 0.0), (3.5, 1.0, 2.0))
    built.configure(MapConfig(), SensorModel(hit=0.8))
    assert state(built, 3.0, 0.0, 0.832) is VoxelState.FREE


def test_map_of_clouds_keeps_what_it_has_and_counts_the_next_by_the_new_model():
    points = np.array([[2.0, 0.0, 0.5]], np.float32)
    built, origins = builder(), np.array([[0.0, 0.0, 0.5]], np.float32)
    built.add_cloud(points, origins, None)
    before = built.tree.to_full()
    built.configure(MapConfig(), SensorModel(miss=0.05, min=0.01))
    assert built.tree.to_full() == before
    built.add_cloud(points + np.float32([1.0, 0.0, 0.0]), origins, None)
    assert state(built, 2.0, 0.0, 0.5) is VoxelState.FREE
    same = builder()
    same.add_cloud(points, origins, None)
    same.add_cloud(points + np.float32([1.0, 0.0, 0.0]), origins, None)
    assert state(same, 2.0, 0.0, 0.5) is VoxelState.OCCUPIED


def test_configuration_that_is_none_is_refused_and_changes_nothing():
    built = builder()
    built.add_sweep(wall(), 0, [pose()])
    before = built.tree.to_full()
    with pytest.raises(ValueError, match="max_range_m"):
        built.configure(MapConfig(max_range_m=-1.0), SensorModel(hit=0.6))
    built.configure(MapConfig(), SensorModel())
    assert built.tree.to_full() == before and built.config == MapConfig()
