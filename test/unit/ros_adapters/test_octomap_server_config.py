"""octomap_server's parameter files: what has a meaning here is obeyed, what has none is named, and a typo is neither."""

import pytest

from ros_adapters.octomap_server_config import OctomapServerConfig, OctomapServerSensorModel, named, reaching, without_meaning
from stage_config import ConfigError, load_config


def test_range_of_octomap_server_stands_for_ours_and_for_what_is_cropped() -> None:
    c = reaching(OctomapServerConfig(), 5.0)
    assert (c.max_range_m, c.crop_half_m, c.crop_below_m, c.crop_above_m) == (5.0, 5.0, 5.0, 5.0)
    far = reaching(OctomapServerConfig(), 80.0)
    assert (far.max_range_m, far.crop_half_m, far.crop_below_m) == (80.0, 80.0, 50.0) and not far.validate()
    assert reaching(OctomapServerConfig(), -1.0) == OctomapServerConfig()


def test_limits_the_wrong_way_round_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"pointcloud_min_x = 2.0 is above pointcloud_max_x = 1.0"):
        load_config(OctomapServerConfig, {"pointcloud_min_x": 2.0, "pointcloud_max_x": 1.0})
    with pytest.raises(ConfigError, match="occupancy_min_z"):
        load_config(OctomapServerConfig, {"occupancy_min_z": 3.0, "occupancy_max_z": 1.0})


def test_each_parameter_without_meaning_is_named_once_with_its_reason() -> None:
    values = {"latch": False, "color": {"r": 1.0}, "resolution": 0.05, "sensor_model": {"occupancy_treshold": 0.5, "hit": 0.7}}
    found = list(named(values))
    assert [sentence.split()[0] for sentence in found] == ["~latch", "~color", "~sensor_model/occupancy_treshold"]
    assert all(": " in sentence for sentence in found)


def test_typo_of_a_name_without_meaning_is_told_what_it_may_mean() -> None:
    with pytest.raises(ConfigError, match="unknown parameter compres_map, did you mean compress_map"):
        load_config(OctomapServerConfig, {"compres_map": True}, others=without_meaning())
    with pytest.raises(ConfigError, match="unknown parameter max_rnge, did you mean max_range"):
        load_config(OctomapServerSensorModel, {"max_rnge": 1.0}, without_meaning("sensor_model"))
