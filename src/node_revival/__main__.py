"""`python -m node_revival COMMAND...`: runs a node, and starts it again when it was killed, broke or hangs.

Between roslaunch and the node. A node that ends by itself, with 0, or with 2 for a wrong parameter, is not started again; nor one that
said that it ends, however that goes, or dies three times in a minute. The parameter `revival/NODE` in the node's namespace says this
process's pid, how many times it started the node again, and why it gave up.
The node's memory is a folder that lives as long as this process.
"""

import contextlib
import math
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import xmlrpc.client
from collections.abc import Sequence
from pathlib import Path

from node_life.life import BEAT, ENDING, MEMORY, PULSE, SHOW_STACKS, stacks_of
from node_life.watch import REFUSED, Deaths, RevivalConfig, Watch, processor_s
from roslaunch_process.children import end_with_parent
from whole_files import refusal

_PREFIX = "explore_3dnav_"
_LOOK_S = 0.25
_ANSWERS_WITHIN_S = 0.5
_ROOTS = ("/dev/shm", tempfile.gettempdir())  # a node keeps its state at every step: on a disk that takes a millisecond
_ROOM_BYTES = 1_000_000
_REFUSES = 2
_WANTED = (0, _REFUSES)  # exit codes of a node that ends as it should


class _Master:
    """The parameter server, as far as this process needs it."""

    def __init__(self, name: str) -> None:
        """name: the node's, with its namespace."""
        namespace, _, node = name.rpartition("/")
        self._key = f"{namespace}/revival/{node}"
        self._server = xmlrpc.client.ServerProxy(os.environ.get("ROS_MASTER_URI", "http://localhost:11311"))

    def tell(self, key: str, value: int | str) -> None:
        """Sets revival/NODE/KEY in the node's namespace; where there is no master any more the terminal alone knows."""
        try:
            self._server.setParam("/node_revival", f"{self._key}/{key}", value)
        except (OSError, xmlrpc.client.Error):
            pass


