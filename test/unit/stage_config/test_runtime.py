"""Parameters that may be changed while a stage runs: their names, and requests that are obeyed as a whole or refused."""

from dataclasses import dataclass

import pytest

from stage_config import ConfigError, changed_sections, check_ranges, parameter, runtime_parameters


@dataclass(frozen=True)
class Drive:
    """A stage to be tuned."""

    slow_mps: float = parameter(0.1, "m/s", "slowest", low=0.0, high=1.0, at_runtime=True)
    fast_mps: float = parameter(0.5, "m/s", "fastest", low=0.0, high=1.0, at_runtime=True)
    wheels: int = parameter(4, "-", "how many", low=3)

    def validate(self) -> list[str]:
        found = check_ranges(self)
        return found + ([f"slow_mps = {self.slow_mps} is above fast_mps = {self.fast_mps}"] if self.slow_mps > self.fast_mps else [])


@dataclass(frozen=True)
class Look:
    """Another."""

    times: int = parameter(2, "-", "how often", low=1, at_runtime=True)
    at_end: str = parameter("stay", "-", "then", choices=("stay", "home"), at_runtime=True)
    often: bool = parameter(False, "-", "again and again", at_runtime=True)


SECTIONS = {"": Drive(), "look": Look()}


def refusal(changes: dict[str, object]) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        changed_sections(SECTIONS, changes)
    return str(caught.value).splitlines()


def test_names_are_section_and_field_as_octomap_server_has_them() -> None:
    found = runtime_parameters(SECTIONS)
    assert list(found) == ["slow_mps", "fast_mps", "look_times", "look_at_end", "look_often"]
    assert (found["fast_mps"].value, found["fast_mps"].low, found["fast_mps"].high) == (0.5, 0.0, 1.0)
    assert (found["look_times"].low, found["look_times"].high) == (1, 2**31 - 1)
    assert found["look_at_end"].choices == ("stay", "home")
    assert found["slow_mps"].meaning == "slowest [m/s]"


def test_only_sections_that_are_others_then_are_given() -> None:
    changed = changed_sections(SECTIONS, {"look_times": 3, "fast_mps": 0.5})
    assert changed == {"look": Look(times=3)}


def test_values_that_are_right_only_together_are_judged_together() -> None:
    assert changed_sections(SECTIONS, {"slow_mps": 0.7, "fast_mps": 0.8}) == {"": Drive(0.7, 0.8)}
    assert refusal({"slow_mps": 0.7}) == ["Drive: slow_mps = 0.7 is above fast_mps = 0.5"]


def test_request_is_refused_as_a_whole_with_all_that_is_wrong() -> None:
    found = refusal({"fast_mps": 2.0, "look_times": 1.5, "look_at_end": "fly", "look_time": 2, "wheels": 3})
    assert [line.removeprefix("Drive: ").removeprefix("Look: ") for line in found] == [
        "unknown parameter look_time, did you mean look_times?",
        "wheels cannot be changed while the node runs: set it before the start",
        "fast_mps = 2.0 is above 1.0",
        "times = 1.5 is no int",
        "at_end = 'fly' is none of stay, home",
    ]
