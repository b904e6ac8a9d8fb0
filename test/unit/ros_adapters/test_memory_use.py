"""What a node has of memory is read of its own process; of one that is gone, or is another's, nothing is said."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from ros_adapters.memory_use import memory_mb

GROWS = "import sys, time; a = bytearray(80_000_000); a[::1000] = a[::1000]; del a; print('grown', flush=True); time.sleep(60)"


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
