"""The mount's drive: it nods between its ends without a jump, comes to rest level, and sweeps only from there."""

import numpy as np
import pytest

from pybullet_simulation.config import SimulationConfig
from pybullet_simulation.lidar_config import SpinningLidarConfig
from pybullet_simulation.mount_drive import MountDrive
from pybullet_simulation.sweep_profile import nod_moves, spinning_sweep_profile, sweep_profile, within_limits

CONFIG = SimulationConfig()
TICK_S, STEPS = 0.05, 12


def drive() -> MountDrive:
    return MountDrive(sweep_profile(CONFIG), nod_moves(CONFIG))


def run(mount: MountDrive, start_s: float, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and tilts, tick by tick, as the simulation asks."""
    times, tilts = [], []
    for tick in range(round(seconds / TICK_S)):
        now_s = start_s + tick * TICK_S
        t = now_s + np.arange(STEPS + 1) * TICK_S / STEPS
        times.append(t[1:])
        tilts.append(mount.tilts(t)[0][1:])
        mount.finish(now_s + TICK_S)
    return np.concatenate(times), np.concatenate(tilts)


def test_rests_level_until_asked() -> None:
    assert not run(drive(), 1.0, 1.0)[1].any()


def test_nod_goes_from_end_to_end_in_its_half_period_without_a_jump() -> None:
    mount = drive()
    mount.nod(True, 1.0)
    times, tilts = run(mount, 1.0, 20.0)
    assert (tilts.min(), tilts.max()) == pytest.approx((CONFIG.nod_highest_rad, CONFIG.nod_lowest_rad), abs=0.01)
    assert np.abs(np.diff(tilts)).max() < CONFIG.slew_rate_rps * TICK_S / STEPS * 1.01
    turns = times[1:-1][np.diff(np.sign(np.diff(tilts))) != 0]
    turns = turns[np.concatenate([[True], np.diff(turns) > 0.5])]
    assert np.diff(turns)[1:] == pytest.approx(CONFIG.nod_half_period_s, rel=0.1)


def test_no_move_leaves_what_the_joint_is_limited_to() -> None:
    config, lidar = within_limits(CONFIG, SpinningLidarConfig(), (-0.1, 0.9))
    assert lidar is not None
    nod = nod_moves(config)
    for move in (sweep_profile(config), spinning_sweep_profile(config, lidar), nod.begin, nod.up, nod.down, *nod.ends):
        assert -0.101 < move.tilts_rad.min() and move.tilts_rad.max() < 0.901
    assert within_limits(CONFIG, None, (-3.2, 3.2)) == (CONFIG, None)


def test_nod_that_is_stopped_comes_to_rest_level_and_a_sweep_begins_only_then() -> None:
    mount = drive()
    mount.nod(True, 1.0)
    run(mount, 1.0, 5.0)
    mount.nod(False, 6.0)
    with pytest.raises(ValueError, match="nods"):
        mount.start_sweep(6.0)
    _, tilts = run(mount, 6.0, 2 * CONFIG.nod_half_period_s)
    assert tilts[-1] == 0.0 and np.abs(np.diff(tilts)).max() < CONFIG.slew_rate_rps * TICK_S / STEPS * 1.01
    mount.start_sweep(6.0 + 2 * CONFIG.nod_half_period_s)
    assert mount.sweeping
    with pytest.raises(ValueError, match="sweep is running"):
        mount.nod(True, 11.0)
