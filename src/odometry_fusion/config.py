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
    forward_velocity_walk: float = parameter(0.3, "m/s^2/sqrt(Hz)", "how strongly the forward velocity changes unseen", low=1e-3)
    across_velocity_walk: float = parameter(0.2, "m/s^2/sqrt(Hz)", "how strongly the velocity sideways and up changes", low=1e-3)
    forward_sigma_mps: float = parameter(0.005, "m/s", "noise of the wheels' forward velocity", low=1e-4)
    lateral_sigma_mps: float = parameter(0.015, "m/s", "how far the sideways velocity strays from zero", low=1e-4)
    vertical_sigma_mps: float = parameter(0.015, "m/s", "how far the velocity along the body's z strays from zero", low=1e-4)
    turning_sigma_m: float = parameter(0.04, "m", "added to these sigmas for every rad/s of turning: skid steering slips", low=0.0)
    turning_slip_walk: float = parameter(
        0.15, "m/rad*sqrt(s)", "skidding of seconds: walk of the position, forward and sideways, for every rad/s of turning", low=0.0
    )
    forward_slip: float = parameter(0.0, "-", "known share of the wheels' forward velocity that is slip", low=-0.5, high=0.5)
    forward_slip_sigma: float = parameter(0.02, "-", "how far the true slip strays from it", low=1e-5, high=0.5)
    forward_slip_time_s: float = parameter(60.0, "s", "for how long it stays as it is, before terrain and load change it", low=0.1)
    yaw_rate_sigma: float = parameter(0.05, "rad/s", "noise of the wheels' yaw rate when straight", low=1e-3)
    yaw_rate_slip: float = parameter(0.5, "-", "added share of the wheels' yaw rate: skid steering turns less than its wheels", low=0.0)
    gravity_driving_sigma: float = parameter(0.5, "m/s^2", "noise of the gravity direction while driving quietly", low=1e-2)
    quiet_accel_mps2: float = parameter(0.5, "m/s^2", "specific force further than this from gravity says nothing about up", low=0.0)
    quiet_rate: float = parameter(0.25, "rad/s", "nor does one measured while turning faster", low=0.0)
    still_wheel_mps: float = parameter(0.005, "m/s", "wheels stand below this forward velocity", low=0.0)
    still_wheel_rate: float = parameter(0.01, "rad/s", "and below this yaw rate", low=0.0)
    still_gyro_rate: float = parameter(
        0.01, "rad/s", "and the body is still below this rate, bias removed, or below three sigmas of that and of noise", low=0.0
    )
    still_delay_s: float = parameter(0.5, "s", "for how long both before the robot counts as standing: one that rocks turns back", low=0.0)
    still_velocity_sigma_mps: float = parameter(1e-3, "m/s", "noise of the zero velocity while standing", low=1e-6)
    still_rate_sigma: float = parameter(2e-4, "rad/s", "noise of the zero rate while standing, beside the gyroscope's own", low=1e-7)
    max_imu_gap_s: float = parameter(0.1, "s", "a longer pause of the IMU adds gap_rate_sigma times its length to the attitude", low=1e-3)
    gap_rate_sigma: float = parameter(0.3, "rad/s", "how fast the robot may have turned unseen", low=0.0)
    max_wheel_gap_s: float = parameter(0.3, "s", "after a longer pause of the wheels nothing is known to have stood still", low=1e-3)
    displaced_window_s: float = parameter(
        0.5, "s", "over so long IMU and wheels are compared; over longer the attitude's error would count", low=0.1, high=5.0
    )
    displaced_m: float = parameter(
        0.15, "m", "a way within that time of which the wheels know nothing: somebody moves the robot, or it slides", low=0.02, high=10.0
    )
    displaced_share: float = parameter(
        0.15, "-", "beside it, as a share of the way that they rolled; rocks make three quarters of both at 0.7 m/s", low=0.0
    )
    displaced_up_m: float = parameter(0.1, "m", "the same upward or downward: somebody lifts it, or it falls", low=0.02, high=10.0)
    displaced_up_share: float = parameter(
        0.35, "-", "and beside it, as such a share; plates and ramps make three quarters of both", low=0.0
    )
    displaced_turn_rad: float = parameter(
        0.35, "rad", "a turn within that time of which they know nothing, beside yaw_rate_slip of theirs", low=0.05, high=6.0
    )
    displaced_tilt_rad: float = parameter(
        0.25, "rad", "so does a robot that tilts more while its wheels stand: one that slips off its highest step tilts by 0.2", low=0.05
    )
    displaced_standing_m: float = parameter(0.05, "m", "wheels that roll less stand", low=0.0, high=1.0)
    displaced_rest_mps2: float = parameter(0.3, "m/s^2", "it is over after still_delay_s without a stronger acceleration", low=0.01)
    displaced_rest_rate: float = parameter(0.05, "rad/s", "and without a faster turn", low=0.001)
    displaced_sigma_m: float = parameter(
        5.0, "m", "nothing is known of the way then; sigma that it adds to the position, sample by sample", low=1.0, high=1000.0
    )
    buffer_s: float = parameter(60.0, "s", "oldest data kept while the other topic is silent", low=1.0)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self)
