"""Configuration of a stage: one frozen dataclass is the only home of its defaults; this module checks and fills it."""

from stage_config.loading import ConfigError, check_ranges, documented, load_config, parameter, to_mapping

__all__ = ["ConfigError", "check_ranges", "documented", "load_config", "parameter", "to_mapping"]
