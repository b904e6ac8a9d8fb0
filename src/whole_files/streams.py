"""Standard output on a disk that is full: what is said is lost, and nobody ends for it."""

import contextlib
import logging
import sys
from typing import TextIO


class _Unfailing:
    """A stream whose writes do not fail."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with contextlib.suppress(OSError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        with contextlib.suppress(OSError):
            self._stream.flush()

    def __getattr__(self, name: str) -> object:
        return getattr(self._stream, name)


def words_end_nobody() -> None:
    """From now on neither standard output and error, nor a log file, ends this process by a disk that takes nothing."""
    logging.raiseExceptions = False
    if not isinstance(sys.stdout, _Unfailing):
        sys.stdout, sys.stderr = _Unfailing(sys.stdout), _Unfailing(sys.stderr)  # type: ignore[assignment]
