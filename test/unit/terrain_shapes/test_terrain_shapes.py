"""Every shape, seen through the laser, is classified as the robot needs it; and what is expected of it is what the judge of runs says."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree
from shape import (
    Expectation,
    Expected,
    Shape,
    cliff,
    frontier,
    no_cliff,
    no_frontier,
    no_path,
    not_traversable,
    obstacle,
    path,
    traversable,
)
from shape_judgement import misses, profile
from shape_sweeps import PLACEMENTS, poses_in, world_of
from shapes import MODULES, SHAPES

from exploration_evaluation.truth import reachable_ground

JUDGE_CELL_M = 0.15
NEAR_M, LEVEL_M = 0.3, 0.12
JUDGED_OTHERWISE = {  # what it says of the ground of runs, and the shapes do not
    "floor that gives no echo": {Expected.NOT_TRAVERSABLE},  # it knows of the floor
}


@pytest.mark.parametrize("name", SHAPES)
def test_shape_is_classified_as_the_robot_needs_it(name: str) -> None:
    assert not misses(SHAPES[name], profile("ours"))


def test_names_are_unique() -> None:
    assert len(SHAPES) == sum(len(module.SHAPES) for module in MODULES)


def judged_otherwise(shape: Shape) -> list[str]:
    """Expectations that contradict the ground which the true world lets a robot reach from the last stand."""
    scene = shape.scenes[-1]
    world, T_shape_base = world_of([*scene.solids, *scene.mute]), poses_in(scene)[-1]
    ground = reachable_ground(world.vertices, world.triangles, T_shape_base[:3, 3], cell_m=JUDGE_CELL_M).points
    found = []
    for e in shape.expectations:
        low, high = np.array(e.low) - [0.0, 0.0, LEVEL_M], np.array(e.high) + [0.0, 0.0, LEVEL_M]
        inside = np.count_nonzero(((ground >= low) & (ground <= high)).all(axis=1))
        near = bool(cKDTree(ground).query(e.low)[0] < NEAR_M)
        if e.kind in (Expected.PATH, Expected.NO_PATH):
            contradicts = near is (e.kind is Expected.NO_PATH)
        elif e.kind is Expected.TRAVERSABLE:
            contradicts = inside * JUDGE_CELL_M**2 < 0.75 * np.prod((high - low)[:2])
        else:
            contradicts = e.kind in (Expected.NOT_TRAVERSABLE, Expected.OBSTACLE, Expected.CLIFF) and inside > 0
        if contradicts and e.kind not in JUDGED_OTHERWISE.get(shape.name, ()):
            found.append(str(e))
    return found


@pytest.mark.parametrize("name", SHAPES)
def test_judge_of_runs_expects_the_same(name: str) -> None:
    assert not judged_otherwise(SHAPES[name])


WALL = SHAPES["wall"]
FLOOR_BEFORE_IT, THROUGH_IT = ((-2.0, -1.0, 0.0), (-0.8, 1.0, 0.0)), ((-0.1, -1.0, 0.0), (0.15, 1.0, 1.2))


@pytest.mark.parametrize(
    "wrong",
    [
        traversable(*THROUGH_IT),
        obstacle(*FLOOR_BEFORE_IT),
        cliff(*THROUGH_IT),
        not_traversable(*FLOOR_BEFORE_IT),
        frontier(*FLOOR_BEFORE_IT),
        path((1.0, 0.0, 0.0)),
        no_path((-1.8, 0.0, 0.0)),
    ],
    ids=str,
)
def test_what_is_not_there_is_missed_wherever_the_shape_lies(wrong: Expectation) -> None:
    assert len(misses(replace(WALL, expectations=(wrong,)), profile("ours"))) == len(PLACEMENTS)


def test_cliff_and_frontier_are_missed_where_none_must_be() -> None:
    edge = SHAPES["plateau edge, seen"]
    assert misses(replace(edge, expectations=(no_cliff((0.9, -1.0, 0.0), (1.3, 1.0, 0.0)),)), profile("ours"))
    unseen = SHAPES["plateau edge, not seen"]
    assert misses(replace(unseen, expectations=(no_frontier((0.6, -1.5, -0.1), (1.7, 1.5, 0.1)),)), profile("ours"))


def test_path_over_what_must_not_be_driven_on_is_none() -> None:
    around = (not_traversable((-2.4, -3.0, 0.0), (-2.1, 3.0, 0.0)), path((-2.8, 0.0, 0.0)))
    assert any("leads over" in text for text in misses(replace(WALL, expectations=around), profile("ours")))
