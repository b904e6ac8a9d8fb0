"""Exploration does as it is asked: paused, bounded, sent home and on again, at the end at home, and started anew, by its services."""

from pathlib import Path

from exploring import explored_beside, summary
from test_on_a_robot import free_port


def test_what_people_ask_of_exploration(tmp_path: Path) -> None:
    explored_beside("request_client.py", f"world:=rooms seed:=2 at_end:=home out:={tmp_path}", free_port())
    found = summary(tmp_path)
    assert str(found["stop_reason"]).startswith("explored") and found["collisions"] == 0, found
    assert found["end_from_start_m"] < 0.2 and found["end_from_start_rad"] < 0.2 and found["coverage"] > 0.99, found
