"""Zones as somebody draws them with the mouse."""

import numpy as np
import pytest

from map_zones import NO_ZONES, Zone, Zones
from map_zones.editing import (
    BOUNDS,
    NO_GO,
    Corner,
    corner_of,
    corners,
    moved,
    with_corner_after,
    with_square,
    without_corner,
    without_zone,
)

TRIANGLE = Zone(np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]]), -0.5, 0.5)
DRAWN = Zones(bounds=(Zone(np.array([[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]])),), no_go=(TRIANGLE,))


def test_square_is_drawn_around_its_middle_and_is_a_zone() -> None:
    drawn = with_square(NO_ZONES, NO_GO, (2.0, 1.0), 2.0)
    assert not drawn.bounds and not drawn.problems()
    np.testing.assert_allclose(drawn.no_go[0].polygon, [[1.0, 0.0], [3.0, 0.0], [3.0, 2.0], [1.0, 2.0]])
    more = with_square(drawn, BOUNDS, (0.0, 0.0), 8.0)
    assert (len(more.bounds), len(more.no_go)) == (1, 1)


def test_corners_have_names_that_are_read_back() -> None:
    found = corners(DRAWN)
    assert len(found) == 7 and [corner_of(c.name) for c in found] == list(found)
    np.testing.assert_allclose(found[Corner(NO_GO, 0, 1)], [2.0, 0.0])
    for name in ("robot", "no_go/0", "no_go/-1/0", "walls/0/0", "no_go/0/0/0"):
        with pytest.raises(ValueError, match="names no corner"):
            corner_of(name)


def test_corner_is_moved_added_and_taken_away_and_all_else_stays() -> None:
    at = Corner(NO_GO, 0, 2)
    np.testing.assert_allclose(moved(DRAWN, at, (0.0, 3.0)).no_go[0].polygon, [[0.0, 0.0], [2.0, 0.0], [0.0, 3.0]])
    added = with_corner_after(DRAWN, at)  # between the last and the first
    np.testing.assert_allclose(added.no_go[0].polygon, [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [0.0, 1.0]])
    assert (added.no_go[0].low_m, added.no_go[0].high_m, added.bounds) == (-0.5, 0.5, DRAWN.bounds)
    taken = without_corner(DRAWN, at)
    assert len(taken.no_go[0].polygon) == 2 and taken.problems()  # which is refused elsewhere
    np.testing.assert_allclose(DRAWN.no_go[0].polygon, TRIANGLE.polygon)


@pytest.mark.parametrize("end", [(1.3, -1.1), (1.7, -0.7)], ids=["level", "oblique"])
def test_corners_are_added_to_one_side_again_and_again(end: tuple[float, float]) -> None:
    zones = moved(with_square(NO_ZONES, NO_GO, (0.3, -0.1), 2.0), Corner(NO_GO, 0, 1), end)
    for _ in range(6):
        zones = with_corner_after(zones, Corner(NO_GO, 0, 0))
        assert not zones.problems()


def test_zone_is_taken_away_and_the_others_stay() -> None:
    assert without_zone(DRAWN, Corner(NO_GO, 0, 1)).no_go == () and without_zone(DRAWN, Corner(BOUNDS, 0, 0)).no_go == DRAWN.no_go


@pytest.mark.parametrize("change", [with_corner_after, without_corner, without_zone, lambda z, at: moved(z, at, (0.0, 0.0))])
def test_corner_that_somebody_else_took_away_is_told(change: object) -> None:
    for gone in (Corner(NO_GO, 1, 0), Corner(NO_GO, 0, 3)):
        with pytest.raises(ValueError, match="any more"):
            change(DRAWN, gone)  # type: ignore[operator]
