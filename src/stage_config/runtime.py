"""Parameters that may be changed while a stage runs: fields marked `at_runtime`, named as dynamic_reconfigure wants names."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields

from stage_config.loading import ConfigError, Configuration, load_config, nearest, to_mapping

Value = bool | int | float | str


@dataclass(frozen=True)
class RuntimeParameter:
    """One of them: `name` without slashes, its section and field, and its value now with what it may be."""

    name: str
    section: str
    field: str
    value: Value
    low: Value
    high: Value
    choices: tuple[str, ...]
    meaning: str


def runtime_parameters(sections: Mapping[str, Configuration]) -> dict[str, RuntimeParameter]:
    """Those of a node's configurations, by name: "section_field", as octomap_server has sensor_model_hit for sensor_model/hit."""
    found = (_parameter(section, config, f.name) for section, config in sections.items() for f in fields(config) if _is_marked(f.metadata))
    return {parameter.name: parameter for parameter in found}


def changed_sections(sections: Mapping[str, Configuration], changes: Mapping[str, object]) -> dict[str, Configuration]:
    """The configurations with some values changed, by name; only those that are others then.

    ConfigError lists what is wrong, as at the start: unknown names with the nearest, types, ranges, and values that contradict each other.
    """
    known, problems = runtime_parameters(sections), []
    by_section: dict[str, dict[str, object]] = {}
    for name, value in changes.items():
        if name in known:
            by_section.setdefault(known[name].section, {})[known[name].field] = value
        else:
            problems.append(_unknown(name, sections, known))
    found: dict[str, Configuration] = {}
    for section, values in by_section.items():
        try:
            found[section] = load_config(type(sections[section]), {**to_mapping(sections[section]), **values})
        except ConfigError as error:
            problems.append(str(error))
    if problems:
        raise ConfigError("\n".join(problems))
    return {section: config for section, config in found.items() if config != sections[section]}


def _is_marked(metadata: Mapping[str, object]) -> bool:
    return bool(metadata.get("at_runtime"))


def _flat(section: str, field: str) -> str:
    return f"{section}_{field}".lstrip("_")


def _parameter(section: str, config: Configuration, name: str) -> RuntimeParameter:
    about, value = config.__dataclass_fields__[name].metadata, getattr(config, name)
    low, high, (least, most) = about["low"], about["high"], _limits(value)
    unit = about["unit"]
    return RuntimeParameter(
        name=_flat(section, name),
        section=section,
        field=name,
        value=value,
        low=least if low is None else type(value)(low),
        high=most if high is None else type(value)(high),
        choices=about["choices"],
        meaning=about["meaning"] + (f" [{unit}]" if unit != "-" else ""),
    )


def _limits(value: Value) -> tuple[Value, Value]:
    """The widest range of its type."""
    if isinstance(value, bool):
        return False, True
    if isinstance(value, str):
        return "", ""
    return (-math.inf, math.inf) if isinstance(value, float) else (-(2**31), 2**31 - 1)


def _unknown(name: str, sections: Mapping[str, Configuration], known: Mapping[str, RuntimeParameter]) -> str:
    if name in {_flat(section, f.name) for section, config in sections.items() for f in fields(config)}:
        return f"{name} cannot be changed while the node runs: set it before the start"
    return f"unknown parameter {name}{nearest(name, known)}"
