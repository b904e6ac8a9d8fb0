"""Exploration among others: a joystick in between, the graph that lives on, and goals in the finished map, with move_base's clients."""

from pathlib import Path

from exploring import explored_beside, summary
from test_on_a_robot import free_port


def test_joystick_in_between_and_goals_in_the_finished_map(tmp_path: Path) -> None:
    explored_beside("goal_client.py", f"world:=rooms seed:=1 out:={tmp_path}", free_port())
    found = summary(tmp_path)
    assert str(found["stop_reason"]).startswith("explored") and found["collisions"] == 0, found
