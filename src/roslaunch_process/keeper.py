"""`python -m roslaunch_process.keeper COMMAND...`: runs a command, and leaves nothing of it behind, whoever is killed.

Between a program and roslaunch. Every process of the launch is below it, also one whose parent was killed.
SIGINT is handed on: the command ends as it wants to. SIGTERM comes when the program has died: the command gets `GRACE_S` to end.
What is left when the command has ended, or was killed, gets the same time, and is killed then.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence

from roslaunch_process.children import adopt_orphans, descendants, end_with_parent, send

GRACE_S = 4.0  # for nodes to save their maps after SIGINT; nothing is to be left after 5 s
_POLL_S = 0.05


def main(command: Sequence[str]) -> int:
    """The command's exit code, 128 and the signal when it was killed."""
    adopt_orphans()
    end_s: list[float] = []  # when those that were told to end have to have ended
    interrupts: list[int] = []  # that wait to be handed on: they may come before the command is there

    def interrupt(number: int, _frame: object) -> None:
        if number == signal.SIGTERM:
            end_s.append(time.monotonic() + GRACE_S)
        interrupts.append(number)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, interrupt)
    launch = subprocess.Popen(command, preexec_fn=end_with_parent)
    while launch.poll() is None and not _is_over(end_s):
        if interrupts:
            interrupts.clear()
            launch.send_signal(signal.SIGINT)
        time.sleep(_POLL_S)
    if not end_s:
        end_s.append(time.monotonic() + GRACE_S)
        send(signal.SIGINT, descendants(os.getpid()))
    while left := descendants(os.getpid()):
        if _is_over(end_s):
            send(signal.SIGKILL, left)
        time.sleep(_POLL_S)
    code = launch.wait()
    return code if code >= 0 else 128 - code


def _is_over(end_s: Sequence[float]) -> bool:
    return bool(end_s) and time.monotonic() > end_s[0]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
