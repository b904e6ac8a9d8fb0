"""A spinning lidar's stamps and rings, held against what config/lidar.yaml says of it."""

import math

import numpy as np
import pytest

from sensor_checks import Level
from sensor_checks.lidar import lidar_rows

VLP_16 = np.radians(np.linspace(-15.0, 15.0, 16))


def rows(rate_hz=10.0, elevations=VLP_16, seen=slice(None), downwards=False, told=VLP_16, jitter_s=0.0):
    """Of walls 4 m away, seen by the rings `seen`, against a lidar of 10 Hz whose rings are as `told`."""
    rng, azimuth = np.random.default_rng(0), np.linspace(-math.pi, math.pi, 90)
    numbers = np.arange(len(elevations))[::-1] if downwards else np.arange(len(elevations))
    elevation, ring = (np.repeat(values[seen], len(azimuth)) for values in (elevations, numbers))
    around = np.tile(azimuth, len(ring) // len(azimuth))
    points = 4.0 * np.stack([np.cos(elevation) * np.cos(around), np.cos(elevation) * np.sin(around), np.sin(elevation)], axis=1)
    points[::7] = np.nan
    stamps = 1.7e9 + np.arange(50) / rate_hz + jitter_s * rng.random(50)
    return {row.asked: row for row in lidar_rows("/points", stamps, (points, ring), told, 10.0)}


@pytest.mark.parametrize("case", [{}, {"downwards": True}, {"rate_hz": 10.3}, {"seen": slice(0, 9)}, {"jitter_s": 0.01}])
def test_lidar_that_is_as_configured_is_ok(case):
    found = rows(**case)
    assert set(found) == {"turns", "rings"} and {row.level for row in found.values()} == {Level.OK}


@pytest.mark.parametrize("rate_hz", [5.0, 9.0, 12.0, 20.0])
def test_lidar_that_turns_otherwise_is_told_with_its_rate(rate_hz):
    row = rows(rate_hz=rate_hz)["turns"]
    assert row.level is Level.ERROR and f"set rate_hz to {rate_hz:.1f}" in row.advice


@pytest.mark.parametrize(
    ("elevations", "told", "said"),
    [
        (np.radians(np.linspace(-25.0, 15.0, 32)), VLP_16, "set rings to 32"),
        (VLP_16, np.radians(np.linspace(-15.0, 15.0, 32)), "16 rings from -15.0 to 15.0 deg"),
        (np.radians(np.linspace(-22.5, 22.5, 16)), VLP_16, "16 rings from -22.5 to 22.5 deg"),
    ],
)
@pytest.mark.parametrize("downwards", [False, True])
def test_rings_that_are_not_those_of_the_file_are_an_error(elevations, told, said, downwards):
    row = rows(elevations=elevations, told=told, downwards=downwards)["rings"]
    assert row.level is Level.ERROR and said in f"{row.found} {row.advice}"


def test_rings_that_are_not_evenly_spaced_are_warned_of():
    row = rows(elevations=np.radians(np.array([*np.linspace(-15.0, 8.0, 15), 15.0])))["rings"]
    assert row.level is Level.WARN and "up to 5.0 deg from where" in row.advice


def test_nothing_is_said_of_a_lidar_that_sees_nothing_or_sends_one_cloud():
    assert lidar_rows("/points", np.array([1.0]), (np.full((3, 3), np.nan), np.arange(3)), VLP_16, 10.0) == []
