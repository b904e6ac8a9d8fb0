"""octomap_server's parameters: those with a meaning here, and those without, which are named once; so that its YAML files load."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace

from octomap_server_3dnav.octree.map_builder import MapConfig
from octomap_server_3dnav.octree.sensor_model import SensorModel
from stage_config import parameter

_NO_LIMIT_M = 1e6
_CROPS = ("max_range_m", "crop_half_m", "crop_below_m", "crop_above_m")


def _limit(low: bool, what: str, *, at_runtime: bool = False) -> float:
    default, meaning = (-_NO_LIMIT_M, f"least {what}") if low else (_NO_LIMIT_M, f"greatest {what}")
    return parameter(default, "m", meaning, low=-_NO_LIMIT_M, high=_NO_LIMIT_M, at_runtime=at_runtime)


@dataclass(frozen=True)
class OctomapServerConfig(MapConfig):
    """Octree and cropping. `frame_id` and what follows it are octomap_server's, as is `resolution`."""

    frame_id: str = parameter("", "-", "frame of the octree and of all that is made of it; empty: that of /frames/map")
    base_frame_id: str = parameter("", "-", "frame of the robot, base_height_m above its ground; empty: that of /frames/base")
    sensor_frame_id: str = parameter("", "-", "frame in whose origin the beams of cloud_in begin; empty: that of the cloud")
    pointcloud_min_x: float = _limit(True, "x, in map, of a point of cloud_in that counts")
    pointcloud_max_x: float = _limit(False, "x")
    pointcloud_min_y: float = _limit(True, "y")
    pointcloud_max_y: float = _limit(False, "y")
    pointcloud_min_z: float = _limit(True, "z", at_runtime=True)
    pointcloud_max_z: float = _limit(False, "z", at_runtime=True)
    occupancy_min_z: float = _limit(
        True, "z of the voxels' middles in occupied_cells_vis_array, free_cells_vis_array and the centres", at_runtime=True
    )
    occupancy_max_z: float = _limit(False, "z of them", at_runtime=True)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        pairs = [
            (f"{name}_min_{axis}", f"{name}_max_{axis}") for name, axes in (("pointcloud", "xyz"), ("occupancy", "z")) for axis in axes
        ]
        found = [(low, getattr(self, low), high, getattr(self, high)) for low, high in pairs]
        return super().validate() + [f"{low} = {a} is above {high} = {b}" for low, a, high, b in found if a > b]


@dataclass(frozen=True)
class OctomapServerSensorModel(SensorModel):
    """octomap_server's `sensor_model/*`, and what grazing rays may not erase."""

    max_range: float = parameter(
        -1.0,
        "m",
        "if positive, in place of max_range_m and of what the cloud is cropped to: octomap_server's only limit",
        low=-1.0,
        high=100.0,
        at_runtime=True,
    )
    min_range: float = parameter(0.0, "m", "points of cloud_in that are nearer to their sensor are left out", low=-1.0, high=100.0)


def reaching(config: OctomapServerConfig, max_range_m: float) -> OctomapServerConfig:
    """The configuration with octomap_server's range, if there is one: as far as that, and no farther, a cloud is inserted."""
    if max_range_m <= 0.0:
        return config
    most = {f.name: (f.metadata["low"], f.metadata["high"]) for f in fields(config) if f.name in _CROPS}
    return replace(config, **{name: min(max(max_range_m, low), high) for name, (low, high) in most.items()})


WITHOUT_MEANING: dict[str, str] = {
    "latch": "all topics of the map are latched",
    "compress_map": "the tree is always pruned",
    "publish_free_space": "free_cells_vis_array is made when somebody listens",
    "incremental_2D_projection": "projected_map is made anew, of classified terrain",
    "min_x_size": "projected_map is as large as the terrain",
    "min_y_size": "projected_map is as large as the terrain",
    "filter_ground": "terrain is classified, and the ground stays in the map",
    "ground_filter": "terrain is classified, and the ground stays in the map",
    "filter_speckles": "a single voxel is an obstacle until beams have passed through it",
    "height_map": "occupied voxels have one colour; terrain_markers has the classes",
    "use_height_map": "occupied voxels have one colour; terrain_markers has the classes",
    "colored_map": "clouds are read without their colours",
    "use_colored_map": "clouds are read without their colours",
    "color_factor": "occupied voxels have one colour; terrain_markers has the classes",
    "color": "occupied voxels have one colour; terrain_markers has the classes",
    "color_free": "free voxels have one colour",
    "max_depth": "the tree is published whole",
    "queue_size": "five clouds wait",
    "sensor_model/occupancy_treshold": "a voxel is occupied above 0.5",
    "sensor_model/occupancy_threshold": "a voxel is occupied above 0.5",
}
"""Parameters of octomap_server that decide nothing here, and why."""


def without_meaning(section: str = "") -> tuple[str, ...]:
    """Their names in a section."""
    return tuple(path.rpartition("/")[2] for path in WITHOUT_MEANING if path.rpartition("/")[0] == section)


def named(values: Mapping[str, object]) -> Iterator[str]:
    """A sentence for each parameter that is set, sections one level deep, and decides nothing."""
    for path, reason in WITHOUT_MEANING.items():
        section, _, name = path.rpartition("/")
        part = values.get(section, {}) if section else values
        if isinstance(part, dict) and name in part:
            yield f"~{path} decides nothing here: {reason}"
