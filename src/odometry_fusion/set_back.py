"""Was the clock set back, or does one input stamp too early for a moment? Between the inputs' buffers and the filter."""

from collections import Counter
from collections.abc import Iterator

SET_BACK_ALONE_S = 1.0  # an input whose stamps lie before its latest for so long tells of a clock that was set back

Row = list[float]


class SetBackWatch:
    """Holds samples whose stamps jumped back until they are believed, or turn out to be late, which is counted under `<source>_late`."""

    def __init__(self, dropped: Counter[str]) -> None:
        self._dropped = dropped
        self._held: dict[str, list[tuple[float, Row]]] = {}  # by input

    def hold(self, source: str, stamp_s: float, row: Row) -> bool:
        """Holds one; True when the clock was set back: both inputs say so, or one does for long."""
        if source in self._held and stamp_s <= self._held[source][-1][0]:
            self.forget(source)
        held = self._held.setdefault(source, [])
        held.append((stamp_s, row))
        return len(self._held) == 2 or stamp_s - held[0][0] >= SET_BACK_ALONE_S

    def forget(self, source: str) -> None:
        """What is held of an input was late: it is in order again, or jumped back once more."""
        if source in self._held:
            self._dropped[f"{source}_late"] += len(self._held.pop(source))

    def believed(self) -> Iterator[tuple[str, float, Row]]:
        """What is held, with its input, oldest first; nothing is, from then on."""
        held, self._held = self._held, {}
        yield from sorted((source, *sample) for source, samples in held.items() for sample in samples)
