"""Classification against truth in hand-made worlds; voxels are the truth's own cells of 0.1 m, so that areas are those on paper."""

import math

import numpy as np
import pytest
from hand_made_worlds import Mesh, box, join, plate, ramp, room, wall

from exploration_evaluation import RobotShape, reachable_ground
from exploration_evaluation.classification import Classification, ClassificationConfig, classification
from exploration_evaluation.true_classes import BARRIERS, TRUE_CLASSES, true_classes

TRAVERSABLE, OBSTACLE, CLIFF, INFLATION, FRONTIER = range(5)
START = (2.0, 2.0, 0.132)
ROBOT = RobotShape(circumscribed_radius_m=0.6)  # so that areas are whole cells
CONFIG = ClassificationConfig(horizontal_m=0.05, vertical_m=0.12, edge_m=0.1, voxel_m=0.1)
PLACES = 28 * 28 * 0.01  # of the centre in a room of 4 x 4 m
EDGE = (30 * 30 - 28 * 28) * 0.01  # one cell around them


def floor(x1: float = 4.0, y1: float = 4.0, x0: float = 0.0, z: float = 0.0) -> np.ndarray:
    x, y = np.meshgrid(np.arange(round((x1 - x0) * 10)) * 0.1 + x0 + 0.05, np.arange(round(y1 * 10)) * 0.1 + 0.05)
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z)])


def centre_may_be(voxels: np.ndarray, width: float = 4.0, depth: float = 4.0) -> np.ndarray:
    return (voxels[:, :2] > 0.6).all(axis=1) & (voxels[:, 0] < width - 0.6) & (voxels[:, 1] < depth - 0.6)


def judged(mesh: Mesh, voxels: np.ndarray, labels: np.ndarray) -> Classification:
    return classification(true_classes(*mesh, reachable_ground(*mesh, START, ROBOT), ROBOT), voxels, labels, CONFIG)


def nothing_but(causes: dict[str, float], **expected: float) -> None:
    named = {cause.replace("_", " "): area for cause, area in expected.items()}
    assert causes == pytest.approx({cause: named.get(cause, 0.0) for cause in causes}, abs=1e-9)
    assert set(named) <= set(causes)


def test_right_labels_are_neither_falsely_safe_nor_falsely_unsafe() -> None:
    voxels = floor()
    found = judged(room(4, 4), voxels, np.where(centre_may_be(voxels), TRAVERSABLE, INFLATION))
    assert (found.false_safe_m2, found.false_unsafe_m2) == (0.0, 0.0)
    assert found.confusion_m2["drivable"]["traversable"] == pytest.approx(PLACES)
    assert found.confusion_m2["cliff"] == pytest.approx(dict.fromkeys(found.confusion_m2["cliff"], 0.0))


def test_map_without_voxels_is_unmapped_and_nothing_of_it_false() -> None:
    found = judged(room(4, 4), np.zeros((0, 3)), np.zeros(0, np.uint8))
    assert (found.false_safe_m2, found.false_unsafe_m2) == (0.0, 0.0)
    row = found.confusion_m2["drivable"]
    assert row["unmapped"] == sum(row.values()) > PLACES


def test_floor_labelled_safe_up_to_the_walls_is_falsely_safe_but_for_the_places() -> None:
    voxels = floor()
    found = judged(room(4, 4), voxels, np.full(len(voxels), TRAVERSABLE))
    nothing_but(found.false_safe_by_cause, obstacle=16.0 - PLACES - EDGE, edge=EDGE)
    assert found.false_safe_m2 == pytest.approx(16.0 - PLACES)
    assert found.false_unsafe_m2 == 0.0


def test_plateau_labelled_safe_up_to_its_edge_is_falsely_safe_because_of_the_cliff() -> None:
    voxels = floor()
    found = judged(plate(0, 0, 4, 4), voxels, np.full(len(voxels), TRAVERSABLE))
    nothing_but(found.false_safe_by_cause, cliff=16.0 - PLACES - EDGE, edge=EDGE)


def test_edge_of_a_plateau_is_the_row_of_cliffs() -> None:
    voxels = floor()
    border = ((voxels[:, :2] < 0.1) | (voxels[:, :2] > 3.9)).any(axis=1)
    labels = np.where(centre_may_be(voxels), TRAVERSABLE, np.where(border, CLIFF, INFLATION))
    found = judged(plate(0, 0, 4, 4), voxels, labels)
    # Of each side the cells within 0.7 m of a place: 28 across from places, and 3 more at either end.
    nothing_but(found.confusion_m2["cliff"], cliff=4 * 34 * 0.01)
    assert found.confusion_m2["obstacle"] == pytest.approx(dict.fromkeys(found.confusion_m2["obstacle"], 0.0))


def test_walls_are_the_row_of_obstacles_one_cell_wide() -> None:
    found = judged(room(4, 4), np.zeros((0, 3)), np.zeros(0, np.uint8))
    solid = join(plate(-1, -1, 5, 5), *(box(low, high) for low, high in WALLS))
    thick = judged(solid, np.zeros((0, 3)), np.zeros(0, np.uint8))
    assert sum(found.confusion_m2["obstacle"].values()) == pytest.approx(4 * 34 * 0.01)
    assert sum(thick.confusion_m2["obstacle"].values()) == pytest.approx(4 * 34 * 0.01)


