"""The one way in which a file gets its name: when all of it is on disk."""

import contextlib
import os
import signal
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path

from whole_files.refusals import RefusedError

_UNFINISHED = ".part.{}"  # libraries go by what a name ends with


def write_whole(path: Path, content: bytes | str) -> None:
    """Replaces `path`, so that a reader, or a crash, sees the old file or the new one; a text is written as UTF-8.

    RefusedError where that cannot be: the old file is as it was, and nothing lies beside it.
    """
    with written_whole(path) as unfinished:
        unfinished.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)


@contextlib.contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """The same for a library that writes files: gives a path beside `path`, whose file has the name afterwards.

    Where the body fails, or the disk, the old file is as it was.
    """
    unfinished = path.with_name(_UNFINISHED.format(path.name))
    try:
        yield unfinished
        _sync(unfinished)
        os.replace(unfinished, path)
        sync_folder(path.parent)
    except BaseException as error:
        with contextlib.suppress(OSError):  # a disk that became read-only keeps it
            unfinished.unlink()
        if isinstance(error, OSError):
            raise RefusedError.of(error, path) from error
        raise


def write_all(files: Mapping[Path, bytes]) -> None:
    """Replaces all of these files, or none: each is on disk under another name before the first gets its own.

    Ctrl-C and SIGTERM are not heard meanwhile. RefusedError as of `write_whole`.
    """
    with _no_interrupt(), contextlib.ExitStack() as stack:
        for path, content in files.items():
            stack.enter_context(written_whole(path)).write_bytes(content)


@contextlib.contextmanager
def _no_interrupt() -> Iterator[None]:
    """Passes over interrupts; other threads than the first hear none anyway."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, signal.SIG_IGN) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)


def sync_folder(folder: Path) -> None:
    """Returns when the names in a folder are on disk."""
    _sync(folder)


def remove_unfinished(folder: Path) -> None:
    """Removes what programs that were killed while they wrote have left in a folder."""
    for path in folder.glob(_UNFINISHED.format("*")):
        path.unlink(missing_ok=True)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
