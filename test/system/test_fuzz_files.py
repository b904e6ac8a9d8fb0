"""No damaged file crashes, hangs or surprises a reader: each gives a result, or a ValueError of one line that names it."""

import json
import os
import subprocess
import sys
from pathlib import Path

FUZZER = Path(__file__).with_name("file_fuzzer.py")
SEED, MUTATIONS = 38, 2000
LIMIT_S = 720.0


def fuzzed(folder: Path, seed: int, count: int) -> list[str]:
    """What a process of the fuzzer found; its end, with the file that it was at, when it was none of its own."""
    path = os.pathsep.join(p for p in sys.path if p)
    command = [sys.executable, str(FUZZER), str(seed), str(count), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, env={**os.environ, "PYTHONPATH": path}, check=False)
    if done.returncode != 0:
        return [f"ended with {done.returncode} at {[p.name for p in folder.glob('*.*')]}: {done.stderr[-2000:]}"]
    found: list[str] = json.loads(done.stdout.splitlines()[-1])["faults"]
    return found


def test_damaged_files_are_read_or_refused_in_one_line(tmp_path: Path) -> None:
    faults = fuzzed(tmp_path, SEED, MUTATIONS)
    assert not faults, f"{len(faults)} of {MUTATIONS}:\n" + "\n".join(faults[:20])
