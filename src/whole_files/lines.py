"""A text file that grows while a run goes on, on a disk that may take nothing for a while."""

import contextlib
import os
from pathlib import Path

from whole_files.refusals import refusal


class WaitingLines:
    """Lines appended to a file. What the disk does not take waits in memory, and goes there, in order, as soon as it does.

    Nothing here raises: `problem` says why something waits. The last line may be on disk in part; a reader leaves such a one out.
    """

    def __init__(self, path: Path, *, goes_on: bool = False) -> None:
        """`goes_on`: after the last whole line of a file that another process began."""
        self._path, self._waiting, self._descriptor = path, b"", -1
        self._flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND
        self._is_to_be_cut = goes_on
        if not goes_on:
            self._flags |= os.O_TRUNC
        self.problem = ""
        self.add("")

    def add(self, text: str) -> None:
        """Appends whole lines, in UTF-8, and what waits before them."""
        self._waiting += text.encode("utf-8")
        try:
            self._open()
            while self._waiting:
                self._waiting = self._waiting[os.write(self._descriptor, self._waiting) :]
            self.problem = ""
        except OSError as error:
            self.problem = refusal(error, self._path)

    def close(self) -> None:
        """A last try; what waits then is lost, and `problem` says so."""
        self.add("")
        if self._descriptor >= 0:
            with contextlib.suppress(OSError):
                os.close(self._descriptor)
            self._descriptor = -1

    def _open(self) -> None:
        if self._descriptor >= 0:
            return
        if self._is_to_be_cut:
            _cut_after_last_line(self._path)
        self._descriptor = os.open(self._path, self._flags, 0o644)
        self._is_to_be_cut, self._flags = False, self._flags & ~os.O_TRUNC


def _cut_after_last_line(path: Path) -> None:
    """A process that was killed may have left half a line."""
    with contextlib.suppress(FileNotFoundError):
        whole = path.read_bytes().rpartition(b"\n")
        if whole[2]:
            os.truncate(path, len(whole[0]) + len(whole[1]))
