"""What a person is told of a file that could not be written: which disk, why, and what to do."""

import errno
import os
import resource
import shutil
from pathlib import Path


class RefusedError(OSError):
    """A file that could not be written; as a text it is one line that says which, and what to do."""

    @classmethod
    def of(cls, error: OSError, path: Path) -> "RefusedError":
        """Of what the system says."""
        return error if isinstance(error, cls) else cls(error.errno, refusal(error, path))

    def __str__(self) -> str:
        return str(self.strerror)


def refusal(error: OSError, path: Path) -> str:
    """One line: the file, its disk, what is the matter with it, and what to do."""
    if isinstance(error, RefusedError):
        return str(error)
    code = error.errno or 0
    if code in (errno.EMFILE, errno.ENFILE):
        return f"{path}: this process may open {resource.getrlimit(resource.RLIMIT_NOFILE)[0]} files, and has: raise `ulimit -n`"
    if code == errno.EFBIG:
        return f"{path}: files here may not be so large: raise `ulimit -f`"
    told = _ADVICE.get(code)
    return f"{path}: the disk {_disk(path)} {told}" if told else f"{path}: cannot be written: {error.strerror or error}"


_ADVICE = {
    errno.ENOSPC: "is full: make room there",
    errno.EDQUOT: "has no more room for this user: make room, or raise the quota",
    errno.EROFS: "is read-only: mount it for writing",
    errno.EIO: "fails: copy what it holds to another one",
}


def _disk(path: Path) -> str:
    """Where its disk is mounted, and how large it is."""
    folder = next((p for p in path.absolute().parents if p.is_dir()), Path("/"))
    while not os.path.ismount(folder):
        folder = folder.parent
    try:
        return f"{folder} of {shutil.disk_usage(folder).total / 1e6:.0f} MB"
    except OSError:
        return str(folder)
