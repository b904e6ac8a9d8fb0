"""Hardware or ideal: the two sets of values that the simulator starts from. Every default is that of hardware."""

from collections.abc import Mapping
from typing import TypeVar

from pybullet_simulation.config import SimulationConfig
from pybullet_simulation.timing_config import TimingConfig
from stage_config import ConfigError, load_config

C = TypeVar("C")

HARDWARE_OR_IDEAL = ("hardware", "ideal")

_IDEAL: dict[type, dict[str, object]] = {
    SimulationConfig: {
        "friction": 1.0,
        "wheel_radius_sigma": 0.0,
        "slip_patch_sigma": 0.0,
        "slip_per_climb": 0.0,
        "grip_patch_sigma": 0.0,
        "imu_accel_bias_walk_mps2": 0.0,
        "imu_gyro_bias_walk_rps": 0.0,
        "imu_gyro_scale_sigma": 0.0,
        "range_limit_m": 10.0,
        "range_limit_far_m": 10.0,
        "range_incidence_bias_m": 0.0,
        "range_step_m": 0.0,
        "tilt_backlash_rad": 0.0,
        "tilt_offset_sigma_rad": 0.0,
    },
    TimingConfig: {
        "phase_share": 0.0,
        "jitter_share": 0.0,
        "points_latency_s": 0.1,
        "imu_latency_s": 0.0,
        "joint_latency_s": 0.0,
        "wheel_latency_s": 0.0,
        "lost_share": 0.0,
        "doubled_share": 0.0,
    },
}


def realistic(cls: type[C], realism: str, values: Mapping[str, object]) -> C:
    """A configuration of the simulator: the values of `hardware` or `ideal`, and over them `values`.

    ConfigError for another realism, and as `load_config` raises it.
    """
    if realism not in HARDWARE_OR_IDEAL:
        raise ConfigError(f"realism = {realism!r} is none of {', '.join(HARDWARE_OR_IDEAL)}")
    start = _IDEAL.get(cls, {}) if realism == "ideal" else {}
    return load_config(cls, {**start, **values})


IDEAL = realistic(SimulationConfig, "ideal", {})
IDEAL_TIMING = realistic(TimingConfig, "ideal", {})
