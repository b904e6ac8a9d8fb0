"""Wall time of named pieces of work: reported with the results, never read back by what decides."""

import time
from types import TracebackType


class StageTimes:
    """Counts pieces and sums their seconds; a piece lasts from `begin` to the next `begin` or the end of the with-block."""

    def __init__(self) -> None:
        self._counts: dict[str, int] = {}
        self._seconds: dict[str, float] = {}
        self._current: tuple[str, float] | None = None

    def begin(self, name: str) -> None:
        self._end()
        self._current = (name, time.perf_counter())

    def _end(self) -> None:
        if self._current is not None:
            name, started = self._current
            self._counts[name] = self._counts.get(name, 0) + 1
            self._seconds[name] = self._seconds.get(name, 0.0) + time.perf_counter() - started
            self._current = None

    def count(self, name: str) -> tuple[int, float]:
        """How many pieces of this name there were, and their seconds in all."""
        return self._counts.get(name, 0), self._seconds.get(name, 0.0)

    def __enter__(self) -> "StageTimes":
        return self

    def __exit__(self, _type: type[BaseException] | None, _value: BaseException | None, _trace: TracebackType | None) -> None:
        self._end()
