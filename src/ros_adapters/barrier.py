"""The barrier of lock-step: a node acts on a tick when it has received all that was sent by its end.

The simulator says at the end of every tick how many messages it has sent on each topic, and each node of the chain says the same when it
has acted: with what it heard, and what it sent itself. So the end of the chain knows of everything before it. The barrier decides when a
node acts, never what it acts on.

A node that was started again has lost what was sent meanwhile, and counts its own messages from zero. So the simulator then tells its
last tick once more, as a recount: what was told before is taken as it is, and counted on from there.
"""

from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Tick:
    """The end of a tick: its stamp, and how many messages were sent on each topic since the start, as far as the node heard.

    `recount`: how often the count has begun anew.
    """

    stamp_s: float
    counts: Mapping[str, int] = field(default_factory=dict)
    recount: int = 0


class Barrier:
    """Counts what came, and tells which tick is complete."""

    def __init__(self, after: Sequence[str], topics: Sequence[str]) -> None:
        """`after`: who tells of ticks, each of them of every tick; `topics`: whose messages must be here."""
        self._told: dict[str, deque[Tick]] = {name: deque() for name in after}
        self._topics = tuple(topics)
        self._received: Counter[str] = Counter()
        self._recount = 0
        self._waited_for, self._since_s = "", 0.0

    def received(self, topic: str) -> None:
        """A message of a topic is here."""
        self._received[topic] += 1

    def told(self, by: str, tick: Tick) -> None:
        """Somebody tells of a tick; what he told before a recount is over, and a recount that is known is told once."""
        ticks = self._told[by]
        if tick.recount > self._recount and not any(t.recount == tick.recount for t in ticks):
            ticks.clear()
        ticks.append(tick)

    def missing(self, now_s: float, patience_s: float = 20.0) -> str:
        """What the tick that somebody has told of waits for, as words, once it has for as long; empty when nobody has told of one.

        By the steady clock. While another computes, or is started again, nodes wait for seconds.
        """
        words = self._missing()
        if words != self._waited_for:
            self._waited_for, self._since_s = words, now_s
        return words if now_s - self._since_s >= patience_s else ""

    def _missing(self) -> str:
        if not any(self._told.values()):
            return ""
        untold = [f"{name or 'the simulator'} has not told of the tick" for name, ticks in self._told.items() if not ticks]
        counts = self._counts()
        short = [t for t in self._topics if self._received[t] < counts.get(t, 0)]
        stamp_s = max(ticks[0].stamp_s for ticks in self._told.values() if ticks)
        words = untold + [f"{self._received[t]} of {counts[t]} messages came on {t}" for t in short]
        return f"tick of {stamp_s:.2f} s: {', '.join(words)}" if words else ""

    def _counts(self) -> dict[str, int]:
        """Of the oldest tick of each who told of one: the most that anybody knows of."""
        counts: dict[str, int] = {}
        for ticks in self._told.values():
            for topic, count in ticks[0].counts.items() if ticks else ():
                counts[topic] = max(count, counts.get(topic, 0))
        return counts

    def next(self) -> Tick | None:
        """The oldest tick that all told of and whose messages are here, once, with the counts of all; None while there is none."""
        newest = max((t.recount for ticks in self._told.values() for t in ticks), default=0)
        for ticks in self._told.values():
            while ticks and ticks[0].recount < newest:
                ticks.popleft()
        if not all(self._told.values()):
            return None
        counts = self._counts()
        if newest > self._recount:
            self._recount, self._received = newest, Counter(counts)
        elif any(self._received[topic] < counts.get(topic, 0) for topic in self._topics):
            return None
        stamp_s = max(ticks.popleft().stamp_s for ticks in self._told.values())
        return Tick(stamp_s, counts, self._recount)
