"""Children that do not outlive their parent."""

import ctypes
import signal

_PR_SET_PDEATHSIG = 1


def end_with_parent() -> None:
    """To be called in a child before it becomes its program: SIGINT when its parent dies.

    Heard also where the parent ignores the signal, as a shell's background does.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGINT)