WALLS = (
    ((-0.3, -0.3, 0), (0.0, 4.3, 2.0)),
    ((4.0, -0.3, 0), (4.3, 4.3, 2.0)),
    ((0.0, -0.3, 0), (4.0, 0.0, 2.0)),
    ((0.0, 4.0, 0), (4.0, 4.3, 2.0)),
)


@pytest.mark.parametrize(("label", "cause"), [(OBSTACLE, "obstacle"), (CLIFF, "cliff"), (INFLATION, "inflation")])
def test_good_square_metre_with_a_wrong_label_is_falsely_unsafe(label: int, cause: str) -> None:
    voxels = floor()
    square = (np.abs(voxels[:, :2] - 2.0) < 0.5).all(axis=1)
    labels = np.where(square, label, np.where(centre_may_be(voxels), TRAVERSABLE, INFLATION))
    found = judged(room(4, 4), voxels, labels)
    nothing_but(found.false_unsafe_by_cause, **{cause: 1.0})
    assert found.confusion_m2["drivable"][cause] >= 1.0


def test_one_cell_too_much_inflation_is_the_edge_s() -> None:
    voxels = floor()
    inner = ((voxels[:, :2] > 0.7) & (voxels[:, :2] < 3.3)).all(axis=1)
    found = judged(room(4, 4), voxels, np.where(inner, TRAVERSABLE, INFLATION))
    nothing_but(found.false_unsafe_by_cause, edge=(28 * 28 - 26 * 26) * 0.01)


def test_ground_beneath_a_low_ceiling_is_falsely_safe_because_of_it() -> None:
    world = join(room(8, 4), plate(4, 0, 8, 4, 0.9))
    voxels = floor(8.0)
    labels = np.where(centre_may_be(voxels, 8.0) & ((voxels[:, 0] < 3.4) | (voxels[:, 0] > 4.0)), TRAVERSABLE, INFLATION)
    found = judged(world, voxels, labels)
    nothing_but(found.false_safe_by_cause, low_ceiling=34 * 28 * 0.01)


def test_ground_too_steep_is_falsely_safe_because_it_is() -> None:
    rise = math.tan(math.radians(40))
    world = join(plate(0, 0, 4, 4), ramp(4, 0, 8, 4, 0, 4 * rise))
    on_ramp = floor(8.0, x0=4.0)
    on_ramp[:, 2] = (on_ramp[:, 0] - 4.0) * rise
    voxels = np.vstack([floor(), on_ramp])
    labels = np.where(centre_may_be(voxels) | ((voxels[:, 0] > 5.0) & (np.abs(voxels[:, 1] - 2.0) < 1.0)), TRAVERSABLE, INFLATION)
    found = judged(world, voxels, labels)
    nothing_but(found.false_safe_by_cause, too_steep=30 * 20 * 0.01)
    steep = found.confusion_m2["obstacle"]
    assert steep["inflation"] > 0.0 and steep["unmapped"] == 0.0


def test_safe_voxels_in_the_air_have_no_ground() -> None:
    found = judged(room(4, 4), floor(z=0.5), np.full(1600, TRAVERSABLE))
    nothing_but(found.false_safe_by_cause, no_ground=16.0)


def test_top_of_a_box_is_other_and_its_edge_an_obstacle_to_the_floor() -> None:
    world = join(room(8, 4), box((4, 0, 0), (8, 4, 0.3)))
    top = floor(8.0, x0=4.0, z=0.3)
    voxels = np.vstack([floor(), top])
    labels = np.full(len(voxels), TRAVERSABLE)
    found = judged(world, voxels, labels)
    assert found.false_safe_by_cause["cliff"] == found.false_safe_by_cause["low ceiling"] == 0.0
    assert found.confusion_m2["other"]["traversable"] > 0.0


def test_wrong_voxels_and_labels_are_refused() -> None:
    true = true_classes(*room(4, 4), reachable_ground(*room(4, 4), START))
    with pytest.raises(ValueError, match="one label each"):
        classification(true, floor(), np.zeros(3))
    with pytest.raises(ValueError, match=r"labels are 0\.\.5"):
        classification(true, floor(), np.full(1600, 7))
    with pytest.raises(ValueError, match="edge_m"):
        classification(true, floor(), np.zeros(1600), ClassificationConfig(edge_m=-1.0))
    with pytest.raises(ValueError, match="belong together"):
        true_classes(*room(8, 8), reachable_ground(*plate(20, 20, 24, 24), (22, 22, 0.132)))


ODD_PLACES = (4.0, 4.02, 4.05, 4.07, 4.093)


def end_of_ground_along_x(mesh: Mesh) -> float:
    """Where the ground ends amid the width of a world that is 4 m wide."""
    x, y, _ = true_classes(*mesh, reachable_ground(*mesh, START)).barriers.T
    return float(x[(abs(y - 2.0) < 1.0) & (x > 3.0)].min())


