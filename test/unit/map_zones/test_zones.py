"""Polygons and the ground that they open and close; files of them, good and bad."""

import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from map_zones import NO_ZONES, Zone, Zones, read_zones, write_zones, zones_from_mapping, zones_mapping
from map_zones.polygon import distance_m, is_inside, polygon_problem

L = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]])  # an L
SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])


def points(*xyz: tuple[float, float, float]) -> np.ndarray:
    return np.array(xyz, dtype=np.float64)


@pytest.mark.parametrize("corners", [L, L[::-1]], ids=["left about", "right about"])
def test_inside_of_a_polygon_that_is_not_convex(corners: np.ndarray) -> None:
    xy = np.array([[0.5, 2.5], [3.5, 0.5], [0.5, 0.5], [2.0, 2.0], [-0.1, 0.5], [4.1, 0.5], [1.1, 1.1]])
    assert is_inside(corners, xy).tolist() == [True, True, True, False, False, False, False]


def test_random_points_are_inside_as_a_winding_angle_says() -> None:
    rng = np.random.default_rng(3)
    angle = np.sort(rng.uniform(0.0, 2 * np.pi, 9))
    star = np.stack([np.cos(angle), np.sin(angle)], axis=1) * rng.uniform(0.5, 2.0, (9, 1))
    xy = rng.uniform(-2.0, 2.0, (500, 2))
    off = star[None] - xy[:, None]
    a = np.arctan2(off[..., 1], off[..., 0])
    turn = np.angle(np.exp(1j * (np.roll(a, -1, axis=1) - a))).sum(axis=1)
    assert (is_inside(star, xy) == (np.abs(turn) > np.pi)).all()


def test_distance_is_that_of_the_nearest_side_or_corner() -> None:
    np.testing.assert_allclose(distance_m(SQUARE, np.array([[1.0, 0.3], [3.0, 1.0], [5.0, 6.0], [2.0, 1.0]])), [0.3, 1.0, 5.0, 0.0])


@pytest.mark.parametrize(
    ("corners", "said"),
    [
        (SQUARE[:2], "three corners"),
        (np.zeros((0, 2)), "three corners"),
        (SQUARE[[0, 2, 1, 3]], "cross"),
        (np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]), "empty"),
        (np.array([[0.0, 0.0], [1.0, np.nan], [2.0, 2.0]]), "no finite number"),
    ],
)
def test_polygon_that_is_none_says_why(corners: np.ndarray, said: str) -> None:
    assert said in polygon_problem(corners) and not polygon_problem(L)


