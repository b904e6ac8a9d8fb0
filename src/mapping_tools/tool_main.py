"""From a tool's shell script to its main: python -m mapping_tools.tool_main NAME MODULE [ARGUMENTS]. Ctrl-C is one line, not a traceback.

The exit code is then 130; where it was terminated, 143. A tool whose files are not as they were says so as the text of its
KeyboardInterrupt.
"""

import contextlib
import importlib
import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import NoReturn

_BY_SIGNAL = 128  # and the signal, as shells have it
_NOTHING = "nothing was written"
_AGAIN_S = 0.05


class Interrupts:
    """How often Ctrl-C was pressed or the tool was terminated, and what each time does."""

    def __init__(self, name: str) -> None:
        self._name, self._number, self.count = name, int(signal.SIGINT), 0

    def end(self, told: str = "") -> NoReturn:
        """Says so, and ends without Python's own end, which may die of an interrupt that went through `exec`."""
        with contextlib.suppress(OSError):
            sys.stdout.flush()
        os.write(2, f"./{self._name}: interrupted; {told or _NOTHING}\n".encode())
        os._exit(_BY_SIGNAL + self._number)

    def end_at_once(self, number: int, _frame: FrameType | None) -> None:
        """While modules are imported: a library may swallow an exception there, or hang by it."""
        self._number = number
        self.end()

    def raise_one(self, number: int, _frame: FrameType | None) -> None:
        """Afterwards. The second time is passed over: what the first one began, files to be removed, is to come to its end."""
        self._number = number
        self.count += 1
        if self.count != 2:
            raise KeyboardInterrupt

    def raise_again(self, _number: int, _frame: FrameType | None) -> None:
        """For an interrupt that fell into a destructor or a callback, which Python ignores."""
        raise KeyboardInterrupt

    def ignored(self, what: "sys.UnraisableHookArgs") -> None:
        """Python's hook for exceptions that it ignores."""
        if issubclass(what.exc_type, KeyboardInterrupt):
            signal.setitimer(signal.ITIMER_REAL, _AGAIN_S)
        else:
            sys.__unraisablehook__(what)


def run(name: str, module: str, arguments: Sequence[str]) -> int:
    """The exit code of a tool's main; 130 when it was interrupted, 143 when it was terminated."""
    interrupts = Interrupts(name)
    # of a job in the background Ctrl-C is ignored: it is not meant for it
    heard = [number for number in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(number) is not signal.SIG_IGN]
    for number in heard:
        signal.signal(number, interrupts.end_at_once)
    importlib.import_module(module)
    sys.unraisablehook = interrupts.ignored
    signal.signal(signal.SIGALRM, interrupts.raise_again)
    try:
        for number in heard:
            signal.signal(number, interrupts.raise_one)
        return _main(module, arguments)
    except BaseException as error:
        if not interrupts.count or isinstance(error, SystemExit):
            raise
        told = str(error) if isinstance(error, KeyboardInterrupt) else ""  # else a library made another error of it
        interrupts.end(told)
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # it ends anyway
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _main(module: str, arguments: Sequence[str]) -> int:
    sys.argv = [module, *arguments]
    code = importlib.import_module(module).main()
    assert isinstance(code, int)
    return code


if __name__ == "__main__":
    sys.exit(run(sys.argv[1], sys.argv[2], sys.argv[3:]))
