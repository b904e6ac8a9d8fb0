"""Joins messages of several topics that carry the same stamp: topics are not ordered among each other."""

from collections.abc import Iterator, Sequence

_MAX_WAITING = 200


def stamp_key(stamp_s: float) -> int:
    """A stamp in whole milliseconds: equal for messages of one tick whatever their floating-point history."""
    return round(stamp_s * 1000.0)


class TickJoin:
    """Collects one value a name and stamp; gives out the stamps for which every name is there, in order, each once."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = frozenset(names)
        self._waiting: dict[int, dict[str, object]] = {}
        self._last = -1

    def add(self, name: str, stamp_s: float, value: object) -> None:
        """Adds a value; stamps that were given out already are left out, and time that jumped back starts anew."""
        key = stamp_key(stamp_s)
        if key < self._last - 5000:
            self._waiting.clear()
            self._last = -1
        if key > self._last:
            self._waiting.setdefault(key, {})[name] = value
        while len(self._waiting) > _MAX_WAITING:
            del self._waiting[min(self._waiting)]

    def complete(self) -> Iterator[tuple[float, dict[str, object]]]:
        """(stamp, values) of every complete stamp; older incomplete ones are given up."""
        for key in sorted(self._waiting):
            values = self._waiting.get(key)
            if values is not None and self._names <= values.keys():
                self._last = key
                for old in [k for k in self._waiting if k <= key]:
                    del self._waiting[old]
                yield key / 1000.0, values
