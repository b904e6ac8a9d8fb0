"""What of a sweep goes into the octree."""

from dataclasses import dataclass

from stage_config import check_ranges, parameter


@dataclass(frozen=True)
class MapConfig:
    """Octree and cropping; `resolution` is octomap_server's parameter."""

    resolution: float = parameter(0.08, "m", "edge of a voxel", low=0.01, high=1.0)
    max_range_m: float = parameter(12.0, "m", "rays free voxels up to this range", low=0.5, high=100.0, at_runtime=True)
    crop_half_m: float = parameter(
        7.0,
        "m",
        "half side of the cuboid around the robot in which a sweep is dense enough to be inserted",
        low=1.0,
        high=100.0,
        at_runtime=True,
    )
    crop_below_m: float = parameter(4.0, "m", "how far below the robot the cuboid reaches", low=0.5, high=50.0)
    crop_above_m: float = parameter(4.0, "m", "how far above the robot the cuboid reaches", low=0.5, high=50.0)
    start_plane_half_m: float = parameter(
        0.8, "m", "half side of the plane put under the robot at the start, where the laser is blind", low=0.0, high=3.0
    )
    start_plane_most_m: float = parameter(
        2.0, "m", "it reaches as far as the nearest ground that the first sweep shows, but no farther than this", low=0.0, high=5.0
    )

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        found = check_ranges(self)
        if self.start_plane_most_m < self.start_plane_half_m:
            found.append(f"start_plane_most_m = {self.start_plane_most_m} is below start_plane_half_m = {self.start_plane_half_m}")
        return found
