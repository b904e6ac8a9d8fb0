"""Damages good files and reads them: `python file_fuzzer.py SEED COUNT FOLDER` prints one JSON line of what is wrong with the readers.

Each damaged file lies in FOLDER while it is read, so that one that kills the process, or takes more than twenty seconds, is still there.
"""

from __future__ import annotations

import json
import re
import resource
import signal
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from fuzzed_files import Kind, kinds

LIMIT_S = 20.0
MEMORY_BYTES = 3 << 30  # more than the process has when it begins
_NUMBERS = (b"nan", b"inf", b"-1", b"0", b"1e308", b"1e-320", b"99999999999", b"9223372036854775808", b"4294967295", b"0,5", b"", b"x")
_WORDS = (b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\xc0\x7f", b"\0\0\0\0", b"\0\0\0\x80", b"\0\0\x80\x7f")
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_HEAD_BYTES = 600
Mutation = Callable[[bytearray, np.random.Generator], bytes]


def _bits(data: bytearray, rng: np.random.Generator) -> bytes:
    for at in rng.integers(0, len(data), int(rng.integers(1, 12))):
        data[at] ^= 1 << int(rng.integers(8))
    return bytes(data)


def _head_bits(data: bytearray, rng: np.random.Generator) -> bytes:
    for at in rng.integers(0, min(len(data), _HEAD_BYTES), 2):
        data[at] ^= 1 << int(rng.integers(8))
    return bytes(data)


def _cut(data: bytearray, rng: np.random.Generator) -> bytes:
    return bytes(data[: int(rng.integers(0, len(data)))])


def _word(data: bytearray, rng: np.random.Generator) -> bytes:
    at = int(rng.integers(0, max(1, len(data) - 4)))
    data[at : at + 4] = _WORDS[int(rng.integers(len(_WORDS)))]
    return bytes(data)


def _block(data: bytearray, rng: np.random.Generator) -> bytes:
    """Removed, doubled, or made zeros."""
    a, b = sorted(rng.integers(0, len(data) + 1, 2).tolist())
    b = min(b, a + 64)
    return bytes([data[:a] + data[b:], data[:b] + data[a:], data[:a] + bytes(b - a) + data[b:]][int(rng.integers(3))])


def _line(data: bytearray, rng: np.random.Generator) -> bytes:
    """Of the head: removed, doubled, or changed for another."""
    lines = bytes(data).split(b"\n")
    a, b = rng.integers(0, min(len(lines), 14), 2).tolist()
    kind = int(rng.integers(3))
    if kind == 2:
        lines[a], lines[b] = lines[b], lines[a]
    else:
        lines[a : a + 1] = [] if kind == 0 else [lines[a], lines[a]]
    return b"\n".join(lines)


def _number(data: bytearray, rng: np.random.Generator) -> bytes:
    return _renumbered(data, rng, lambda texts: [_NUMBERS[int(rng.integers(len(_NUMBERS)))], *texts[1:]])


def _swap(data: bytearray, rng: np.random.Generator) -> bytes:
    return _renumbered(data, rng, lambda texts: texts[::-1])


def _renumbered(data: bytearray, rng: np.random.Generator, change: Callable[[list[bytes]], list[bytes]]) -> bytes:
    """Two numbers of the text, or of the head, changed."""
    found = [m.span() for m in _NUMBER.finditer(bytes(data[: _HEAD_BYTES if rng.integers(2) else len(data)]))]
    if len(found) < 2:
        return _bits(data, rng)
    (a, b), (c, d) = sorted(found[int(k)] for k in rng.choice(len(found), 2, replace=False))
    first, second = change([bytes(data[a:b]), bytes(data[c:d])])
    return bytes(data[:a]) + first + bytes(data[b:c]) + second + bytes(data[d:])


def _empty(data: bytearray, rng: np.random.Generator) -> bytes:
    return [b"", b"\n", b"\0" * 100, rng.bytes(200)][int(rng.integers(4))]


MUTATIONS: tuple[Mutation, ...] = (_bits, _head_bits, _cut, _word, _block, _line, _number, _number, _swap, _empty)


def fault(kind: Kind, path: Path) -> str | None:
    """What is wrong with how a file was read, or None: it is right to read it, and to refuse it in one line that names it."""
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        said = _said(kind, path)
    shown = [w for w in heard if not issubclass(w.category, ResourceWarning)]  # which Python does not show either
    return said or next((f"{w.category.__name__}: {w.message} in {w.filename}, line {w.lineno}" for w in shown), None)


def _said(kind: Kind, path: Path) -> str | None:
    try:
        kind.read(path)
    except ValueError as error:
        text = str(error)
        if kind.names_file and path.name not in text:
            return f"an error without the file's name: {type(error).__name__}: {text}"
        return f"an error of many lines: {text}" if "\n" in text and not kind.name.endswith(".yaml") else None
    except BaseException as error:
        return f"{type(error).__name__}: {error}"
    return None


def main(seed: int, count: int, folder: Path) -> None:
    rng, made = np.random.default_rng(seed), folder / "made"
    made.mkdir()
    all_kinds = kinds(made)
    for kind in all_kinds:
        (folder / kind.name).write_bytes(kind.content)
        kind.read(folder / kind.name)  # the good one, which also loads what is compiled
        (folder / kind.name).unlink()
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY_BYTES, resource.RLIM_INFINITY))
    faults = []
    for number in range(count):
        kind = all_kinds[number % len(all_kinds)]
        mutation = MUTATIONS[int(rng.integers(len(MUTATIONS)))]
        content = mutation(bytearray(kind.content), rng)
        if rng.integers(4) == 0 and content:
            content = MUTATIONS[int(rng.integers(len(MUTATIONS)))](bytearray(content), rng)
        path = folder / kind.name
        path.write_bytes(content)
        signal.setitimer(signal.ITIMER_REAL, LIMIT_S)  # ends the process, also inside a library
        found = fault(kind, path)
        signal.setitimer(signal.ITIMER_REAL, 0)
        if found:
            kept = folder / f"fault_{number}_{kind.name}"
            path.rename(kept)
            faults.append(f"{kept}: {mutation.__name__}: {found[:300]}")
        path.unlink(missing_ok=True)
    print(json.dumps({"mutations": count, "kinds": len(all_kinds), "faults": faults}))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]))
