"""Where movers go: around walls and each other, and never into a robot that stands."""

import math

import numpy as np
import pytest

from simulated_movers import Crowd, MoverError, MoverSpec, OpenGround, RobotSeen, drawn_movers

DT_S = 0.05
FAR = RobotSeen(50.0, 50.0, 0.0, 0.0, 0.5, 0.33)


def hall(side_m=8.0, height_m=0.0):
    """Open ground around the origin, up to the walls."""
    at = np.arange(-side_m / 2, side_m / 2 + 0.05, 0.1)
    x, y = np.meshgrid(at, at)
    clear = side_m / 2 - np.maximum(np.abs(x), np.abs(y))
    return OpenGround(np.full(x.shape, height_m), clear, at[0], at[0], 0.1)


def moved(crowd, robot, seconds, observe=lambda: None):
    for _ in range(round(seconds / DT_S)):
        crowd.step(DT_S, robot)
        observe()


def test_random_walkers_get_about_and_keep_off_walls_and_each_other():
    ground = hall()
    crowd, places = Crowd(drawn_movers(6, 3), ground, FAR, 3), []
    moved(crowd, FAR, 60.0, lambda: places.append(crowd.discs()))
    track = np.array(places)
    assert (np.ptp(track[:, :, 0], axis=0) + np.ptp(track[:, :, 1], axis=0) > 2.0).all()
    assert (np.abs(track[:, :, :2]).max(axis=2) + track[:, :, 2] <= 4.0 + 0.08).all()
    for a in range(6):
        for b in range(a):
            apart = np.linalg.norm(track[:, a, :2] - track[:, b, :2], axis=1) - track[:, a, 2] - track[:, b, 2]
            assert apart.min() > 0.0


def test_same_seed_gives_the_same_walk_and_another_seed_another():
    def walk(seed):
        crowd, found = Crowd(drawn_movers(4, 1), hall(), FAR, seed), []
        moved(crowd, FAR, 20.0, lambda: found.append(crowd.part_poses()))
        return np.array(found)

    assert np.array_equal(walk(1), walk(1)) and not np.array_equal(walk(1), walk(2))


@pytest.mark.parametrize("walk", ["random", "steps_in"])
def test_nobody_walks_into_a_robot_that_stands(walk):
    robot, gaps = RobotSeen(0.0, 0.0, 0.3, 0.0, 0.5, 0.33), []
    crowd = Crowd([MoverSpec(name=str(i), walk=walk, start=(-2.0, y)) for i, y in enumerate((-2.0, 0.0, 2.0))], hall(6.0), robot, 2)
    moved(crowd, robot, 120.0, lambda: gaps.append(robot.gap_m(crowd.discs(), 0.0)))
    assert min(gaps) >= 0.3 - 1e-9


def test_person_on_a_path_goes_there_and_back_and_swings_its_legs():
    crowd, track, legs = Crowd([MoverSpec(walk="path", path=(-2.0, 1.0, 2.0, 1.0), pause_s=0.5)], hall(), FAR, 1), [], []
    moved(crowd, FAR, 20.0, lambda: (track.append(crowd.places()[0]), legs.append(crowd.part_poses()[:2, 4])))
    x, y = np.array(track)[:, 0], np.array(track)[:, 1]
    assert y == pytest.approx(1.0, abs=0.03) and x.min() == pytest.approx(-2.0, abs=0.05) and x.max() == pytest.approx(2.0, abs=0.05)
    assert ((np.diff(x) > 0.04).sum() > 60) and ((np.diff(x) < -0.04).sum() > 60)
    assert np.array(legs)[:, 0] == pytest.approx(-np.array(legs)[:, 1]) and np.ptp(np.array(legs)[:, 0]) > 0.8


def test_person_on_a_path_stops_before_a_robot_in_its_way():
    robot = RobotSeen(0.0, 1.0, 0.0, 0.0, 0.5, 0.33)
    crowd = Crowd([MoverSpec(walk="path", path=(-2.0, 1.0, 2.0, 1.0))], hall(), robot, 1)
    moved(crowd, robot, 10.0)
    assert crowd.places()[0, 0] == pytest.approx(-0.5 - 0.3 - 0.3, abs=0.06)


