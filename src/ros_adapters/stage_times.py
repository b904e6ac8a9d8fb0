"""Wall time of named pieces of work: reported with the results, never read back by what decides."""

import time
from collections.abc import Iterator
from contextlib import contextmanager


class StageTimes:
    """Counts pieces of work by name and sums their seconds."""

    def __init__(self) -> None:
        self._counts: dict[str, int] = {}
        self._seconds: dict[str, float] = {}

    @contextmanager
    def of(self, name: str) -> Iterator[None]:
        """Counts what is done in the with-block."""
        started = time.perf_counter()
        yield
        self._counts[name] = self._counts.get(name, 0) + 1
        self._seconds[name] = self._seconds.get(name, 0.0) + time.perf_counter() - started

    def count(self, name: str) -> tuple[int, float]:
        """How many pieces of this name there were, and their seconds in all."""
        return self._counts.get(name, 0), self._seconds.get(name, 0.0)
