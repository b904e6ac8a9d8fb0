"""Configuration of a stage: one frozen dataclass is the only home of its defaults; this module checks and fills it.

It also reads the YAML in which people write one.
"""

from stage_config.loading import (
    ConfigError,
    Configuration,
    check_below,
    check_ranges,
    documented,
    load_config,
    nearest,
    parameter,
    to_mapping,
)
from stage_config.runtime import RuntimeParameter, changed_sections, runtime_parameters
from stage_config.yaml_text import yaml_values

__all__ = [
    "ConfigError",
    "Configuration",
    "RuntimeParameter",
    "changed_sections",
    "check_below",
    "check_ranges",
    "documented",
    "load_config",
    "nearest",
    "parameter",
    "runtime_parameters",
    "to_mapping",
    "yaml_values",
]
