"""Dataclass fields with units, meaning and range; loading them from a mapping reports every violation at once."""

import dataclasses
import difflib
import math
from collections.abc import Collection, Iterator, Mapping
from typing import Any, ClassVar, Protocol, TypeVar, cast

C = TypeVar("C")
V = TypeVar("V")


class Configuration(Protocol):
    """Any dataclass."""

    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]


class ConfigError(ValueError):
    """A configuration with at least one wrong name or value; the text lists them all, one a line."""


def parameter(
    default: V,
    unit: str,
    meaning: str,
    *,
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] = (),
    at_runtime: bool = False,
) -> V:
    """A dataclass field with its default, unit ("m", "rad", "-"), meaning and inclusive range or choices.

    `at_runtime`: it may be changed while the stage runs (`runtime`).
    """
    metadata = {"unit": unit, "meaning": meaning, "low": low, "high": high, "choices": choices, "at_runtime": at_runtime}
    return dataclasses.field(default=default, metadata=metadata)


def _number_violation(value: Any, low: float | None, high: float | None) -> str | None:
    if not math.isfinite(value):
        return "is not finite"
    if low is not None and value < low:
        return f"is below {low}"
    if high is not None and value > high:
        return f"is above {high}"
    return None


def _violation(field: dataclasses.Field[Any], value: Any) -> str | None:
    choices = field.metadata.get("choices")
    if choices and value not in choices:
        return f"is none of {', '.join(map(str, choices))}"
    values = value if isinstance(value, tuple) else (value,)
    for item in values:
        if isinstance(item, (int, float)) and not isinstance(item, bool):
            found = _number_violation(item, field.metadata.get("low"), field.metadata.get("high"))
            if found:
                return found
    return None


def check_ranges(config: Configuration) -> list[str]:
    """All violations of the declared ranges and choices of a config dataclass, as sentences."""
    found = ((f.name, getattr(config, f.name), _violation(f, getattr(config, f.name))) for f in dataclasses.fields(config))
    return [f"{name} = {value!r} {text}" for name, value, text in found if text]


def check_below(config: Configuration, low: str, high: str) -> list[str]:
    """The violation, as a sentence, of a field whose value has to lie below that of another; none where it does."""
    a, b = getattr(config, low), getattr(config, high)
    return [f"{low} = {a} is not below {high} = {b}"] if a >= b else []


def _coerce(field: dataclasses.Field[Any], value: Any) -> Any:
    """`value` in the type of the field's default; TypeError when it does not fit without loss."""
    wanted = type(field.default)
    if wanted is tuple and isinstance(value, (list, tuple)):
        return tuple(float(v) if isinstance(v, int) and not isinstance(v, bool) else v for v in value)
    if wanted is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if type(value) is not wanted:
        raise TypeError(f"{field.name} = {value!r} is no {wanted.__name__}")
    return value


def nearest(name: str, known: Collection[str], others: Collection[str] = ()) -> str:
    """What to add to a complaint of a name that nobody knows: the nearest of those that are known or stand beside them, or all known."""
    near = difflib.get_close_matches(name, [*known, *others], n=1, cutoff=0.5)
    return f", did you mean {near[0]}?" if near else f"; known: {', '.join(filter(None, known))}"


def load_config(cls: type[C], values: Mapping[str, object], others: Collection[str] = ()) -> C:
    """A `cls` from its defaults and `values`; ConfigError lists unknown names (with the nearest), wrong types and ranges.

    `others`: names that stand beside those of `cls`, and may be what an unknown one means.
    """
    fields = {f.name: f for f in dataclasses.fields(cls)}  # type: ignore[arg-type]
    problems: list[str] = []
    known: dict[str, Any] = {}
    for name, value in values.items():
        if name not in fields:
            problems.append(f"unknown parameter {name}{nearest(name, fields, others)}")
            continue
        try:
            known[name] = _coerce(fields[name], value)
        except TypeError as error:
            problems.append(str(error))
    config = cls(**known)
    validate = getattr(config, "validate", None)
    problems += validate() if validate else check_ranges(cast(Configuration, config))
    if problems:
        raise ConfigError("\n".join(f"{cls.__name__}: {p}" for p in problems))
    return config


def documented(cls: type) -> Iterator[tuple[str, object, str, str]]:
    """(name, default, unit, meaning) of every field, for the parameter reference."""
    for f in dataclasses.fields(cls):  # type: ignore[arg-type]
        yield f.name, f.default, f.metadata.get("unit", ""), f.metadata.get("meaning", "")


def to_mapping(config: Configuration) -> dict[str, object]:
    """The effective values as plain types, to be saved with the results."""
    return {k: list(v) if isinstance(v, tuple) else v for k, v in dataclasses.asdict(config).items()}
