"""Configurations of the stage."""

import pytest

from pose_graph_mapping.config import MappingConfig, RegistrationConfig
from pose_graph_mapping.graph.mapper import PoseGraphMapper
from stage_config import ConfigError, documented, load_config


@pytest.mark.parametrize("cls", [MappingConfig, RegistrationConfig])
def test_defaults_are_valid_and_documented(cls):
    assert cls().validate() == []
    assert all(unit and meaning for _, _, unit, meaning in documented(cls))


def test_every_violation_is_listed():
    with pytest.raises(ConfigError, match=r"(?s)method.*chain_min_range_m"):
        load_config(RegistrationConfig, {"method": "magic", "chain_min_range_m": 40.0})


def test_unknown_name_suggests_the_nearest():
    with pytest.raises(ConfigError, match="did you mean graph_dist_m"):
        load_config(MappingConfig, {"graph_dist": 8.0})


def test_mapper_refuses_a_wrong_configuration():
    with pytest.raises(ValueError, match="graph_dist_m"):
        PoseGraphMapper(MappingConfig(graph_dist_m=-1.0), lambda a, b, T, covariance: None)
