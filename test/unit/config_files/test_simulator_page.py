"""docs/simulator.md says what hardware and ideal are."""

from pathlib import Path

from pybullet_simulation import IDEAL, IDEAL_TIMING, SimulationConfig, TimingConfig
from stage_config import to_mapping

PAGE = Path(__file__).resolve().parents[3] / "docs" / "simulator.md"


def test_table_has_the_values_of_both_and_every_one_in_which_they_differ() -> None:
    hardware, ideal = (
        {**to_mapping(config), **{f"timing/{name}": value for name, value in to_mapping(timing).items()}}
        for config, timing in ((SimulationConfig(), TimingConfig()), (IDEAL, IDEAL_TIMING))
    )
    rows = [
        [cell.strip(" `") for cell in line.split("|")[2:5]]
        for line in PAGE.read_text().partition("## Worlds from files")[0].splitlines()
        if line.startswith("| ") and "`" in line
    ]
    told = {name: (float(a), float(b)) for name, a, b in rows}
    assert told == {name: (hardware[name], ideal[name]) for name in told}
    assert {name for name in hardware if hardware[name] != ideal[name]} <= told.keys()
