"""Was the clock set back, or does one input stamp too early for a moment? Between the inputs' buffers and the filter."""

from collections.abc import Iterator

SET_BACK_ALONE_S = 1.0  # an input whose stamps lie before its latest for so long tells of a clock that was set back

Row = list[float]


class SetBackWatch:
    """Holds samples whose stamps jumped back until they are believed, or turn out to be late."""

    def __init__(self) -> None:
        self._held: dict[str, list[tuple[float, Row]]] = {}  # by input

    def hold(self, source: str, stamp_s: float, row: Row) -> bool:
        """Holds one; True when the clock was set back: both inputs say so, or one does for long."""
        held = self._held.setdefault(source, [])
        if held and stamp_s <= held[-1][0]:
            held.clear()
        held.append((stamp_s, row))
        return len(self._held) == 2 or stamp_s - held[0][0] >= SET_BACK_ALONE_S

    def late(self, source: str) -> int:
        """How many are held of an input that is in order again: they were late, and are forgotten."""
        return len(self._held.pop(source, []))

    def believed(self) -> Iterator[tuple[str, float, Row]]:
        """What is held, with its input, oldest first; nothing is, from then on."""
        held, self._held = self._held, {}
        yield from sorted((source, *sample) for source, samples in held.items() for sample in samples)
