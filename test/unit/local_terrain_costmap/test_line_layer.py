"""Lines at any tilt on the costmap: what stands in the way is marked, ground and what hangs high is not, and beams take marks back."""

import math

import numpy as np
import pytest
from costs import cost_at

from local_terrain_costmap import FREE, LETHAL, NO_INFORMATION, CostmapConfig, LocalCostmap
from local_terrain_costmap.line_layer import _pass
from robot_body import RobotBody

SENSOR = np.array([0.02, 0.02, 0.92])
NOTHING = np.empty((0, 3))
FAR_M = 12.0
CELL = 0.08
BEAMS = np.radians(np.arange(-60.0, 60.01, 0.25))
HALF_PERIOD_S, LINE_S = 2.75, 0.025
Box = tuple[tuple[float, float, float], tuple[float, float, float]]


def level_ground(half_m: float = 3.0, height: float = 0.0) -> tuple[np.ndarray, tuple[float, float], float, np.ndarray]:
    """Terrain of known ground around the origin; its height is the top of the ground's voxel, as the classifier gives it."""
    n = round(2 * half_m / CELL)
    return np.zeros((n, n)), (-half_m, -half_m), CELL, np.full((n, n), height + CELL / 2, np.float32)


def on(terrain: tuple | None = None, **changes: float) -> LocalCostmap:
    """A costmap on level ground, or another terrain, without inflation that would hide single marks."""
    costmap = LocalCostmap(CostmapConfig(**changes), RobotBody())
    costmap.set_terrain(*(level_ground() if terrain is None else terrain))
    return costmap


def marks(costmap: LocalCostmap) -> set[tuple[float, float]]:
    """Middles of the lethal cells, in whole centimetres."""
    view = costmap.master()
    rows, columns = np.nonzero(view.cost == LETHAL)
    return {
        (round(100 * (view.origin_xy[0] + (c + 0.5) * CELL)), round(100 * (view.origin_xy[1] + (r + 0.5) * CELL)))
        for r, c in zip(rows, columns, strict=True)
    }


def is_marked(costmap: LocalCostmap, x: float, y: float) -> bool:
    return cost_at(costmap.master(), x, y) == LETHAL


