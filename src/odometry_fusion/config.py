"""Noise and thresholds of the odometry: the only home of their defaults."""

from dataclasses import dataclass

from stage_config import check_ranges, parameter


@dataclass(frozen=True)
class OdometryConfig:
    """Noise densities are per root of a hertz: a sample's sigma divided by the root of the rate."""

    gravity_mps2: float = parameter(9.81, "m/s^2", "local gravity", low=9.0, high=10.0)
    gyro_noise: float = parameter(5e-4, "rad/s/sqrt(Hz)", "white noise of the gyroscope", low=1e-7)
    gyro_bias_sigma: float = parameter(0.005, "rad/s", "how large the gyroscope's bias may be at the start", low=1e-7)
    gyro_bias_walk: float = parameter(1e-5, "rad/s/sqrt(s)", "how fast that bias wanders", low=0.0)
    accel_noise: float = parameter(5e-3, "m/s^2/sqrt(Hz)", "white noise of the accelerometer", low=1e-6)
    accel_bias_sigma: float = parameter(0.05, "m/s^2", "how large the accelerometer's bias may be; tilts the map by bias / g", low=1e-5)
    accel_bias_walk: float = parameter(1e-4, "m/s^2/sqrt(s)", "how fast that bias wanders", low=0.0)
    forward_sigma_mps: float = parameter(0.005, "m/s", "noise of the wheels' forward velocity", low=1e-4)
    lateral_sigma_mps: float = parameter(0.015, "m/s", "how far the sideways velocity strays from zero", low=1e-4)
    vertical_sigma_mps: float = parameter(0.015, "m/s", "how far the velocity along the body's z strays from zero", low=1e-4)
    turning_sigma_m: float = parameter(0.04, "m", "added to these sigmas for every rad/s of turning: skid steering slips", low=0.0)
    turning_slip_walk: float = parameter(
        0.15, "m/rad*sqrt(s)", "skidding of seconds: walk of the position, forward and sideways, for every rad/s of turning", low=0.0
    )
    forward_slip: float = parameter(0.0, "-", "known share of the wheels' forward velocity that is slip", low=-0.5, high=0.5)
    forward_slip_sigma: float = parameter(0.02, "-", "how far the true slip strays from it", low=1e-5, high=0.5)
    yaw_rate_sigma: float = parameter(0.05, "rad/s", "noise of the wheels' yaw rate when straight", low=1e-3)
    yaw_rate_slip: float = parameter(0.5, "-", "added share of the wheels' yaw rate: skid steering turns less than its wheels", low=0.0)
    still_wheel_mps: float = parameter(0.005, "m/s", "wheels stand below this forward velocity", low=0.0)
    still_wheel_rate: float = parameter(0.01, "rad/s", "and below this yaw rate", low=0.0)
    still_gyro_rate: float = parameter(
        0.01, "rad/s", "and the body is still below this rate, bias removed, or below three sigmas of that and of noise", low=0.0
    )
    still_delay_s: float = parameter(0.5, "s", "for how long both before the robot counts as standing: one that rocks turns back", low=0.0)
    max_imu_gap_s: float = parameter(0.1, "s", "a longer pause of the IMU adds 0.3 rad/s times its length to the attitude", low=1e-3)
    max_wheel_gap_s: float = parameter(0.3, "s", "after a longer pause of the wheels nothing is known to have stood still", low=1e-3)
    buffer_s: float = parameter(60.0, "s", "oldest data kept while the other topic is silent", low=1.0)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self)
