"""Parameters of the simulated robot and its sensors; the world is chosen by name and seed, not here."""

from dataclasses import dataclass

from pybullet_simulation.disturbances import disturbances_of
from robot_body import LEAST_TILT_RAD
from stage_config import check_below, check_ranges, parameter


@dataclass(frozen=True)
class SimulationConfig:
    """What the robot's drive and sensors are like beside `RobotBody`; shapes, masses and mounting poses are those of its URDF."""

    physics_rate_hz: int = parameter(
        200, "Hz", "steps of the physics; a multiple of 200, so that the 100 Hz of the IMU fall on steps", low=200, high=1000
    )
    clock_start_s: float = parameter(0.0, "s", "what the clock says at the start: a session that goes on is later than its sweeps", low=0.0)
    friction: float = parameter(
        0.85, "-", "friction coefficient of wheels and ground, combined: dry concrete in Wong, Theory of Ground Vehicles", low=0.1, high=2.0
    )
    lateral_friction_ratio: float = parameter(
        0.5, "-", "sideways friction of a tyre as a share of the one along it, on average over the ground", low=0.05, high=1.0
    )
    wheel_torque_nm: float = parameter(60.0, "N m", "most torque of a wheel's motor", low=1.0, high=500.0)
    caster_friction: float = parameter(
        0.02, "-", "friction of a caster that is a ball, as a share of a wheel's: ball casters roll with 0.01 to 0.03", low=0.0, high=1.0
    )
    command_timeout_s: float = parameter(
        0.25,
        "s",
        "after it without a new command the drive is told to stand; cmd_vel_timeout of husky_control's diff_drive_controller",
        low=0.05,
        high=10.0,
    )
    wheel_radius_sigma: float = parameter(
        0.01, "-", "how far the wheels' radius is off, drawn once a run: pressure, load and wear of pneumatic tyres", low=0.0, high=0.1
    )
    slip_bias_sigma: float = parameter(0.008, "-", "constant slip of a side of wheels, drawn once a run", low=0.0, high=0.2)
    slip_sigma: float = parameter(0.015, "-", "changing slip of a side of wheels", low=0.0, high=0.2)
    slip_correlation_s: float = parameter(2.0, "s", "time over which the changing slip stays alike", low=0.05, high=100.0)
    slip_patch_sigma: float = parameter(
        0.015, "-", "slip that goes with the place: patches of ground that hold less or more", low=0.0, high=0.2
    )
    slip_per_climb: float = parameter(
        0.1,
        "-",
        "slip uphill, for each unit of the slope's sine, and its opposite downhill; firm soil in Wong and Ishigami",
        low=0.0,
        high=1.0,
    )
    grip_patch_sigma: float = parameter(
        0.2, "-", "how far the sideways friction of such patches differs, as a share; it makes the robot slide aside", low=0.0, high=0.5
    )
    imu_accel_bias_sigma_mps2: float = parameter(
        0.02, "m/s^2", "bias of each accelerometer axis, drawn once a run; 0.02 tilts the level by 0.16 deg", low=0.0, high=1.0
    )
    imu_accel_sigma_mps2: float = parameter(0.03, "m/s^2", "noise of an accelerometer sample", low=0.0, high=1.0)
    imu_accel_bias_walk_mps2: float = parameter(
        5e-5, "m/s^2/sqrt(s)", "how fast that bias wanders; a VN-100's is stable to 4e-4 m/s^2", low=0.0, high=0.1
    )
    imu_gyro_bias_sigma_rps: float = parameter(0.0015, "rad/s", "bias of each gyro axis, drawn once a run", low=0.0, high=0.1)
    imu_gyro_sigma_rps: float = parameter(0.002, "rad/s", "noise of a gyro sample", low=0.0, high=0.1)
    imu_gyro_bias_walk_rps: float = parameter(
        4e-5, "rad/s/sqrt(s)", "how fast that bias wanders; a VN-100's is stable to 5 to 10 deg/h, 4e-5 rad/s", low=0.0, high=0.01
    )
    imu_gyro_scale_sigma: float = parameter(
        0.005,
        "-",
        "how far the scale of each gyro axis is off, drawn once a run; data sheets of MEMS gyros say 0.1 to 1 %",
        low=0.0,
        high=0.05,
    )
    range_min_m: float = parameter(0.1, "m", "nearer returns are reported as -inf", low=0.01, high=1.0)
    range_max_m: float = parameter(30.0, "m", "farther returns are reported as inf", low=1.0, high=100.0)
    range_sigma_m: float = parameter(0.01, "m", "noise of a range up to 10 m: 1 sigma in the data sheet of a UTM-30LX", low=0.0, high=0.5)
    range_sigma_far_m: float = parameter(0.03, "m", "noise of a range beyond 10 m, from the same sheet", low=0.0, high=0.5)
    range_limit_m: float = parameter(
        0.03, "m", "no range up to 10 m is off by more, depth edges apart: the accuracy in that sheet", low=0.0, high=10.0
    )
    range_limit_far_m: float = parameter(0.05, "m", "nor one beyond 10 m by more than this", low=0.0, high=10.0)
    range_incidence_bias_m: float = parameter(
        0.01,
        "m",
        "what a range at grazing incidence is too long by; goes with 1 - cos (Pomerleau et al. 2012, Laconte et al. 2019)",
        low=-0.1,
        high=0.1,
    )
    reflectivity: float = parameter(
        0.0,
        "-",
        "share of the light that surfaces throw back, all alike: echoes that are too faint are reported as inf; 0: none is too faint",
        low=0.0,
        high=1.0,
    )
    range_step_m: float = parameter(
        0.001, "m", "ranges are whole multiples of it: a Hokuyo sends millimetres; 0 for none", low=0.0, high=0.1
    )
    veiling_probability: float = parameter(
        0.2,
        "-",
        "share of the beams at a depth edge that return a range between both surfaces: mixed pixels (Ye and Borenstein 2002)",
        low=0.0,
        high=1.0,
    )
    tilt_encoder_sigma_rad: float = parameter(0.0001, "rad", "noise of the measured tilt", low=0.0, high=0.05)
    tilt_backlash_rad: float = parameter(
        0.0052, "rad", "play of the tilt drive, from one side to the other: 0.3 deg, a hobby servo or a worn gear", low=0.0, high=0.1
    )
    tilt_offset_sigma_rad: float = parameter(
        0.00175, "rad", "true tilt where the encoder says zero, drawn once a run: 0.1 deg, set once at the factory", low=0.0, high=0.1
    )
    mount_tilt_scale: float = parameter(
        1.0,
        "-",
        "true over measured tilt: how the mount differs from what the robot believes of it, unseen but in the ranges",
        low=0.9,
        high=1.1,
    )
    mount_roll_rad: float = parameter(0.0, "rad", "true roll of the mount beside that of the robot description", low=-0.1, high=0.1)
    sweep_start_rad: float = parameter(
        2.88, "rad", "tilt at which the slow part of a sweep starts, looking down behind the robot", low=1.6, high=3.05
    )
    sweep_end_rad: float = parameter(-0.61, "rad", "tilt at which the slow part ends, looking up in front", low=-0.79, high=0.0)
    sweep_min_rate_rps: float = parameter(
        0.3, "rad/s", "tilt rate with the scan plane level: few ground lines far away", low=0.05, high=4.0
    )
    sweep_max_rate_rps: float = parameter(
        2.4,
        "rad/s",
        "tilt rate with the scan plane upright; in between it goes with sin^2(tilt)",
        low=0.05,
        high=4.0,
    )
    slew_rate_rps: float = parameter(3.5, "rad/s", "tilt rate on the way to the start of a sweep and back to level", low=0.1, high=4.0)
    nod_lowest_rad: float = parameter(
        1.05, "rad", "tilt at the lower end of a nod, down to the ground before the wheels", low=LEAST_TILT_RAD, high=1.5
    )
    nod_highest_rad: float = parameter(-0.26, "rad", "tilt at the upper end of a nod", low=-0.79, high=0.0)
    nod_half_period_s: float = parameter(2.0, "s", "time of a nod from one end to the other", low=0.5, high=20.0)
    tilt_acceleration_rps2: float = parameter(30.0, "rad/s^2", "acceleration of the tilt drive", low=1.0, high=500.0)
    disturbances: str = parameter(
        "",
        "-",
        "what somebody does to the robot, for tests: KIND AT AMOUNT, more after commas; AT in seconds since the simulator's start, "
        "AMOUNT of lift and push in m, of tilt in deg, of ice in s: push 40 0.5, lift 60 2",
    )

    def validate(self) -> list[str]:
        """All violations, as sentences; empty when the configuration can be used."""
        problems = check_ranges(self)
        if self.physics_rate_hz % 200:
            problems.append(f"physics_rate_hz = {self.physics_rate_hz} is no multiple of 200")
        if self.sweep_min_rate_rps > self.sweep_max_rate_rps:
            problems.append(f"sweep_min_rate_rps = {self.sweep_min_rate_rps} is above sweep_max_rate_rps = {self.sweep_max_rate_rps}")
        problems += check_below(self, "range_min_m", "range_max_m")
        try:
            disturbances_of(self.disturbances)
        except ValueError as error:
            problems.append(str(error))
        return problems
