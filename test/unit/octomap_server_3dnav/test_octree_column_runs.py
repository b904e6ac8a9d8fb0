"""Column runs against the dense grids that they stand for."""

import dataclasses

import numpy as np
import pytest

from octomap_server_3dnav.octree.column_runs import ColumnRuns

COLUMNS = ["..##..", "111#1.", "......", ".#11#1"]  # below to above; . unknown, 1 free, # occupied


def dense(columns: list[str], nx: int) -> np.ndarray:
    """(nx, ny, nz) states of columns written as text, in the order of their ids."""
    states = np.array([[".1#".index(letter) for letter in column] for column in columns], dtype=np.uint8)
    return states.reshape(nx, -1, states.shape[1])


def states_of(runs: ColumnRuns, lowest: int, layers: int) -> np.ndarray:
    """(nx, ny, layers) states, run by run."""
    states = np.zeros((runs.nx * runs.ny, layers), np.uint8)
    for column, low, high, is_occupied in zip(runs.columns, runs.z_lo, runs.z_hi, runs.occupied, strict=True):
        states[column, low - lowest : high - lowest + 1] = 2 if is_occupied else 1
    return states.reshape(runs.nx, runs.ny, layers)


def test_literal_columns_become_the_runs_one_sees():
    runs = ColumnRuns.from_dense(dense(COLUMNS, nx=2), origin=(5, -3, -2), resolution=0.1)
    assert (runs.nx, runs.ny, runs.origin_key, runs.resolution) == (2, 2, (5, -3), 0.1)
    assert runs.start.tolist() == [0, 1, 4, 4, 8]
    assert runs.z_lo.tolist() == [0, -2, 1, 2, -1, 0, 2, 3]
    assert runs.z_hi.tolist() == [1, 0, 1, 2, -1, 1, 2, 3]
    assert runs.occupied.tolist() == [True, False, True, False, True, False, True, False]


@pytest.mark.parametrize("seed", range(5))
def test_dense_grid_survives_the_round_trip(seed):
    rng = np.random.default_rng(seed)
    states = rng.choice([0, 1, 2], size=tuple(rng.integers(1, 9, 3)), p=[0.3, 0.4, 0.3]).astype(np.uint8)
    origin = rng.integers(-50, 50, 3)
    runs = ColumnRuns.from_dense(states, origin)
    assert np.array_equal(states_of(runs, origin[2], states.shape[2]), states)


def test_unknown_everywhere_has_no_runs_and_no_z_range():
    runs = ColumnRuns.from_dense(np.zeros((2, 3, 4), np.uint8))
    assert runs.z_range is None and runs.z_lo.size == 0


@pytest.mark.parametrize("z", [-32768, 32767])
def test_extreme_layers_are_kept(z):
    runs = ColumnRuns.from_dense(np.full((1, 1, 1), 2, np.uint8), origin=(0, 0, z))
    assert runs.z_range == (z, z) and runs.occupied.tolist() == [True]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"z_hi": np.array([0, -1], np.int16)}, "ends below"),
        ({"z_lo": np.array([0, 1], np.int16)}, "touch in the same state"),
        ({"z_lo": np.array([0, 0], np.int16)}, "overlap"),
        ({"start": np.array([0, 1], np.int64)}, "start must ascend"),
        ({"start": np.array([0, 2], np.int32)}, "int64"),
        ({"occupied": np.array([True], np.bool_)}, "occupied must be"),
        ({"resolution": 0.0}, "resolution"),
    ],
)
def test_inconsistent_runs_are_refused_by_name(change, words):
    good = ColumnRuns.from_dense(dense(["#.#"], nx=1))
    bad = {"z_lo": np.array([0, 2], np.int16), "z_hi": np.array([0, 2], np.int16)} | change
    with pytest.raises(ValueError, match=words):
        dataclasses.replace(good, **bad)


def test_dense_grid_of_wrong_shape_or_value_is_refused():
    for states in (np.zeros((2, 2), np.uint8), np.full((1, 1, 1), 3, np.uint8)):
        with pytest.raises(ValueError, match="unknown"):
            ColumnRuns.from_dense(states)
