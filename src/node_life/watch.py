"""Whether a process gets on, by its beats and by what it does with the processors; and how often it may die."""

from collections import deque
from dataclasses import dataclass, field
from pathlib import Path

REFUSED = "exit code 2: it cannot begin, and has said why"


@dataclass(frozen=True)
class RevivalConfig:
    """When a node is hung, and when it is given up. Seconds of the steady clock."""

    silent_s: float = 5.0  # without a beat, nor work, it is hung (issue 42)
    busy_s: float = 60.0  # without a beat it is hung though it works: no sweep of our worlds takes a node a third of that
    start_s: float = 60.0  # without work before its first beat; while it loads and compiles it works
    end_s: float = 60.0  # without work once it ends: it unsubscribes, and its process is taken down
    hears_s: float = 3.0  # until it says that it ends, once it is asked to: an import may swallow that, or hang in it
    delay_s: float = 0.5  # until it is started again: the master and the listeners have noticed by then
    deaths: int = 3  # so many within `within_s`, and it is given up (issue 42)
    within_s: float = 60.0
    busy_share: float = 0.5  # of the time threads run, or wait for a processor: that is work. Those that only poll have a tenth, or two


def processor_s(pid: int) -> float:
    """Seconds for which all threads of a process have run or waited for a processor so far; 0.0 when it is gone.

    Of all of them: two threads that compute take turns at Python's lock, and neither has half of the time.
    """
    used = 0.0
    for task in Path(f"/proc/{pid}/task").glob("*/schedstat"):
        try:
            ran_ns, waited_ns, _ = task.read_text().split()
        except (OSError, ValueError):
            continue
        used += 1e-9 * (float(ran_ns) + float(waited_ns))
    return used


@dataclass
class Watch:
    """Looks at one process; times are those of one steady clock."""

    config: RevivalConfig
    since_s: float  # of its start, then of its last beat
    has_beaten: bool = False
    is_ending: bool = False
    _looks: deque[tuple[float, float]] = field(default_factory=deque)

    def beat(self, now_s: float, *, starts: bool = False) -> None:
        """It gets on, or with its start."""
        self.since_s, self.has_beaten = now_s, self.has_beaten or not starts
        self._looks.clear()

    def end(self, now_s: float) -> None:
        """It ends, and beats no more."""
        self.is_ending = True
        self.beat(now_s)

    def hung(self, now_s: float, used_s: float) -> str:
        """Why it is to be ended, as words, else empty; `used_s` as `processor_s` tells."""
        self._looks.append((now_s, used_s))
        silent_s = self.config.end_s if self.is_ending else self.config.silent_s if self.has_beaten else self.config.start_s
        while len(self._looks) > 1 and now_s - self._looks[1][0] >= silent_s:
            self._looks.popleft()
        passed_s = now_s - self._looks[0][0]
        if now_s - self.since_s < silent_s or passed_s < silent_s:
            return ""
        if used_s - self._looks[0][1] < self.config.busy_share * passed_s:
            return f"it made no progress for {now_s - self.since_s:.0f} s"
        is_endless = self.has_beaten and now_s - self.since_s > self.config.busy_s
        return f"it computed for {now_s - self.since_s:.0f} s without an end" if is_endless else ""


@dataclass
class Deaths:
    """When a node died."""

    config: RevivalConfig
    _times_s: deque[float] = field(default_factory=deque)

    def too_many(self, now_s: float) -> bool:
        """One more, and whether that is to be the last."""
        self._times_s.append(now_s)
        while now_s - self._times_s[0] > self.config.within_s:
            self._times_s.popleft()
        return len(self._times_s) >= self.config.deaths