def test_people_foresee_where_a_robot_drives():
    """A robot at 0.5 m/s may not be stepped before, one that stands may be passed."""
    for speed, expected in ((0.5, True), (0.0, False)):
        robot = RobotSeen(-1.2, 0.0, 0.0, speed, 0.5, 0.33)
        crowd = Crowd([MoverSpec(walk="path", path=(0.0, 1.2, 0.0, -1.2), pause_s=0.0)], hall(), robot, 1)
        moved(crowd, robot, 2.0)
        assert bool(crowd.places()[0, 1] > 0.4) is expected


def test_mean_one_steps_before_a_robot_that_drives_and_stands_there():
    crowd = Crowd([MoverSpec(walk="steps_in", start=(0.6, 1.3), speed_mps=1.2, pause_s=3.0)], hall(12.0), FAR, 1)
    moved(crowd, RobotSeen(-1.0, 0.0, 0.0, 0.5, 0.5, 0.33), 0.05)
    x, stood = -1.0, []
    for _ in range(60):
        robot = RobotSeen(x, 0.0, 0.0, 0.5, 0.5, 0.33)
        crowd.step(DT_S, robot)
        place = crowd.places()[0]
        if abs(place[1]) < 0.12:
            stood.append(place[:2])
        else:
            x += 0.5 * DT_S
    assert len(stood) > 30 and np.ptp(np.array(stood), axis=0).max() < 0.05
    assert 0.3 < stood[-1][0] - 0.3 - (x + 0.5) < 1.1


def test_door_opens_and_shuts_and_stops_before_the_robot():
    door = MoverSpec(kind="door", name="door", start=(0.0, 0.0), width_m=0.9, pause_s=1.0)
    crowd, yaws = Crowd([door], hall(), FAR, 1), []
    moved(crowd, FAR, 12.0, lambda: yaws.append(crowd.places()[0, 3]))
    assert min(yaws) == 0.0 and max(yaws) == pytest.approx(math.pi / 2)
    assert yaws.count(0.0) > 15 and np.isclose(yaws, math.pi / 2).sum() > 15
    robot = RobotSeen(0.6, 0.75, 0.0, 0.0, 0.5, 0.33)
    crowd = Crowd([door], hall(), robot, 1)
    moved(crowd, robot, 12.0)
    assert 0.1 < crowd.places()[0, 3] < 0.6 and robot.gap_m(crowd.discs(), 0.0) >= 0.1 - 1e-9


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        (MoverSpec(name="Ann", start=(3.9, 0.0)), "mover Ann cannot start at x 3.9 y 0: it is inside or too near to a wall"),
        (MoverSpec(name="Ann", start=(30.0, 0.0)), "inside or too near to a wall or obstacle, or not on the ground"),
        (MoverSpec(name="Ann", start=(0.2, 0.0)), "the robot starts there"),
        (MoverSpec(name="Ann", walk="path", path=(2.0, 0.0, 5.0, 0.0)), "cannot go from x 2 y 0 to x 5 y 0: a wall"),
        (MoverSpec(name="D", kind="door", start=(9.0, 0.0)), "mover D: the door is inside a wall"),
    ],
)
def test_mover_that_cannot_be_where_it_starts_is_said_in_one_line(spec, said):
    with pytest.raises(ValueError, match=said):
        Crowd([spec], hall(), RobotSeen(0.0, 0.0, 0.0, 0.0, 0.5, 0.33), 1)


def test_mover_that_cannot_be_is_told_with_its_place_in_the_list():
    good = MoverSpec(name="a", start=(1.0, 1.0))
    with pytest.raises(MoverError, match="^mover b cannot start at x 30 y 0: ") as refused:
        Crowd([good, MoverSpec(name="b", start=(30.0, 0.0))], hall(), FAR, 1)
    assert refused.value.index == 1 and refused.value.sentence.startswith("b cannot start")
    with pytest.raises(MoverError, match="^mover a has the name of another one$") as refused:
        Crowd([good, MoverSpec(name="a", start=(-1.0, 1.0))], hall(), FAR, 1)
    assert refused.value.index == 1


def test_two_movers_in_one_place_and_more_than_have_room_are_refused():
    with pytest.raises(ValueError, match="another mover starts there"):
        Crowd([MoverSpec(name="a", start=(1.0, 1.0)), MoverSpec(name="b", start=(1.2, 1.0))], hall(), FAR, 1)
    with pytest.raises(ValueError, match="no open ground left"):
        Crowd(drawn_movers(20, 1), hall(3.0), FAR, 1)
