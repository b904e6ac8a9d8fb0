"""What a node has of memory is read of its own process; of one that is gone, or is another's, nothing is said."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from ros_adapters.memory_use import memory_mb

GROWS = "import sys, time; a = bytearray(80_000_000); a[::1000] = a[::1000]; del a; print('grown', flush=True); time.sleep(60)"

LEAVES_GAPS = """
import sys, time
from pathlib import Path
from ros_adapters import memory_use

def resident_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

blocks = [bytearray(100_000) for _ in range(2000)]
kept, held_mb = blocks[::100], resident_mb()
del blocks
memory_use._RETURN_EVERY_S = 0.01
memory_use.give_back_free_memory()
until_s = time.monotonic() + 20.0
while resident_mb() > held_mb - 150.0 and time.monotonic() < until_s:
    time.sleep(0.01)
print(held_mb - resident_mb())
"""


@pytest.fixture
def node() -> Iterator[int]:
    """The pid of a process above one that has had 80 MB, and is called a_node."""
    body = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {GROWS!r}, '__name:=a_node'])"
    above = subprocess.Popen([sys.executable, "-c", body], stdout=subprocess.PIPE, start_new_session=True)
    assert above.stdout is not None and above.stdout.readline() == b"grown\n"
    time.sleep(0.05)
    yield above.pid
    os.killpg(above.pid, 9)


def test_peak_and_end_are_those_of_the_node_s_own_process(node: int) -> None:
    found = memory_mb({"a_node": {"pid": node, "times": 1}})["a_node"]
    assert 80.0 < found["peak"] < 200.0 and 1.0 < found["end"] < found["peak"] - 60.0


def test_who_is_gone_or_another_s_is_left_out(node: int) -> None:
    assert (
        memory_mb({"other_node": {"pid": node}, "gone_node": {"pid": 2**22 + 1}, "silent_node": {}, "a_node": {"pid": os.getpid()}}) == {}
    )


def test_memory_between_blocks_that_are_in_use_goes_back() -> None:
    """Without it the mapping node had kept a third of its memory for nothing after 150 sweeps."""
    found = subprocess.run([sys.executable, "-c", LEAVES_GAPS], capture_output=True, text=True, check=True)
    assert float(found.stdout) > 150.0