class Revival:
    """One node and its processes, one after the other."""

    def __init__(self, command: Sequence[str], memory: Path | None, config: RevivalConfig) -> None:
        self._command, self._memory, self._config = command, memory, config
        self._node = next((word[8:] for word in command if word.startswith("__name:=")), Path(command[0]).name)
        self._asked_to_end, self._asked_s, self._had_begun = False, math.inf, False
        self._full_name = f"{_namespace(command)}/{self._node}"
        self._master = _Master(self._full_name)

    def run(self) -> int:
        """Until the node has ended for good; its exit code, 128 and the signal when it was killed."""
        for number in (signal.SIGINT, signal.SIGTERM):  # roslaunch sends them to the node, too: they are of one group
            signal.signal(number, self._end)
        deaths, count = Deaths(self._config), 0
        self._master.tell("pid", os.getpid())
        self._master.tell("gave_up", "")  # an earlier launch on the same master may have left something
        while True:
            code, why, is_ending = self._live()
            if self._asked_to_end or is_ending or code in _WANTED:
                if code == _REFUSES:
                    self._master.tell("gave_up", REFUSED)
                return code if code >= 0 else 128 - code
            if self._memory is None:  # the next one would take itself for the first
                self._master.tell("gave_up", "it died, and nothing was kept of it")
                return code if code >= 0 else 128 - code
            why = why or (f"killed by signal {-code}" if code < 0 else f"exit code {code}")
            if deaths.too_many(time.monotonic()):
                self._master.tell("gave_up", f"{self._config.deaths} times within {self._config.within_s:.0f} s, the last time: {why}")
                self._say(f"died too often: {why}")
                return code if code >= 0 else 128 - code
            count += 1
            self._master.tell("times", count)
            self._say(f"died: {why}; it is started again")
            time.sleep(self._config.delay_s)

    def _end(self, _number: int, _frame: object) -> None:
        self._asked_to_end = True

    def _say(self, text: str) -> None:
        sys.stderr.write(f"[explore] {self._full_name.lstrip('/')} {text}\n")
        sys.stderr.flush()

    def _live(self) -> tuple[int, str, bool]:
        """One process from its start to its end: its code, why it was ended here, if it was, and whether it was about to end."""
        reading, writing = os.pipe()
        environment = {**os.environ, PULSE: str(writing), **({MEMORY: str(self._memory)} if self._memory else {})}
        process = subprocess.Popen(self._command, env=environment, pass_fds=(writing,), preexec_fn=end_with_parent)
        os.close(writing)
        watch, why = Watch(self._config, time.monotonic()), ""
        try:
            while process.poll() is None:
                if beats := bool(select.select([reading], [], [], _LOOK_S)[0]):
                    if ENDING in (said := os.read(reading, 4096)):
                        watch.end(time.monotonic())
                    elif said:
                        watch.beat(time.monotonic(), starts=BEAT not in said)
                    else:
                        time.sleep(0.01)  # it is about to have ended
                if self._asked_to_end:
                    self._ask_again(process, watch)
                elif not beats:
                    why = why or watch.hung(time.monotonic(), processor_s(process.pid))
                    if why:
                        why += self._stacks(process)
                        process.kill()
        finally:
            os.close(reading)
        return process.returncode, why, watch.is_ending

    def _ask_again(self, process: "subprocess.Popen[bytes]", watch: Watch) -> None:
        """A node that does not say that it ends has not heard it. One that was not up yet has nothing to save."""
        now_s = time.monotonic()
        if self._asked_s == math.inf:
            self._asked_s, self._had_begun = now_s, watch.has_beaten
        elif now_s - self._asked_s > self._config.hears_s and not watch.is_ending:
            self._asked_s = now_s
            process.send_signal(signal.SIGINT if self._had_begun else signal.SIGKILL)

    def _stacks(self, process: "subprocess.Popen[bytes]") -> str:
        """Has a node that hangs say where, beside its log file; in words where that is, empty where it does not say."""
        log = next((word[7:] for word in self._command if word.startswith("__log:=")), "")
        if self._memory is None or not log:
            return ""
        process.send_signal(SHOW_STACKS)
        time.sleep(_ANSWERS_WITHIN_S)
        if not (told := stacks_of(self._memory)):
            return ""
        path = Path(f"{log}.hung")
        with contextlib.suppress(OSError):
            path.write_text(told)
        return f" ({path} says where)"


def _namespace(command: Sequence[str]) -> str:
    """Of the node, as rospy finds it: "" or "/left"."""
    told = next((word[6:] for word in command if word.startswith("__ns:=")), os.environ.get("ROS_NAMESPACE", ""))
    return f"/{told.strip('/')}".rstrip("/")


def forget_dead(root: Path) -> None:
    """Removes the memories that killed processes of this program have left."""
    for folder in root.glob(f"{_PREFIX}*_*"):
        if not Path(f"/proc/{folder.name.removeprefix(_PREFIX).partition('_')[0]}").exists():
            shutil.rmtree(folder, ignore_errors=True)


def main(command: Sequence[str]) -> int:
    """Runs the command; its exit code."""
    memory = _memory()
    try:
        return Revival(command, memory, RevivalConfig()).run()
    finally:
        if memory is not None:
            shutil.rmtree(memory, ignore_errors=True)


def _memory() -> Path | None:
    """A new folder for what a node keeps; None, and a word, where there is no room for one."""
    told = []
    for root in map(Path, _ROOTS):
        forget_dead(root)
        try:
            folder = Path(tempfile.mkdtemp(prefix=f"{_PREFIX}{os.getpid()}_", dir=root))
            (folder / "room").write_bytes(bytes(_ROOM_BYTES))
            (folder / "room").unlink()
            return folder
        except OSError as error:
            told.append(refusal(error, root / _PREFIX))
    sys.stderr.write(f"[explore] nothing is kept for a restart: {'; '.join(told)}\n")
    return None


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
