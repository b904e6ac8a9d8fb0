"""What a beam says of the voxels that it met and crossed, as probabilities."""

from dataclasses import dataclass

from stage_config import check_ranges, parameter


@dataclass(frozen=True)
class SensorModel:
    """What one sweep says about a voxel: octomap_server's `sensor_model/*` and what grazing rays may not erase."""

    hit: float = parameter(
        0.7, "-", "probability of a voxel in which a beam ended; higher: one hit is worth more misses", low=0.5, high=0.999, at_runtime=True
    )
    miss: float = parameter(
        0.47,
        "-",
        "probability of a voxel that beams only crossed: they may have passed over the floor in it; lower: more floor is lost again",
        low=0.001,
        high=0.5,
        at_runtime=True,
    )
    through: float = parameter(
        0.28,
        "-",
        "the same of a voxel where the sweep saw all that is beside it, too: what stood there has gone; as miss: off",
        low=0.001,
        high=0.5,
        at_runtime=True,
    )
    min: float = parameter(
        0.45,
        "-",
        "lower clamping probability: so free a voxel can get; lower: floor over which beams have passed often must be hit more often",
        low=0.001,
        high=0.5,
        at_runtime=True,
    )
    min_through: float = parameter(
        0.06,
        "-",
        "the same where sweeps saw all that is beside it, too: what steps in there later must be hit more often; as min: off",
        low=0.001,
        high=0.5,
        at_runtime=True,
    )
    max: float = parameter(
        0.97, "-", "upper clamping probability; lower: occupied voxels are revised sooner", low=0.5, high=0.999, at_runtime=True
    )
    grazing_m: float = parameter(
        2.0,
        "m",
        "for this length before its end a ray frees no voxel in the layer of the surface it hits, so that flat rays keep the ground; "
        "should exceed resolution * range / sensor height; 0: off",
        low=0.0,
    )

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self)
