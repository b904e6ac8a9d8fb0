"""The node's side: it says that it gets on, and keeps what it has to remember where a next process of it finds that."""

import contextlib
import errno
import faulthandler
import os
import pickle
import signal
from collections.abc import Mapping
from pathlib import Path
from typing import TypeVar, cast

from whole_files import refusal

V = TypeVar("V")

PULSE, MEMORY = "EXPLORE_3DNAV_PULSE", "EXPLORE_3DNAV_MEMORY"  # a pipe to write to, and a folder
BEAT, STILL_STARTING, ENDING = b".", b"s", b"e"
SHOW_STACKS = signal.SIGUSR1
_STACKS = "stacks"
_OVER = (EOFError, OSError, pickle.UnpicklingError)


class Life:
    """What one process of a node shares with the one that starts it again; without that nothing is kept, and `is_first` holds."""

    def __init__(self, environment: Mapping[str, str] | None = None) -> None:
        """`environment`: the process's own by default."""
        given = os.environ if environment is None else environment
        self._pulse = int(given[PULSE]) if PULSE in given else None
        self._folder = Path(given[MEMORY]) if MEMORY in given else None
        self._problems: dict[str, str] = {}  # by name
        self.is_first = self._folder is None or not (self._folder / "lived").exists()

    @property
    def is_revived(self) -> bool:
        """Whether somebody starts this node again when it dies."""
        return self._pulse is not None and self._folder is not None

    @property
    def problem(self) -> str:
        """Why something is not kept any more; empty when all is."""
        return next(iter(self._problems.values()), "")

    def begun(self) -> None:
        """From now on the next process of this node is not the first."""
        if self._folder is not None:
            try:
                (self._folder / "lived").touch()
            except OSError as error:
                self._problems["lived"] = refusal(error, self._folder / "lived")

    def show_stacks(self) -> None:
        """From now on SHOW_STACKS writes what all threads are at where `stacks_of` finds it: for when it hangs."""
        if self._folder is not None:
            with contextlib.suppress(OSError):
                self._stacks = (self._folder / _STACKS).open("w")  # stays open: it is written to in the signal's handler
                faulthandler.register(SHOW_STACKS, file=self._stacks)

    def beat(self, *, starts: bool = False) -> None:
        """Says that the node gets on, or with its start; where nobody listens nothing happens."""
        self._say(STILL_STARTING if starts else BEAT)

    def ends(self) -> None:
        """Says that the node has been asked to end, or has decided to: there is to be no next process."""
        self._say(ENDING)

    def _say(self, word: bytes) -> None:
        if self._pulse is not None:
            try:
                os.write(self._pulse, word)
            except OSError:
                self._pulse = None

    def keep(self, name: str, value: object) -> None:
        """Remembers a value under a name. A process that is killed meanwhile leaves the one before.

        Where it cannot be written the node lives on, and `problem` says why: what is kept is old from then on.
        """
        if self._folder is None:
            return
        new = self._folder / f"{name}.new"  # in RAM: nothing is to be waited for, as `write_whole` does
        try:
            new.write_bytes(pickle.dumps(value, pickle.HIGHEST_PROTOCOL))
            new.replace(self._folder / name)
            self._problems.pop(name, None)
        except OSError as error:
            self._problems[name] = refusal(error, self._folder / name)
            with contextlib.suppress(OSError):
                new.unlink()

    def kept(self, name: str, otherwise: V) -> V:
        """What the process before remembered last under a name; `otherwise`, of the same type, where there is nothing."""
        try:
            return otherwise if self._folder is None else cast(V, pickle.loads((self._folder / name).read_bytes()))
        except FileNotFoundError:
            return otherwise

    def note(self, name: str, value: object) -> None:
        """Adds a value to those noted under a name."""
        if self._folder is None:
            return
        path, data = self._folder / name, pickle.dumps(value, pickle.HIGHEST_PROTOCOL)
        try:
            descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
            try:
                size = os.fstat(descriptor).st_size
                if os.write(descriptor, data) < len(data):  # half of one would hide all that come after it
                    os.ftruncate(descriptor, size)
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            finally:
                os.close(descriptor)
        except OSError as error:
            self._problems[name] = refusal(error, path)

    def notes(self, name: str) -> list[object]:
        """All that was noted under a name, oldest first; one that was being written when the process died is left out."""
        found: list[object] = []
        try:
            with (self._folder / name).open("rb") if self._folder else open(os.devnull, "rb") as file:
                while True:
                    found.append(pickle.load(file))
        except _OVER:
            return found

    def forget(self, name: str) -> None:
        """Nothing is kept or noted under a name any more."""
        if self._folder is not None:
            (self._folder / name).unlink(missing_ok=True)


def stacks_of(folder: Path) -> str:
    """What the threads of the process with this memory were at when it was asked last; empty where it was not, or did not answer."""
    try:
        return (folder / _STACKS).read_text()
    except OSError:
        return ""
