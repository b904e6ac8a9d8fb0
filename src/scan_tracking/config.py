"""What tracking believes of odometry, ranges and map, and when it refuses: the only home of these defaults."""

from dataclasses import dataclass

from stage_config import check_below, check_ranges, parameter


@dataclass(frozen=True)
class ScanTrackingConfig:
    """Errors of odometry are random walks: their variance grows with the way and with the turn, whatever the bundles' length."""

    bundle_s: float = parameter(0.1, "s", "readings of so long are matched together while the robot moves", low=0.02, high=1.0)
    most_wait_s: float = parameter(
        0.3, "s", "after it a bundle is closed without the readings or tilts that have not come", low=0.0, high=5.0
    )
    most_gap_s: float = parameter(0.16, "s", "a bundle with a longer pause of odometry or tilts is not matched", low=0.01, high=5.0)

    ground_walk: float = parameter(0.03, "m/sqrt(m)", "error of odometry's position forward and sideways, by the way", low=1e-4, high=1.0)
    skid_walk: float = parameter(0.08, "m/sqrt(rad)", "the same by the turn: a skid steer slides aside", low=1e-4, high=1.0)
    height_walk: float = parameter(0.01, "m/sqrt(m)", "error of its position along the body's z, by the way", low=1e-4, high=1.0)
    yaw_walk: float = parameter(0.003, "rad/sqrt(m)", "error of its heading, by the way", low=1e-5, high=0.1)
    gyro_walk: float = parameter(0.005, "rad/sqrt(rad)", "the same by the turn: scale of the gyroscope", low=1e-5, high=0.1)
    tilt_walk: float = parameter(0.001, "rad/sqrt(m)", "error of roll and pitch, by the way in m and the turn in rad", low=1e-5, high=0.1)
    start_sigma_m: float = parameter(0.01, "m", "of the position at the first sample", low=1e-4, high=1.0)
    start_sigma_rad: float = parameter(0.005, "rad", "of the attitude at the first sample", low=1e-5, high=0.5)

    cell_m: float = parameter(
        0.1, "m", "map and bundles are thinned to one point a cell, the map to one a cell and face", low=0.02, high=1.0
    )
    min_range_m: float = parameter(0.5, "m", "nearer points are not matched", low=0.0, high=10.0)
    max_range_m: float = parameter(30.0, "m", "nor are farther ones", low=1.0, high=100.0)
    reach_m: float = parameter(0.2, "m", "largest distance of a point to its partner: two cells", low=0.05, high=2.0)
    gate_sigmas: float = parameter(
        3.0, "-", "a point farther off its surface than so many sigmas, the prior's counted in, has none", low=1.0, high=100.0
    )
    point_sigma_m: float = parameter(0.015, "m", "error of a point against its surface that is its own: range noise", low=1e-3, high=0.5)
    patch_sigma_m: float = parameter(0.01, "m", "error that all points of a patch have in common: map and mount", low=0.0, high=0.5)
    beam_sigma_rad: float = parameter(
        0.003, "rad", "error of the beams' direction, common to a patch: the mount's zero and play", low=0.0, high=0.1
    )
    most_sigmas: float = parameter(5.0, "-", "a correction of more sigmas of the prior, in six dimensions, is refused", low=1.0, high=100.0)

    own_every_m: float = parameter(1.0, "m", "way after which surfaces that the map lacks are put down; 0: never", low=0.0, high=20.0)

    most_speed_mps: float = parameter(3.0, "m/s", "odometry that moves faster has jumped", low=0.1, high=50.0)
    most_turn_rps: float = parameter(
        3.0,
        "rad/s",
        "so has one that turns faster; at both limits a jump of 0.5 m or 30 deg shows over two lost messages",
        low=0.1,
        high=50.0,
    )
    buffer_s: float = parameter(5.0, "s", "oldest data kept while another topic is silent", low=1.0)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self) + check_below(self, "min_range_m", "max_range_m")
