"""Parameters of the 3-D mapping stage: one dataclass for the ICP matcher, one for the mapper. The only home of their defaults."""

import math
from dataclasses import dataclass

from stage_config import check_below, check_ranges, parameter


@dataclass(frozen=True)
class RegistrationConfig:
    """What `match_clouds` does; `chain_*` concern only the method "thesis_chain" (figure 5.7)."""

    method: str = parameter("gicp", "-", "registration behind match_clouds", choices=("gicp", "thesis_chain"))
    voxel_m: float = parameter(0.10, "m", "edge of the voxels both clouds are averaged in", low=0.01, high=1.0)
    coarse_distance_m: float = parameter(1.0, "m", "largest distance of matched points, first stage", low=0.01)
    fine_distance_m: float = parameter(0.3, "m", "largest distance of matched points, second stage", low=0.01)
    search_shift_m: float = parameter(
        3.0, "m", "horizontal half width of the search around a guess of which nothing is known", low=0.0, high=20.0
    )
    search_wide_m: float = parameter(
        7.5, "m", "the same once more where less than `min_overlap_unguided` overlapped: then `min_overlap` is enough", low=0.0, high=50.0
    )
    search_height_m: float = parameter(1.0, "m", "half height of the search", low=0.0, high=10.0)
    search_range_m: float = parameter(15.0, "m", "farther points of the reading are not placed", low=1.0, high=100.0)

    degenerate_eigenvalue: float = parameter(
        1.5, "-", "Hessian eigenvalue by inlier under which a direction is unconstrained (0.5 is nothing)", low=0.0
    )
    pattern_rotation_factor: float = parameter(
        6.0,
        "-",
        "sigma about a level axis, in angles by which residuals differ from direction to direction: a bent sweep is no noise",
        low=0.0,
    )
    pattern_yaw_factor: float = parameter(0.3, "-", "the same about the upright axis, which a tilting mount hardly turns", low=0.0)
    pattern_translation_m: float = parameter(7.0, "m/rad", "the same for a translation", low=0.0)
    pattern_good_rad: float = parameter(math.radians(0.027), "rad", "how much of that angle a mount leaves that is not off", low=0.0)
    floor_rotation_rad: float = parameter(math.radians(0.0125), "rad", "sigma of a match that no number of points improves", low=1e-5)
    floor_translation_m: float = parameter(0.00045, "m", "the same for translation", low=1e-5)

    verdict: str = parameter(
        "checked", "-", "checked: overlap, free space, degeneracy; match_ratio: that alone (thesis)", choices=("checked", "match_ratio")
    )
    min_match_ratio: float = parameter(0.5, "-", "least match ratio where it alone decides", low=0.0, high=1.0, at_runtime=True)
    min_overlap: float = parameter(0.2, "-", "least share of overlapping reading points", low=0.0, high=1.0, at_runtime=True)
    min_overlap_unguided: float = parameter(
        0.5, "-", "the same where nothing is known of the guess: the truth may lie where no match looks", low=0.0, high=1.0, at_runtime=True
    )
    misfit_m: float = parameter(0.05, "m", "an overlapping point so far off the reference's surface does not lie on it", low=0.001)
    max_misfit: float = parameter(
        0.15, "-", "largest share of such points: similar ground is not the same", low=0.0, high=1.0, at_runtime=True
    )
    max_misfit_ratio: float = parameter(
        2.0, "-", "or so many times the share of a cloud's own points that lie so far off their neighbours' planes", low=0.0
    )
    max_contradiction: float = parameter(
        0.012, "-", "largest share of points in space the other cloud saw free", low=0.0, high=1.0, at_runtime=True
    )
    max_changed: float = parameter(
        0.1,
        "-",
        "the same where things moved or sensors are worse than that, if the four limits below hold; no match above it is refined in full",
        low=0.0,
        high=1.0,
    )
    misfit_noise: float = parameter(
        1.5,
        "-",
        "a point lies on a surface up to so many times what 95 % of a cloud's own points lie off their neighbours' planes",
        low=0.0,
    )
    min_explained: float = parameter(
        0.5, "-", "least share that agrees of the compared points, by what they hold of the motion that they hold least", low=0.0, high=1.0
    )
    min_surfaces: float = parameter(
        35.0, "-", "least number of different surfaces that agree where nothing is known of the guess: twin rooms share few", low=0.0
    )
    max_rival_share: float = parameter(
        0.5,
        "-",
        "largest part of what it explains that another placement may explain, where the guess allows one",
        low=0.0,
        high=1.0,
        at_runtime=True,
    )
    free_space_viewpoints: int = parameter(6, "-", "most standpoints of a cloud that are checked, nearest first", low=1, high=100)
    standpoint_m: float = parameter(
        0.5,
        "m",
        "beams that start so near to each other have one standpoint; smaller for sweeps made while driving",
        low=0.05,
        high=2.0,
    )

    chain_min_range_m: float = parameter(0.3, "m", "shorter beams are dropped", low=0.0)
    chain_max_range_m: float = parameter(30.0, "m", "longer beams are dropped", low=0.1)
    chain_degenerate_share: float = parameter(
        0.0035, "-", "eigenvalue by match (1: every point holds it) under which a direction is unconstrained", low=0.0, high=1.0
    )

    def validate(self) -> list[str]:
        """Every violation, as sentences; empty when the values can be used."""
        found = check_ranges(self)
        if self.fine_distance_m > self.coarse_distance_m:
            found.append(f"fine_distance_m = {self.fine_distance_m} is above coarse_distance_m = {self.coarse_distance_m}")
        return found + check_below(self, "chain_min_range_m", "chain_max_range_m")