@pytest.mark.parametrize("edge_x", ODD_PLACES)
def test_cliff_is_where_the_floor_ends_not_where_cells_do(edge_x: float) -> None:
    assert end_of_ground_along_x(plate(0, 0, edge_x, 4)) == pytest.approx(edge_x, abs=0.006)


@pytest.mark.parametrize("height_m", [0.15, 0.3, 0.45])
@pytest.mark.parametrize("face_x", ODD_PLACES)
def test_low_box_ends_the_ground_exactly_where_it_stands(face_x: float, height_m: float) -> None:
    # Vertical rays would find it to half a centimetre only, as they do the edge of its top.
    mesh = join(room(8, 4), box((face_x, 0, 0), (6, 4, height_m)))
    x, y, z = true_classes(*mesh, reachable_ground(*mesh, START)).barriers.T
    assert x[(abs(y - 2.0) < 1.0) & (x > 3.0) & (z < 0.1)].min() == pytest.approx(face_x, abs=0.001)


def test_thin_sheet_under_the_rays_of_a_row_of_columns_is_no_ground() -> None:
    mesh = join(room(8, 4), box((4.04, 0, -0.5), (4.06, 4, 0.4)))
    true = true_classes(*mesh, reachable_ground(*mesh, START))
    drivable = true.cells[true.cell_class == TRUE_CLASSES.index("drivable")]
    assert not ((drivable[:, 0] > 4.0) & (drivable[:, 0] < 4.1)).any()


@pytest.mark.parametrize("height_m", [0.15, 0.3, 0.45])
def test_low_kerb_along_a_drop_is_an_obstacle_and_no_cliff(height_m: float) -> None:
    mesh = join(plate(0, 0, 4, 4), wall(4, 0, 4, 4, height_m))
    true = true_classes(*mesh, reachable_ground(*mesh, START))
    beside = true.barrier_kind[(true.barriers[:, 0] > 3.9) & (abs(true.barriers[:, 1] - 2.0) < 1.0)]
    assert {BARRIERS[kind] for kind in beside} == {"obstacle"}


@pytest.mark.parametrize("edge_x", ODD_PLACES)
def test_low_ceiling_begins_where_it_hangs_not_where_cells_do(edge_x: float) -> None:
    assert end_of_ground_along_x(join(room(8, 4), plate(edge_x, 0, 8, 4, 0.9))) == pytest.approx(edge_x, abs=0.006)


@pytest.mark.parametrize("steep_x", ODD_PLACES)
def test_ground_that_grows_steeper_ends_where_it_is_too_steep(steep_x: float) -> None:
    x = np.arange(0.0, 7.001, 0.02)
    z = np.maximum(0.0, x - 2.0) ** 2 * math.tan(math.radians(25)) / (2 * (steep_x - 2.0))
    hill = join(*(ramp(a, 0, b, 4, low, high) for a, b, low, high in zip(x[:-1], x[1:], z[:-1], z[1:], strict=True)))
    assert end_of_ground_along_x(hill) == pytest.approx(steep_x, abs=0.015)


@pytest.mark.parametrize("foot_x", ODD_PLACES)
def test_face_that_is_too_steep_begins_at_its_foot(foot_x: float) -> None:
    assert end_of_ground_along_x(join(plate(0, 0, foot_x, 4), ramp(foot_x, 0, foot_x + 1.0, 4, 0, 1.0))) == pytest.approx(foot_x, abs=0.011)


@pytest.mark.parametrize("edge_x", [4.02, 4.03, 4.04])
def test_floor_below_a_flank_that_juts_out_ends_where_that_does(edge_x: float) -> None:
    falling, gap = math.tan(math.radians(20)), 0.105  # higher than a step, and yet within the height of a cell from the last place
    edge_z = gap - (edge_x - 2.0) * falling
    flank = ramp(edge_x, 0, edge_x + 1.0, 4, edge_z, edge_z + math.tan(math.radians(30)))
    mesh = join(plate(0, 0, 2, 4), ramp(2, 0, 6, 4, 0, -4 * falling), flank)
    assert end_of_ground_along_x(mesh) == pytest.approx(edge_x, abs=0.006)


def diamond(x: float, y: float, radius: float, height: float) -> Mesh:
    """A post with corners along both axes."""
    corners = [(x - radius, y), (x, y - radius), (x + radius, y), (x, y + radius)]
    top = np.array([(*corner, height) for corner in corners]), np.array([[0, 1, 2], [0, 2, 3]])
    return join(top, *(wall(*a, *b, height) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)))


def test_foot_of_a_post_that_is_lower_than_a_step_is_ground() -> None:
    mesh = join(room(8, 4), diamond(4.5, 2.0, 0.4, 0.9), diamond(4.5, 2.0, 0.6, 0.08))
    off = abs(true_classes(*mesh, reachable_ground(*mesh, START)).barriers[:, :2] - (4.5, 2.0)).sum(axis=1)
    assert off[off < 1.0].max() == pytest.approx(0.4, abs=0.006)
