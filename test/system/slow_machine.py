"""How much longer things take here and now than on the machine that promises in seconds were measured on."""

import os
import time

SLOWEST = 4.0
"""A wait that only has to end some time may take so many times as long as on that machine."""

LONGEST_S = 800.0
"""No wait lasts longer: CI has a limit of time, and what is cut off there does not say why."""

_REFERENCE_S = 0.004  # that `_work_s` took there
_LOOKS = 3


def patience_s(quick_s: float) -> float:
    """How long to wait for what no quick machine needs `quick_s` for."""
    return min(SLOWEST * quick_s, LONGEST_S)


def slowness() -> float:
    """By how much the processors are slower, times by how much there is more to do than processors; at least 1."""
    cores = min(_work_s() for _ in range(_LOOKS)) / _REFERENCE_S
    busy = os.getloadavg()[0] / (os.cpu_count() or 1)
    return max(1.0, cores) * max(1.0, busy)


def _work_s() -> float:
    begun_s = time.perf_counter()
    sum(i * i for i in range(100_000))
    return time.perf_counter() - begun_s