@dataclass(frozen=True)
class MappingConfig:
    """Algorithms 1 and 2, the graph and what is saved."""

    graph_dist_m: float = parameter(8.0, "m", "clouds of vertices this near along the graph make the area cloud (Alg. 1)", low=0.1)
    area_most_sweeps: int = parameter(
        80,
        "-",
        "of more that are so near the area has evenly many from the oldest to the newest: who stays in one place for hours has thousands. "
        "An exploring robot has at most 78, in ramp",
        low=5,
    )
    num_icp_tries: int = parameter(
        3, "-", "tries of a match: area, last sweep alone, area of twice the distance (Alg. 1, line 15)", low=1, high=3
    )
    vertex_voxel_m: float = parameter(0.10, "m", "voxels of the cloud kept with a vertex", low=0.01, high=1.0)
    max_correction_m: float = parameter(1.5, "m", "a match that moves the prediction by more is refused", low=0.01)
    max_correction_rad: float = parameter(0.9, "rad", "a match that turns the prediction by more is refused", low=0.01, high=math.pi)

    odometry_sigma_m: float = parameter(0.02, "m", "translation sigma of an odometry edge at no motion", low=1e-4)
    odometry_sigma_per_m: float = parameter(0.05, "m/m", "what a metre driven adds", low=0.0)
    odometry_sigma_per_rad: float = parameter(0.03, "m/rad", "what a radian turned adds", low=0.0)
    odometry_tilt_sigma_rad: float = parameter(math.radians(1.0), "rad", "roll and pitch sigma of an odometry edge", low=1e-4)
    odometry_yaw_sigma_rad: float = parameter(math.radians(1.0), "rad", "yaw sigma of an odometry edge at no motion", low=1e-4)
    odometry_yaw_per_rad: float = parameter(0.10, "rad/rad", "what a radian turned adds", low=0.0)
    odometry_yaw_per_m: float = parameter(0.01, "rad/m", "what a metre driven adds", low=0.0)
    gone_sweeps: int = parameter(
        2,
        "-",
        "sweeps that have to look through a point of an older one, until it counts as gone and is left out; 0: none is",
        low=0,
        high=100,
    )

    use_gravity: bool = parameter(True, "-", "every vertex is tied to the up direction that the resting IMU measured")
    gravity_sigma_rad: float = parameter(
        math.radians(0.5), "rad", "sigma of the measured up direction where the caller gives none", low=1e-4
    )
    gravity_time_s: float = parameter(
        25.0, "s", "for so long that direction is off in the same way: sweeps within that time count as one measurement", low=0.0
    )
    gravity_bias_sigma_rad: float = parameter(
        math.radians(0.3), "rad", "how far it may be off in common, fixed in the body as an accelerometer's bias is; 0: not", low=0.0
    )

    loop_min_dist_m: float = parameter(8.0, "m", "least distance along the graph of a loop candidate (Alg. 2)", low=0.0)
    loop_max_dist_m: float = parameter(5.0, "m", "largest straight distance of a loop candidate (Alg. 2)", low=0.1)
    loop_grown_dist_m: float = parameter(10.0, "m", "largest straight distance of a loop candidate however uncertain it is", low=0.1)
    loop_min_dist_match: int = parameter(3, "-", "least number of vertices between both ends of a loop (Alg. 2, line 7)", low=1)
    loop_match_success: float = parameter(0.5, "-", "least match ratio of a loop (Alg. 2, line 16)", low=0.0, high=1.0)
    loose_sigma_m: float = parameter(
        0.1,
        "m",
        "sigma of a leg above which sweeps on both sides make no area together, and are matched, though too near for a loop",
        low=0.0,
    )
    outlier_chi2: float = parameter(
        30.0,
        "-",
        "squared Mahalanobis distance (6 degrees of freedom) beyond which a match or loop contradicts the rest and is left out",
        low=1.0,
    )

    map_voxel_m: float = parameter(0.04, "m", "voxels of the saved cloud", low=0.01, high=1.0)

    def validate(self) -> list[str]:
        """Every violation, as sentences; empty when the values can be used."""
        found = check_ranges(self)
        if self.loop_grown_dist_m < self.loop_max_dist_m:
            found.append(f"loop_grown_dist_m = {self.loop_grown_dist_m} is below loop_max_dist_m = {self.loop_max_dist_m}")
        return found
