"""Numbers in text, read whole or refused with the line that is wrong. Decimal commas are never taken for points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def numbers_of(line: bytes, number: int) -> list[float]:
    """The numbers of a line, apart by white space; ValueError names the line and the word that is none."""
    return [_number(word, number) for word in line.split()]


def number_rows(lines: Sequence[bytes], width: int, first_line: int) -> Array:
    """(N, width) numbers of the lines that are neither empty nor begin with "#".

    first_line: the number, from 1, that the first of them has in its file. ValueError names the line that has not `width` numbers.
    """
    rows = [(first_line + k, line) for k, line in enumerate(lines) if line.strip() and not line.lstrip().startswith(b"#")]
    if not rows:
        return np.zeros((0, width))
    try:
        table = np.loadtxt((line.decode("ascii") for _, line in rows), ndmin=2, comments=None)
        if table.shape[1] == width:
            return np.asarray(table, dtype=np.float64)
    except ValueError:
        pass  # said below, with the line
    return np.array([_row(line, width, number) for number, line in rows])


def _row(line: bytes, width: int, number: int) -> list[float]:
    numbers = numbers_of(line, number)
    if len(numbers) != width:
        raise ValueError(f"line {number}: {len(numbers)} numbers where {width} are wanted")
    return numbers


def _number(word: bytes, number: int) -> float:
    try:
        if b"_" not in word:
            return float(word)
    except ValueError:
        pass
    advice = "; decimals are wanted with a point" if b"," in word else ""
    raise ValueError(f"line {number}: {word[:40].decode('ascii', 'replace')!r} is no number{advice}")
