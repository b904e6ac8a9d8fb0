"""What sweeps say of a mount, in a room of planes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from room_sweeps import AT, GEOMETRY, place, sweep

from mount_calibration import (
    PARAMETERS,
    MountCalibrationConfig,
    MountEstimate,
    Place,
    TiltCalibration,
    TiltedBeams,
    TiltGeometry,
    estimate_mount,
    steady_directions,
)
from mount_calibration.tilted_beams import points_and_jacobian
from rigid_geometry import transform_from_rpy
from robot_body import RobotBody

DEG = math.radians(1.0)
OFF = TiltCalibration(0.4 * DEG, 1.005, 0.3 * DEG, -0.4 * DEG)
LIMITS = np.array([0.05 * DEG, 0.001, 0.05 * DEG, 0.05 * DEG])


def estimated(*places: Place) -> MountEstimate:
    return estimate_mount(places, GEOMETRY, MountCalibrationConfig(), RobotBody())


@pytest.mark.parametrize("seed", [1, 2])
def test_mount_is_found_from_one_place_on_level_ground(seed: int) -> None:
    found = estimated(place(OFF, seed=seed)).calibration
    assert (np.abs(found.values - OFF.values)[:4] < LIMITS).all()
    assert (np.abs(found.values - OFF.values)[:4] < 4.0 * found.sigmas[:4] + 1e-4).all()
    assert found.validate() == []


def test_perfect_mount_is_found_perfect() -> None:
    found = estimated(place(TiltCalibration())).calibration
    assert (np.abs(found.values - TiltCalibration().values)[:4] < LIMITS / 2).all()


def test_planes_get_thinner() -> None:
    found = estimated(place(OFF))
    assert found.after_m < found.before_m and found.planes > 50


def test_pitch_of_the_mount_is_never_measured_for_it_is_the_offset() -> None:
    found = estimated(place(OFF)).calibration
    assert np.isinf(found.sigmas[PARAMETERS.index("mount_pitch_rad")]) and found.mount_pitch_rad == 0.0


def test_on_uneven_ground_offset_and_roll_are_not_observable_from_one_place() -> None:
    found = estimated(place(OFF, step_m=0.06)).calibration
    assert np.isinf(found.sigmas[[0, 3]]).all() and found.offset_rad == 0.0 == found.mount_roll_rad
    assert abs(found.scale - OFF.scale) < 0.001 and abs(found.backlash_rad - OFF.backlash_rad) < 0.05 * DEG


def test_ground_says_nothing_of_a_robot_that_does_not_stand_level() -> None:
    leaning = AT @ transform_from_rpy((0.0, 0.0, 0.0), (0.0, 1.5 * DEG, 0.0))
    found = estimated(place(OFF, leaning)).calibration
    assert np.isinf(found.sigmas[[0, 3]]).all()


def test_turning_on_the_spot_measures_offset_and_roll_without_the_ground() -> None:
    turns = [AT @ transform_from_rpy((0, 0, 0), (0, 0, yaw)) for yaw in (0.0, 1.6, 3.1)]
    believed = [T @ transform_from_rpy((0.02 * k, -0.01 * k, 0.0), (0.0, 0.0, 0.01 * k)) for k, T in enumerate(turns)]
    places = [Place(sweep(OFF, T, seed=k, step_m=0.06), B) for k, (T, B) in enumerate(zip(turns, believed, strict=True))]
    found = estimated(*places).calibration
    assert (np.abs(found.values - OFF.values)[:4] < LIMITS).all()
    assert (found.sigmas[[0, 3]] > 0.05 * DEG).all(), "the odometry's own level may be off by so much"


def test_without_the_way_up_the_backlash_is_not_observable() -> None:
    beams = sweep(OFF)
    found = estimated(Place(beams.chosen(beams.directions < 0), AT)).calibration
    assert np.isinf(found.sigmas[PARAMETERS.index("backlash_rad")]) and found.backlash_rad == 0.0
    assert abs(found.scale - OFF.scale) < 0.001


def test_sweeps_that_saw_nothing_twice_give_a_reason_and_no_number() -> None:
    beams = sweep(OFF)
    found = estimated(Place(beams.chosen((beams.directions < 0) & (beams.points_laser[:, 0] > 0)), AT))
    assert found.reason and not found.calibration.measured.any()


def test_sweeps_that_fit_no_mount_that_can_be_give_a_reason_and_no_number() -> None:
    whole = place(TiltCalibration())
    bent = replace(whole, beams=replace(whole.beams, tilts_rad=1.2 * whole.beams.tilts_rad))
    found = estimated(bent)
    assert "no mount that can be" in found.reason and "scale" in found.reason
    assert (found.calibration.values == TiltCalibration().values).all()


def test_no_place_is_an_error() -> None:
    with pytest.raises(ValueError, match="at least one place"):
        estimated()


def test_jacobian_is_that_of_small_differences() -> None:
    beams, step = sweep(OFF).chosen(np.arange(0, 70_000, 999)), 1e-6
    _, jacobian = points_and_jacobian(beams, TiltGeometry(GEOMETRY.T_base_mount, GEOMETRY.T_tilt_laser, OFF))
    for p in range(4):
        sides = []
        for sign in (1, -1):
            values = OFF.values + sign * step * np.eye(5)[p]
            mount = TiltGeometry(GEOMETRY.T_base_mount, GEOMETRY.T_tilt_laser, TiltCalibration.of_values(values))
            sides.append(points_and_jacobian(beams, mount)[0])
        np.testing.assert_allclose((sides[0] - sides[1]) / (2 * step), jacobian[:, :, p], atol=1e-6)


def test_direction_is_unknown_until_the_mount_has_moved_and_right_after_it_turns() -> None:
    tilts = np.concatenate([np.arange(0, 7), np.arange(5, -1, -1)]) * 0.01
    stamps = np.arange(len(tilts)) * 0.025
    directions = steady_directions(stamps, tilts, stamps[:-1] + 0.0125)
    assert directions.tolist() == [0, 0, 1, 1, 1, 0, 0, 0, 0, 0, -1, -1]


def test_beams_of_a_mount_that_speeds_up_are_not_steady() -> None:
    stamps = np.arange(12) * 0.025
    tilts = np.cumsum([0.0, 0.03, 0.03, 0.03, 0.03, 0.03, 0.06, 0.06, 0.06, 0.06, 0.06, 0.06])
    directions = steady_directions(stamps, tilts, stamps[:-1] + 0.0125)
    assert directions[4] == 0 == directions[5] and directions[3] == 1 == directions[8]


def test_beams_are_chosen_together() -> None:
    beams = TiltedBeams(np.arange(6, dtype=np.float32).reshape(2, 3), np.array([0.1, 0.2]), np.array([1, -1], np.int8))
    chosen = beams.chosen(np.array([False, True]))
    assert len(chosen) == 1 and chosen.tilts_rad[0] == 0.2 and chosen.directions[0] == -1
