"""What the mapping node remembers of its sweeps: whether it knows where the robot is, and how matches went."""

from dataclasses import replace

import numpy as np
import pytest
from explore_3dnav.msg import MappedSweep

from pose_graph_mapping.graph.mapping_update import MappingUpdate
from pose_graph_mapping.registration.matching import RegistrationResult, Verdict
from ros_adapters.mapping_memory import MappingMemory

RESULT = RegistrationResult(np.eye(4), np.eye(6), 1.0, 1.0, 0.0, 3, np.zeros((0, 6)), Verdict.ACCEPTED, "")
FIRST = MappingUpdate(0, np.eye(4)[None], np.eye(4), None, False, 0, 0)
MATCHED = replace(FIRST, result=RESULT, match_used=True, loop_closures=2)
REFUSED = replace(MATCHED, match_used=False, loop_closures=0)


def test_sweep_that_is_placed_tells_where_the_robot_is_until_odometry_leaps_again() -> None:
    memory = MappingMemory(lost=True, unknown_s=[5.0, 9.0])
    assert memory.is_lost_at(1.0)
    memory.place(6.0, FIRST)
    assert not memory.is_lost_at(8.0) and memory.is_lost_at(9.0)


def test_newest_of_the_sweeps_that_were_handled_lately_is_told() -> None:
    memory = MappingMemory(lost=False)
    assert memory.handled_s < 0.0
    for stamp_s in range(30):
        memory.handle(float(stamp_s))
    assert memory.handled_s == 29.0 and 28.0 in memory.lately_s and 5.0 not in memory.lately_s


def test_failure_of_the_last_sweep_is_remembered_until_one_is_placed() -> None:
    memory = MappingMemory(lost=False, failure=MappedSweep(failure="too few points"))
    memory.place(6.0, FIRST)
    assert memory.failure is None


@pytest.mark.parametrize(
    ("updates", "counts"), [([FIRST], (0, 0, 0)), ([MATCHED, REFUSED, REFUSED], (2, 2, 2)), ([REFUSED, MATCHED], (2, 1, 0))]
)
def test_loops_and_refused_matches_are_counted(updates: list[MappingUpdate], counts: tuple[int, int, int]) -> None:
    memory = MappingMemory(lost=False)
    for k, update in enumerate(updates):
        memory.place(float(k), update)
    assert (memory.loop_closures, memory.refused, memory.refused_in_a_row) == counts


def test_map_of_which_sweeps_are_lost_is_not_gone_on_with() -> None:
    memory = MappingMemory(lost=False)
    assert memory.why_not(0) == ""  # it died before the first
    memory.mapped = 12
    assert memory.why_not(12) == memory.why_not(13) == ""  # one more: it died between disk and topics
    assert "of 12 sweeps that were mapped 5 are on disk" in memory.why_not(5)
