"""How much memory each node has of this machine, by the kernel's word; and the return of what it does not need."""

import ctypes
import re
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path

Revived = Mapping[str, Mapping[str, int | str]]
"""`/revival` of the parameter server: what the processes above nodes say, by node."""

_SIZE = re.compile(r"^Vm(HWM|RSS):\s+(\d+) kB", re.MULTILINE)
_RETURN_EVERY_S = 10.0  # of wall time
_NAMED = {"HWM": "peak", "RSS": "end"}


def memory_mb(revived: Revived) -> dict[str, dict[str, float]]:
    """Resident megabytes by node: the most that its process has had, and what it has now. Nodes of other machines are left out.

    revived: the pids of the processes above the nodes.
    """
    found = {}
    for name, above in revived.items():
        try:
            child = Path(f"/proc/{above['pid']}/task/{above['pid']}/children").read_text().split()[0]
            if f"__name:={name}" not in Path(f"/proc/{child}/cmdline").read_text().split("\0"):
                continue
            sizes = _SIZE.findall(Path(f"/proc/{child}/status").read_text())
        except (OSError, KeyError, IndexError):
            continue
        found[name] = {_NAMED[kind]: round(int(kb) / 1000, 1) for kind, kb in sizes}
    return found


def give_back_free_memory() -> None:
    """From now on this process gives free memory back to the system, every few seconds and beside all else.

    The C library keeps what was freed between two blocks that are still in use. Clouds of all sizes leave more of it with every sweep.
    After 150 sweeps it was nearly a third of the mapping node's memory. Another C library than GNU's is left alone.
    """
    trim: Callable[[int], int] | None = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        threading.Thread(target=_now_and_then, args=(trim,), daemon=True).start()


def _now_and_then(trim: Callable[[int], int]) -> None:
    while True:
        time.sleep(_RETURN_EVERY_S)
        trim(0)
