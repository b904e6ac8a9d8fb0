"""Was the clock set, or does one input stamp wrongly for a moment? Between the inputs' buffers and the filter."""

from collections import Counter
from collections.abc import Iterator

ALONE_S = 1.0  # an input whose stamps lie elsewhere for so long tells of a clock that was set

Row = list[float]


class StampWatch:
    """Holds samples whose stamps jumped, back or far ahead, until they are believed, or turn out to be wrong."""

    def __init__(self, dropped: Counter[str], wrong: str) -> None:
        """What is wrong is counted in `dropped` under `<source>_<wrong>`."""
        self._dropped, self._wrong = dropped, wrong
        self._held: dict[str, list[tuple[float, Row]]] = {}  # by input

    def hold(self, source: str, stamp_s: float, row: Row) -> bool:
        """Holds one; True when the clock was set, or both paused: both inputs say so, or one does for long."""
        if source in self._held and stamp_s <= self._held[source][-1][0]:
            self.forget(source)
        held = self._held.setdefault(source, [])
        held.append((stamp_s, row))
        return len(self._held) == 2 or stamp_s - held[0][0] >= ALONE_S

    def forget(self, source: str) -> None:
        """What is held of an input was wrong: it is in order again, or jumped once more."""
        if source in self._held:
            self._dropped[f"{source}_{self._wrong}"] += len(self._held.pop(source))

    def believed(self) -> Iterator[tuple[str, float, Row]]:
        """What is held, with its input, oldest first; nothing is, from then on."""
        held, self._held = self._held, {}
        yield from sorted((source, *sample) for source, samples in held.items() for sample in samples)
