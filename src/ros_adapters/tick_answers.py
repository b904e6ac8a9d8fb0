"""What came back for the ticks of the simulator: commands, and which tick was answered after how many of them."""

from collections.abc import Sequence

COMMAND_TOPIC = "cmd_vel"
COMMANDS = "/cmd_vel"  # what an answer counts, whatever the topic's full name is


class TickAnswers:
    """Counts, without a lock of its own. Ticks are numbered from 1, the first."""

    def __init__(self) -> None:
        self._newest: tuple[float, float] | None = None
        self._received = self._answered = self._needed = self._recount = 0

    def __str__(self) -> str:
        return f"tick {self._answered} answered last, {self._received} of its {self._needed} commands received"

    def add_command(self, v: float, w: float) -> None:
        """A command (m/s, rad/s) came."""
        self._newest = (v, w)
        self._received += 1

    def add_answer(self, tick: int, topics: Sequence[str], counts: Sequence[int], recount: int = 0) -> None:
        """A tick was answered, when so many messages had been sent on each topic; the first answer of a recount is taken as it counts.

        ValueError when it says nothing of commands.
        """
        if len(topics) != len(counts) or COMMANDS not in topics:
            raise ValueError(f"answer to tick {tick} counts {list(topics)}, expected {COMMANDS} among them")
        if tick >= self._answered and recount >= self._recount:
            self._answered, self._needed = tick, int(counts[list(topics).index(COMMANDS)])
            if recount > self._recount:
                self._recount, self._received = recount, self._needed

    def holds(self, tick: int, recount: int = 0) -> bool:
        """Whether the tick was answered in this recount, and all commands have come that were sent before the newest answer."""
        return self._answered >= tick and self._recount >= recount and self._received >= self._needed

    def take_command(self) -> tuple[float, float] | None:
        """The newest command, once; None when none has come since."""
        newest, self._newest = self._newest, None
        return newest