U = np.array([[0, 0], [3, 0], [3, 2], [2, 2], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=np.float64)
T = np.array([[0, 0], [1, 0], [1, -2], [2, -2], [2, 0], [3, 0], [3, 1], [0, 1]], dtype=np.float64)
BUMP = np.array([[0, 0], [4, 0], [4, 1], [3, 1], [3, 2], [2, 2], [2, 1], [0, 1]], dtype=np.float64)
CORNERS_ON_A_SIDE = np.array([[0, 0], [1, 0], [2, 0], [3, 0], [3, 1], [0, 1]], dtype=np.float64)
BACK_ON_ITSELF = np.array([[0, 0], [3, 0], [3, 1], [2, 0], [1, 0], [0, 1]], dtype=np.float64)
CORNER_ON_A_SIDE = np.array([[0, 0], [2, 0], [2, 2], [1, 0], [0, 2]], dtype=np.float64)


def turned(corners: np.ndarray, angle_rad: float) -> np.ndarray:
    """About the origin, and rounded as messages round: what lay on one line does so no longer to the last digit."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return (corners @ np.array([[c, s], [-s, c]])).astype(np.float32).astype(np.float64)


@pytest.mark.parametrize("corners", [U, T, BUMP, CORNERS_ON_A_SIDE], ids=["U", "T", "bump", "corners on a side"])
def test_sides_on_one_line_that_are_apart_do_not_cross(corners: np.ndarray) -> None:
    for angle_rad in np.linspace(0.0, 2 * np.pi, 100):
        assert polygon_problem(turned(corners, angle_rad)) == "", angle_rad


@pytest.mark.parametrize("corners", [BACK_ON_ITSELF, CORNER_ON_A_SIDE], ids=["a side on a side", "a corner on a side"])
def test_sides_that_touch_cross(corners: np.ndarray) -> None:
    assert polygon_problem(corners) == polygon_problem(corners[::-1]) == "its sides cross"


def test_random_polygon_crosses_itself_as_exact_fractions_say() -> None:
    rng = np.random.default_rng(5)
    found = []
    for _ in range(500):
        corners = rng.integers(0, 6, (rng.integers(4, 6), 2))
        sides = list(zip(corners.tolist(), np.roll(corners, -1, axis=0).tolist(), strict=True))
        apart = [(i, j) for i in range(len(sides)) for j in range(i + 2, len(sides) - (i == 0))]
        zone = Zone(corners.astype(np.float64))
        if len(zone.polygon) == len(corners):
            found.append(any(have_a_common_point(*sides[i], *sides[j]) for i, j in apart))
            assert (zone.problem() == "its sides cross") == found[-1], corners.tolist()
    assert 100 < sum(found) < len(found) - 100


def have_a_common_point(a: list[int], b: list[int], c: list[int], d: list[int]) -> bool:
    """Whether two sides on a grid meet: by the shares of both at which their lines do, or by the corners that lie on the other side."""
    along, across, off = ([q - p for p, q in zip(*pair, strict=True)] for pair in ((a, b), (c, d), (a, c)))
    det = along[0] * across[1] - along[1] * across[0]
    if det == 0:
        return any(lies_on(*three) for three in ((c, a, b), (d, a, b), (a, c, d), (b, c, d)))
    shares = Fraction(off[0] * across[1] - off[1] * across[0], det), Fraction(off[0] * along[1] - off[1] * along[0], det)
    return all(0 <= share <= 1 for share in shares)


def lies_on(p: list[int], a: list[int], b: list[int]) -> bool:
    """Whether the way from a to b by p is no longer than the straight one; on a grid of this size lengths tell."""
    return math.dist(a, p) + math.dist(p, b) <= math.dist(a, b) + 1e-9


def test_ring_that_is_closed_is_the_zone_that_it_encloses() -> None:
    ring = [*SQUARE.tolist(), SQUARE[0].tolist()]
    zone = zones_from_mapping({"bounds": [{"polygon": ring}]}).bounds[0]
    np.testing.assert_array_equal(zone.polygon, SQUARE)
    assert "three corners" in Zone(np.array(ring)[[0, 1, 0]]).problem()


def test_corner_that_is_given_twice_counts_once() -> None:
    np.testing.assert_array_equal(Zone(SQUARE[[0, 1, 1, 2, 3, 3, 3]]).polygon, SQUARE)


def test_ground_is_open_in_any_of_the_bounds_and_in_no_no_go_zone() -> None:
    zones = Zones(bounds=(Zone(SQUARE), Zone(SQUARE + 5.0)), no_go=(Zone(SQUARE / 2.0),))
    asked = points((1.5, 1.5, 0.0), (6.0, 6.0, 0.0), (4.0, 4.0, 0.0), (0.5, 0.5, 0.0))
    assert zones.closed(asked).tolist() == [False, False, True, True]
    assert not NO_ZONES.closed(asked).any() and not NO_ZONES.are_set
    np.testing.assert_allclose(zones.depth_m(asked), [0.0, 0.0, math.sqrt(2.0), 0.5])
    assert (
        "no_go[0]" in zones.why_closed(asked[3]) and "outside the bounds" in zones.why_closed(asked[2]) and not zones.why_closed(asked[0])
    )


def test_zone_counts_between_its_heights() -> None:
    deck = Zones(bounds=(Zone(SQUARE, 1.0, 3.0),), no_go=(Zone(SQUARE / 2.0, 2.0, 3.0),))
    assert deck.closed(points((1.5, 1.5, 0.0), (1.5, 1.5, 1.5), (0.5, 0.5, 1.5), (0.5, 0.5, 2.5))).tolist() == [True, False, False, True]


def test_file_tells_the_same_zones_again(tmp_path: Path) -> None:
    zones = Zones(bounds=(Zone(L, 1.0),), no_go=(Zone(SQUARE, -1.0, 2.0), Zone(SQUARE)))
    write_zones(zones, tmp_path / "zones.yaml")
    again = read_zones(tmp_path / "zones.yaml")
    assert zones_mapping(again) == zones_mapping(zones) and len(again.no_go) == 2
    (tmp_path / "empty.yaml").write_text("")
    assert not read_zones(tmp_path / "empty.yaml").are_set


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ([1], "a mapping of bounds and no_go"),
        ({"bouds": []}, "bouds"),
        ({"bounds": {"polygon": []}}, "bounds: expected a list"),
        ({"bounds": [[[0, 0], [1, 0], [1, 1]]]}, r"bounds\[0\]: expected polygon"),
        ({"no_go": [{"polygon": [[0, 0], [1]]}]}, r"no_go\[0\]: polygon: expected \[\[x, y\]"),
        ({"no_go": [{"polygon": "everywhere"}]}, r"no_go\[0\]: polygon"),
        ({"no_go": [{"polygon": [[0, 0], [1, 0], [1, 1]], "low": 2, "high": 1}]}, "low = 2 is not below high = 1"),
        ({"no_go": [{"polygon": [[0, 0], [1, 0], [1, 1]], "low": "deep"}]}, r"no_go\[0\]"),
        ({"bounds": [{"polygon": SQUARE.tolist()}, {"polygon": SQUARE[[0, 2, 1, 3]].tolist()}]}, r"bounds\[1\]: its sides cross"),
    ],
)
def test_zones_that_are_none_are_refused_in_one_line(values: object, said: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=said) as problem:
        zones_from_mapping(values)
    assert "\n" not in str(problem.value)


@pytest.mark.parametrize(
    ("text", "said"), [("bounds: [", "bad.yaml: "), ("no_go: []\nno_go: []", "bad.yaml: key no_go stands in line 1, and again")]
)
def test_file_that_holds_no_zones_or_some_twice_is_refused_in_one_line(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text(text)
    with pytest.raises(ValueError, match=said) as problem:
        read_zones(tmp_path / "bad.yaml")
    assert "\n" not in str(problem.value)
