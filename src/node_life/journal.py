"""A state that is too large to be kept at every message: it is kept now and then, with what came since."""

from typing import TypeVar

from node_life.life import Life

V = TypeVar("V")


class Journal:
    """One state of a node. Who takes it up must take what it knows already for repeated: a process may die between two writes."""

    def __init__(self, life: Life, name: str, most: int = 1000) -> None:
        """`most`: notes after which `note` asks for the state."""
        self._life, self._state, self._notes, self._most = life, name, f"{name}_notes", most
        self._count = 0

    def taken_up(self, otherwise: V) -> tuple[V, list[object]]:
        """The state of the process before, `otherwise` where there is none, and what was noted since, oldest first."""
        return self._life.kept(self._state, otherwise), self._life.notes(self._notes)

    def note(self, value: object) -> bool:
        """Notes what came; True when it is time to `keep` the state."""
        self._life.note(self._notes, value)
        self._count += 1
        return self._count > self._most

    def keep(self, state: object) -> None:
        """The state, with all that was noted."""
        self._life.keep(self._state, state)
        self._life.forget(self._notes)
        self._count = 0