def line(tilt: float, boxes: tuple[Box, ...] = (), floor: float = 0.0, noise: np.random.Generator | None = None) -> tuple:
    """Hits and free ends of the line of a laser that is tilted down by `tilt`, over a floor with boxes on it or above."""
    c, s = math.cos(tilt), math.sin(tilt)
    ways = np.stack([c * np.cos(BEAMS), np.sin(BEAMS), -s * np.cos(BEAMS)], axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = np.where(ways[:, 2] < 0, (floor - SENSOR[2]) / ways[:, 2], np.inf)
        for low, high in boxes:
            entry, leave = np.sort([(np.array(side) - SENSOR) / ways for side in (low, high)], axis=0)
            into, out = entry.max(axis=1), leave.min(axis=1)
            ranges = np.where((into < out) & (into > 0), np.minimum(ranges, into), ranges)
    hit = ranges < FAR_M
    if noise is not None:
        ranges = ranges + noise.normal(0.0, 0.01, len(ranges))
    return SENSOR + ranges[hit, None] * ways[hit], SENSOR + FAR_M * ways[~hit]


def nod(costmap: LocalCostmap, begin_s: float, *boxes: Box, up: bool = True, **world: object) -> float:
    """A half-period of the mount, from 70 degrees down to 35 up or back; when it is over."""
    tilts = np.radians(np.linspace(70.0, -35.0, round(HALF_PERIOD_S / LINE_S)))
    for k, tilt in enumerate(tilts if up else tilts[::-1]):
        costmap.add_line(begin_s + k * LINE_S, *line(float(tilt), boxes, **world), SENSOR)
    return begin_s + HALF_PERIOD_S


LOW: Box = ((1.2, -0.3, 0.0), (1.8, 0.3, 0.2))
CRATE: Box = ((1.9, -0.15, 0.0), (2.2, 0.15, 0.3))
TABLE: Box = ((1.5, -0.5, 0.70), (2.0, 0.5, 0.74))
KERB: Box = ((1.6, -1.0, 0.0), (2.5, 1.0, 0.22))
LINTEL: Box = ((1.5, -1.0, 1.3), (1.7, 1.0, 1.6))


@pytest.mark.parametrize("up", [True, False])
@pytest.mark.parametrize("box", [CRATE, TABLE, KERB], ids=["crate", "table", "kerb"])
def test_what_stands_in_the_way_is_marked_in_one_pass_of_the_mount_and_stays(box: Box, up: bool) -> None:
    costmap = on()
    end_s = nod(costmap, 1.0, box, up=up)
    assert is_marked(costmap, box[0][0] + 0.005, 0.02)
    nod(costmap, end_s, box, up=not up)
    assert is_marked(costmap, box[0][0] + 0.005, 0.02)


def test_floor_and_what_the_robot_passes_under_are_not_marked() -> None:
    costmap, rng = on(), np.random.default_rng(3)
    begin_s = 1.0
    for up in (True, False, True):
        begin_s = nod(costmap, begin_s, LINTEL, up=up, noise=rng)
    assert not marks(costmap)


def test_level_line_marks_what_it_meets_and_clears_what_it_passes() -> None:
    wall: Box = ((2.0, -1.0, 0.0), (2.2, 1.0, 2.0))
    costmap = on()
    costmap.add_line(1.0, *line(0.0, (wall,)), SENSOR)
    assert is_marked(costmap, 2.02, 0.02) and is_marked(costmap, 2.02, 0.5)
    costmap.add_line(3.0, *line(0.0), SENSOR)
    assert not marks(costmap)


def test_beams_over_a_crate_leave_its_mark_and_those_through_its_place_take_it_back() -> None:
    costmap = on()
    end_s = nod(costmap, 1.0, CRATE)
    for k in range(40):
        costmap.add_line(end_s + k * LINE_S, *line(0.0, (CRATE,)), SENSOR)
    assert is_marked(costmap, 1.92, 0.02)
    nod(costmap, end_s + 1.0)
    assert not marks(costmap)


def test_mark_that_no_beam_meets_stays_between_two_passes_and_is_forgotten_at_last() -> None:
    """Beams that look over it neither meet it nor pass through its place."""
    costmap = on(keep_s=10.0)
    nod(costmap, 1.0, CRATE)
    costmap.add_line(9.0, *line(-0.3), SENSOR)
    assert is_marked(costmap, 1.92, 0.02)
    costmap.add_line(20.0, *line(-0.3), SENSOR)
    assert not marks(costmap)


@pytest.mark.parametrize("box", [LOW, CRATE], ids=["low", "crate"])
def test_box_that_beams_pass_just_over_on_each_nod_down_stands_at_its_place_all_the_same(box: Box) -> None:
    """They take the evidence in the voxel of its top back, and the next line meets it there again."""
    costmap, begin_s, met = on(), 1.0, 0
    for k in range(6):
        tilts = np.radians(np.linspace(70.0, -35.0, round(HALF_PERIOD_S / LINE_S)))
        for j, tilt in enumerate(tilts if k % 2 else tilts[::-1]):
            costmap.add_line(begin_s + j * LINE_S, *line(float(tilt), (box,)), SENSOR)
            if k >= 4:
                met += len(costmap.strangers(1.3)) > 0
                assert not len(costmap.strangers(1.3, 5.0))
        begin_s += HALF_PERIOD_S
    assert met > 50


@pytest.mark.parametrize("count, marked", [(1, False), (2, True)])
def test_point_without_company_marks_nothing(count: int, marked: bool) -> None:
    costmap = on()
    costmap.add_line(1.0, [[1.02, 0.02 + 0.01 * k, 0.5] for k in range(count)], NOTHING, SENSOR)
    assert is_marked(costmap, 1.02, 0.02) is marked


@pytest.mark.parametrize(
    "above_m, marked", [(-0.3, True), (-0.1, False), (0.0, False), (0.1, False), (0.2, True), (1.1, True), (1.3, False)]
)
def test_marks_by_the_height_over_the_known_ground(above_m: float, marked: bool) -> None:
    costmap = on(level_ground(height=2.0))
    costmap.add_line(1.0, [[1.02, 0.02, 2.0 + above_m], [1.02, 0.03, 2.0 + above_m]], NOTHING, SENSOR + [0, 0, 2.0])
    assert is_marked(costmap, 1.02, 0.02) is marked


SEEN = [((0.2, 0.3), True), ((0.2, 0.15), False), ((0.2, -0.4), True), ((0.2, -0.15), False), ((1.0, 0.3), False), ((1.0, -0.5), False)]


@pytest.mark.parametrize("beyond, marked", SEEN)
def test_beyond_the_known_ground_only_what_no_slope_explains_is_marked_and_far_beyond_nothing(
    beyond: tuple[float, float], marked: bool
) -> None:
    costmap, (away_m, above_m) = on(level_ground(half_m=1.2)), beyond
    hit = [1.2 + away_m, 0.02, above_m]
    costmap.add_line(1.0, [hit, hit], NOTHING, SENSOR)
    assert is_marked(costmap, *hit[:2]) is marked


def test_without_any_known_ground_nothing_is_marked_until_there_is_some() -> None:
    costmap = LocalCostmap(CostmapConfig(), RobotBody())
    nod(costmap, 1.0, CRATE)
    assert (costmap.master().cost == NO_INFORMATION).all()
    costmap.set_terrain(*level_ground())
    assert is_marked(costmap, 1.92, 0.02)


def test_newer_terrain_that_knows_a_ramp_takes_its_marks_back() -> None:
    costmap = on()
    costmap.add_line(1.0, [[1.02, 0.02, 0.5], [1.02, 0.03, 0.5]], NOTHING, SENSOR)
    assert is_marked(costmap, 1.02, 0.02)
    costmap.set_terrain(*level_ground(height=0.5))
    assert not marks(costmap)


def test_marks_stay_on_their_ground_while_the_window_moves() -> None:
    costmap = on()
    nod(costmap, 1.0, CRATE)
    before = marks(costmap)
    for x, y in ((0.5, 0.0), (0.5, -0.7), (-0.4, 0.3), (0.0, 0.0)):
        costmap.recenter(x, y)
        assert before and marks(costmap) == before


def test_robot_s_height_and_step_decide() -> None:
    for height, marked in ((1.0, True), (0.4, False)):
        costmap = LocalCostmap(CostmapConfig(), RobotBody(height_m=height))
        costmap.set_terrain(*level_ground())
        nod(costmap, 1.0, TABLE)
        assert is_marked(costmap, 1.505, 0.02) is marked


def test_late_line_is_left_out_and_time_that_jumps_back_starts_afresh() -> None:
    costmap, hit = on(), [[1.02, 0.02, 0.5], [1.02, 0.03, 0.5]]
    costmap.add_line(50.0, NOTHING, NOTHING, SENSOR)
    costmap.add_line(49.9, hit, NOTHING, SENSOR)
    assert not marks(costmap)
    costmap.add_line(50.1, hit, NOTHING, SENSOR)
    costmap.add_line(3.0, NOTHING, NOTHING, SENSOR)
    assert not marks(costmap)
    costmap.add_line(3.1, hit, NOTHING, SENSOR)
    assert is_marked(costmap, 1.02, 0.02)


def test_line_whose_tilt_or_ranges_are_not_known_changes_nothing_and_half_a_line_does_its_half() -> None:
    costmap = on()
    before = costmap.master()
    costmap.add_line(1.0, np.full((40, 3), math.nan), np.full((9, 3), math.nan), SENSOR)
    assert costmap.master() is before
    hits = np.array([[1.02, 0.02, 0.5], [1.02, 0.03, 0.5], [math.nan, 0.5, 0.5], [1.02, math.inf, 0.5]])
    costmap.add_line(2.0, hits, NOTHING, SENSOR)
    assert marks(costmap) == {(100, 4)}


@pytest.mark.parametrize(
    "stamp, hits, origin",
    [
        (math.nan, NOTHING, SENSOR),
        (1.0, np.zeros((3, 2)), SENSOR),
        (1.0, NOTHING, np.zeros(2)),
        (1.0, NOTHING, np.array([0.0, math.nan, 0.0])),
    ],
)
def test_bad_line_is_refused_with_what_was_expected(stamp: float, hits: np.ndarray, origin: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"not|\(N, 3\)"):
        on().add_line(stamp, hits, NOTHING, origin)


def test_beam_passes_the_voxels_that_dense_sampling_finds() -> None:
    rng = np.random.default_rng(3)
    for _ in range(40):
        start, end = rng.uniform(0.3, 2.7, 3), rng.uniform(-0.5, 3.5, 3)
        met = np.zeros((60, 30, 30))
        _pass(met, end[None], start, np.zeros(3), 0.1, (1.5, 0.0))
        length = float(np.linalg.norm(end - start))
        points = start + np.outer(np.arange(0.0, min(length, 1.5), 1e-4) / length, end - start)
        cells = {tuple(c) for c in np.floor(points / 0.1).astype(int)} - {tuple(np.floor(end / 0.1).astype(int))}
        expected = {(z % 60, y, x) for x, y, z in cells if 0 <= x < 30 and 0 <= y < 30}
        found = {tuple(int(i) for i in c) for c in np.argwhere(np.isinf(met))}
        assert expected <= found and len(found - expected) <= 2


def test_free_beams_make_no_ground_known() -> None:
    costmap = LocalCostmap(CostmapConfig(), RobotBody())
    costmap.add_line(1.0, NOTHING, [[2.0, 0.0, 0.0]], SENSOR)
    assert (costmap.master().cost == NO_INFORMATION).all()
    assert FREE not in costmap.master().cost


def test_wall_that_the_terrain_knows_grows_no_thicker_where_lines_err_by_a_cell_but_a_crate_before_it_is_marked() -> None:
    cost, corner, resolution, height = level_ground()
    cost[:, 62:], height[:, 62:] = 100, np.nan  # from the cell at 1.92 m on
    costmap = on((cost, corner, resolution, height))
    wall: Box = ((1.86, -2.0, 0.0), (2.2, 2.0, 2.0))
    before = marks(costmap)
    nod(costmap, 1.0, wall)
    assert marks(costmap) == before
    nod(costmap, 9.0, wall, ((1.62, -0.15, 0.0), (1.86, 0.15, 0.3)))
    assert is_marked(costmap, 1.63, 0.02)
