"""Loading a configuration reports every violation at once and changes nothing silently."""

import math
from dataclasses import dataclass
from typing import Any

import pytest

from stage_config import ConfigError, check_ranges, documented, load_config, parameter, to_mapping


@dataclass(frozen=True)
class Oven:
    """A stage to be configured."""

    heat_k: float = parameter(450.0, "K", "temperature inside", low=300.0, high=600.0)
    trays: int = parameter(2, "-", "trays in use", low=1, high=4)
    mode: str = parameter("bake", "-", "what it does", choices=("bake", "grill"))
    fan: bool = parameter(False, "-", "whether air is moved")
    size_m: tuple[float, ...] = parameter((0.5, 0.4), "m", "width and depth", low=0.1)

    def validate(self) -> list[str]:
        problems = check_ranges(self)
        if self.mode == "grill" and self.fan:
            problems.append("fan = True does not go with mode = 'grill'")
        return problems


@dataclass(frozen=True)
class Plain:
    """A stage without a rule of its own."""

    count: int = parameter(1, "-", "how many", low=0)


def problems(values: dict[str, Any]) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        load_config(Oven, values)
    return str(caught.value).splitlines()


def test_nothing_given_is_the_defaults() -> None:
    assert load_config(Oven, {}) == Oven()


def test_values_given_replace_defaults_in_their_type() -> None:
    config = load_config(Oven, {"heat_k": 500, "size_m": [1, 0.5], "fan": True})
    assert config == Oven(heat_k=500.0, size_m=(1.0, 0.5), fan=True)
    assert isinstance(config.heat_k, float)


def test_all_violations_are_listed_one_a_line() -> None:
    found = problems({"heat_k": 700.0, "trays": 0, "mode": "boil", "heet_k": 3.0, "fan": 1})
    assert len(found) == 5
    assert all(line.startswith("Oven: ") for line in found)


def test_unknown_name_is_told_with_the_nearest() -> None:
    assert problems({"heet_k": 400.0}) == ["Oven: unknown parameter heet_k, did you mean heat_k?"]


def test_unknown_name_like_none_is_told_with_those_there_are() -> None:
    assert problems({"xyz": 1}) == ["Oven: unknown parameter xyz; known: heat_k, trays, mode, fan, size_m"]


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_number_that_is_not_finite_is_refused(value: float) -> None:
    assert "is not finite" in problems({"heat_k": value})[0]


@pytest.mark.parametrize(
    "values",
    [{"heat_k": "hot"}, {"trays": 2.0}, {"trays": True}, {"fan": 1}, {"mode": 3}, {"size_m": 0.5}, {"heat_k": True}, {"heat_k": None}],
    ids=str,
)
def test_value_of_another_type_is_refused(values: dict[str, Any]) -> None:
    assert "is no " in problems(values)[0]


def test_range_holds_for_every_member_of_a_tuple() -> None:
    assert problems({"size_m": [0.5, 0.01]}) == ["Oven: size_m = (0.5, 0.01) is below 0.1"]


@pytest.mark.parametrize("heat_k", [300.0, 600.0])
def test_bounds_are_inclusive(heat_k: float) -> None:
    assert load_config(Oven, {"heat_k": heat_k}).heat_k == heat_k


def test_rules_between_parameters_are_checked() -> None:
    assert problems({"mode": "grill", "fan": True}) == ["Oven: fan = True does not go with mode = 'grill'"]


def test_ranges_are_checked_without_a_rule_of_its_own() -> None:
    with pytest.raises(ConfigError, match="count = -1 is below 0"):
        load_config(Plain, {"count": -1})


def test_effective_values_load_again() -> None:
    config = load_config(Oven, {"size_m": [1.0, 2.0], "mode": "grill"})
    assert to_mapping(config)["size_m"] == [1.0, 2.0]
    assert load_config(Oven, to_mapping(config)) == config


def test_every_parameter_is_documented_with_default_unit_and_meaning() -> None:
    rows = list(documented(Oven))
    assert [row[0] for row in rows] == ["heat_k", "trays", "mode", "fan", "size_m"]
    assert rows[0] == ("heat_k", 450.0, "K", "temperature inside")
