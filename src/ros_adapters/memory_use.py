"""How much memory each node has of this machine, by the kernel's word."""

import re
from collections.abc import Mapping
from pathlib import Path

Revived = Mapping[str, Mapping[str, int | str]]
"""`/revival` of the parameter server: what the processes above nodes say, by node."""

_SIZE = re.compile(r"^Vm(HWM|RSS):\s+(\d+) kB", re.MULTILINE)
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
