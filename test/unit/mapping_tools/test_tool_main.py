"""Ctrl-C of a tool: one line and exit code 130, whatever it was at, and whatever a library makes of the exception."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
TOOLS = ("classify_map", "register_clouds", "optimize_graph", "export_map", "merge_maps", "replay", "map_bag", "calibrate_mount")
PRESS = "os.kill(os.getpid(), signal.SIGINT)"
IN_IMPORT = f"""
try:
    {PRESS}
    time.sleep(0.1)
except BaseException:
    pass
def main(): print("went on")
"""
IN_MAIN = f"""
def main():
    {PRESS}
    time.sleep(9)
"""
IN_EXEC = f"""
def main():
    exec({PRESS!r} + "; time.sleep(9)")
"""
IN_DESTRUCTOR = f"""
class Held:
    def __del__(self):
        {PRESS}
        time.sleep(0.1)
def main():
    held = Held()
    del held
    time.sleep(9)
    print("went on")
"""
MADE_ANOTHER = f"""
def main():
    try:
        {PRESS}
        time.sleep(9)
    except BaseException as error:
        raise SystemError("a callback failed") from error
"""
TOLD = f"""
def main():
    try:
        {PRESS}
        time.sleep(9)
    except KeyboardInterrupt:
        {PRESS}  # by somebody who is impatient
        raise KeyboardInterrupt("half of it stays") from None
"""


def hears_interrupts() -> None:
    """Also where the tests run in the background, for which a shell has interrupts ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def hears_none() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def outcome(folder: Path, body: str, *words: str, is_in_background: bool = False) -> subprocess.CompletedProcess[str]:
    (folder / "a_tool.py").write_text("import os, signal, sys, time\n" + body)
    path = os.pathsep.join([str(folder), *(p for p in sys.path if p)])
    command = [sys.executable, "-m", "mapping_tools.tool_main", "the_tool", "a_tool", *words]
    environment = {**os.environ, "PYTHONPATH": path}
    hears = hears_none if is_in_background else hears_interrupts
    return subprocess.run(command, capture_output=True, text=True, timeout=30, env=environment, preexec_fn=hears)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (IN_IMPORT, "nothing was written"),
        (IN_MAIN, "nothing was written"),
        (IN_EXEC, "nothing was written"),
        (IN_DESTRUCTOR, "nothing was written"),
        (MADE_ANOTHER, "nothing was written"),
        (TOLD, "half of it stays"),
    ],
    ids=["in an import", "in main", "in exec", "in a destructor", "made another error", "told by the tool"],
)
def test_interrupt_is_one_line_and_130(tmp_path: Path, body: str, said: str) -> None:
    done = outcome(tmp_path, body)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", f"./the_tool: interrupted; {said}\n")


def test_terminated_tool_takes_back_what_it_wrote_and_ends_with_143(tmp_path: Path) -> None:
    done = outcome(tmp_path, TOLD.replace("SIGINT", "SIGTERM"))
    assert (done.returncode, done.stdout, done.stderr) == (143, "", "./the_tool: interrupted; half of it stays\n")


def test_job_in_the_background_is_terminated_alike_and_hears_no_interrupt(tmp_path: Path) -> None:
    body = TOLD.replace("time.sleep(9)", "os.kill(os.getpid(), signal.SIGTERM); time.sleep(9)")
    done = outcome(tmp_path, body, is_in_background=True)
    assert (done.returncode, done.stderr) == (143, "./the_tool: interrupted; half of it stays\n")


def test_tool_gets_its_arguments_and_its_exit_code_is_handed_on(tmp_path: Path) -> None:
    done = outcome(tmp_path, "def main():\n    print(sys.argv[1:])\n    return 3\n", "a b", "--c")
    assert (done.returncode, done.stdout, done.stderr) == (3, "['a b', '--c']\n", "")


def test_error_of_a_tool_that_was_not_interrupted_stays_one(tmp_path: Path) -> None:
    done = outcome(tmp_path, "def main():\n    raise SystemError('a fault')\n")
    assert done.returncode == 1 and "Traceback" in done.stderr


@pytest.mark.parametrize("tool", TOOLS)
def test_script_of_a_tool_names_it_and_its_module(tool: str) -> None:
    found = re.search(r"-m mapping_tools\.tool_main (\S+) (\S+) \"\$@\"", (ROOT / tool).read_text(encoding="utf-8"))
    assert found and found[1] == tool and (ROOT / "src" / (found[2].replace(".", "/") + ".py")).is_file()
